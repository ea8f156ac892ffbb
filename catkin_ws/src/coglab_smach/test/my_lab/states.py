"""A user's states: one for any machine, and one that replaces a shipped state.

machines.yaml::

    states:
      exchange_human_to_robot/query_database: my_lab.states:AnnounceAndQuery
"""

from coglab_msgs.msg import Say
from coglab_smach.context.context import Context
from coglab_smach.states.base import CoglabState
from coglab_smach.states.knowledge import QueryDatabase


class Announce(CoglabState):
    """Announce the object, and wait 1 s so that the person can understand it."""

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id"])

    def run(self, ud) -> str:
        self.ctx.say(Say.NOTHING, f"I will use the {ud.object_id}.")
        self.pause(1.0)
        return "succeeded"


class AnnounceAndQuery(QueryDatabase):
    """The shipped state, with an announcement before it."""

    def run(self, ud) -> str:
        self.ctx.say(Say.NOTHING, f"I will take the {ud.object_id}.")
        self.pause(1.0)
        return super().run(ud)
