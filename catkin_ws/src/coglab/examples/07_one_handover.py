#!/usr/bin/python3
"""One handover each way in virtual time: results, fluency, and the picture of the demo."""

import coglab
from example import parser, save

arguments = parser(__doc__)
arguments.add_argument("--seed", type=int, default=3)
arguments.add_argument("--object", default="mug")
arguments.add_argument("--behaviour", default="normal", help="of the person, such as slow or pull_back")
options = arguments.parse_args()

with coglab.World(seed=options.seed, object=options.object, behaviour=options.behaviour) as world:
    trial = world.trial("receive", "give")

for result in trial.results:
    print(result)
    print("  " + ", ".join(f"{name} {when - result.started:.2f} s" for name, when in result.marks.items()))
fluency = trial.fluency()
print(f"person idle {fluency.human_idle:.0%}, robot idle {fluency.robot_idle:.0%}, both active", end=" ")
print(
    f"{fluency.concurrent_activity:.0%}, functional delay {fluency.functional_delay:+.0%} of {fluency.duration:.1f} s"
)
save(trial.plot(), __file__, options.out)
