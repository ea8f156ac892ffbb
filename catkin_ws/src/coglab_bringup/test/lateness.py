"""Whether a late computer is the reason of a failure. A rostest repeats such an action or motion."""

from __future__ import annotations

import rospy
from coglab_msgs.msg import ReasonCode
from rosgraph_msgs.msg import Log

LATE = (
    ReasonCode.COMPUTER_LATE,
    ReasonCode.GOAL_LOST,
    ReasonCode.GOAL_STALE,
    ReasonCode.NODE_SILENT,
    ReasonCode.NOT_IN_COMMAND_MODE,
    ReasonCode.ROBOT_DISCONNECTED,
    ReasonCode.STALE_JOINT_STATE,
)


class Lateness:
    """Follows what the simulated cell logs about this computer."""

    def __init__(self) -> None:
        self._is_busy = self._was_busy = False
        rospy.Subscriber("/rosout", Log, self._on_log, queue_size=1000)

    def _on_log(self, message: Log) -> None:
        if "too busy for real time" in message.msg:
            self._is_busy = self._was_busy = True
        elif "keeps real time" in message.msg:
            self._is_busy = False

    def begin(self) -> None:
        """Call this before the action or motion."""
        self._was_busy = self._is_busy

    def may_explain(self, code: int) -> bool:
        """True if a late computer may have caused a failure with this ReasonCode since begin()."""
        return self._was_busy or code in LATE
