#!/usr/bin/python3
"""Own parts of the brain: an action, and a state that replaces a shipped one.

Both are named as in machines.yaml: ``actions: {nod: my_lab.machines:build_nod}``. The same names serve the running
robot."""

import coglab
from coglab_msgs.msg import Say
from coglab_smach.context.context import Context
from coglab_smach.states.arm import HomeRobot, PtpMotion
from coglab_smach.states.base import CoglabMachine
from coglab_smach.states.knowledge import QueryDatabase
from example import parser, save


class Announce(QueryDatabase):
    """Announces the object and waits 1 s, so that the person can understand it; then the shipped state."""

    def run(self, ud) -> str:
        self.ctx.say(Say.NOTHING, f"I will take the {ud.object_id}.")
        self.pause(1.0)
        return super().run(ud)


def build_nod(ctx: Context) -> CoglabMachine:
    """To the board and back. A failure goes to the brain's own recovery."""
    machine = CoglabMachine(ctx, "nod", ["succeeded", "failed", "preempted"])
    with machine:
        machine.add_state("down", PtpMotion(ctx, "board"), {"succeeded": "up"})
        machine.add_state("up", HomeRobot(ctx), {"succeeded": "succeeded"})
    return machine


options = parser(__doc__).parse_args()
parts = {
    "actions": {"nod": f"{__name__}:build_nod"},
    "states": {"exchange_human_to_robot/query_database": f"{__name__}:Announce"},
}
with coglab.World(seed=3, person="accustomed", settings=parts) as world:
    trial = world.trial("nod", "receive", "give")
for phase in trial.phases:
    if phase.path == "/coglab_master":
        print(f"{phase.start:6.2f} .. {phase.end:6.2f} s  {phase.state}")
print(*trial.results, sep="\n")
save(trial.plot("An action and a state of one's own"), __file__, options.out)
