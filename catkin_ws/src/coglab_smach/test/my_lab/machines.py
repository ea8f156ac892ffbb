"""A user's action: the robot wipes the board with the object in its hand.

machines.yaml::

    actions:
      wipe: {build: my_lab.machines:build_wipe, hand: holding}
"""

from coglab_smach.context.context import Context
from coglab_smach.states.arm import HomeRobot, PtpMotion
from coglab_smach.states.base import CoglabMachine, CoglabState

from my_lab.states import Announce


class CountStrokes(CoglabState):
    """Count the strokes. Outcome ``again`` until there are three."""

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, outcomes=["succeeded", "again"])
        self.strokes = 0

    def run(self, ud) -> str:
        self.strokes += 1
        if self.strokes % 3:
            return "again"
        self.reason = f"{self.strokes} strokes"
        return "succeeded"


def build_wipe(ctx: Context) -> CoglabMachine:
    """Announcement, then three times: to the board and home. Failures go to the recovery of the brain."""
    machine = CoglabMachine(ctx, "strokes", ["succeeded", "failed", "preempted"], input_keys=["object_id"])
    with machine:
        machine.add_state("announce", Announce(ctx), {"succeeded": "to_board"})
        machine.add_state("to_board", PtpMotion(ctx, "board"), {"succeeded": "back"})
        machine.add_state("back", HomeRobot(ctx), {"succeeded": "count"})
        machine.add_state("count", CountStrokes(ctx), {"succeeded": "succeeded", "again": "to_board"})
    return machine
