"""Whether a late computer is the reason of a failure. A rostest repeats such an action or motion, and says so."""

from __future__ import annotations

import rospy
from coglab_msgs.msg import ReasonCode
from rosgraph_msgs.msg import Log

LATE = frozenset(
    {
        ReasonCode.COMPUTER_LATE,
        ReasonCode.GOAL_LOST,
        ReasonCode.GOAL_STALE,
        ReasonCode.NODE_SILENT,
        ReasonCode.NOT_IN_COMMAND_MODE,
        ReasonCode.ROBOT_DISCONNECTED,
        ReasonCode.STALE_JOINT_STATE,
    }
)
"""why a motion or an action ends on a computer that is late; the tests themselves publish the goals"""
NEVER_LATE = frozenset(
    {
        ReasonCode.INVALID_ARGUMENT,
        ReasonCode.OUT_OF_RANGE,
        ReasonCode.UNKNOWN_NAME,
        ReasonCode.BAD_FILE,
        ReasonCode.NOT_SUPPORTED,
        ReasonCode.CONTROLLER_FAULT,
        ReasonCode.OBJECT_UNKNOWN,
        ReasonCode.UNEXPECTED,
    }
)
"""faults that no computer is too slow for"""


def say_again(what: str, why: object) -> None:
    """Print that a part of a test is repeated. ./coglab test lists these lines."""
    print(f"REPEATED {what}: {' '.join(str(why).split())[:300]}", flush=True)


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
        return code in LATE or self._was_busy and code not in NEVER_LATE
