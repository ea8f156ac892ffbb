#!/usr/bin/python3
"""Own people: duration of giving with a person who trusts the robot's hand sooner or later."""

import coglab
from coglab_trials import Conditions
from example import new_figure, parser, save

arguments = parser(__doc__)
arguments.add_argument("--seeds", type=int, default=2, help="people of each kind")
options = arguments.parse_args()

TRUST = (0.1, 0.5, 2.0)  # s, for which the person must see the hand at rest
figure = new_figure()
axes = figure.subplots()
for behaviour in ("normal", "hesitant"):
    rows = []
    for trust in TRUST:
        for seed in range(options.seeds):
            person = Conditions(behaviour, "patient", {"trust": trust, "reaction_median": 0.3})
            with coglab.World(seed, conditions=person) as world:
                world.robot.receive()
                result = world.robot.give()
            print(f"{behaviour}, trust after {trust} s, seed {seed}: {result}")
            if result.ok:
                rows.append((trust, result.duration))
    axes.plot(*zip(*rows, strict=True), "o", label=behaviour)
axes.set_xlabel("the person trusts a hand that rests for [s]")
axes.set_ylabel("duration of giving [s]")
axes.legend()
save(figure, __file__, options.out)
