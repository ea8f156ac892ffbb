"""Whether a late computer is the reason of a failure. A rostest repeats such an action or motion, and says so."""

from __future__ import annotations

import rospy
from coglab_msgs.msg import ReasonCode
from coglab_py.pace import TOPIC
from std_msgs.msg import Float64

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
    """Follows the real-time factor of the simulated cell: it is less than 1 on a computer that is too busy."""

    def __init__(self) -> None:
        self._is_busy = self._was_busy = False
        rospy.Subscriber(f"/{TOPIC}", Float64, self._on_factor)

    def _on_factor(self, message: Float64) -> None:
        self._is_busy = message.data < 1.0
        self._was_busy |= self._is_busy

    def begin(self) -> None:
        """Call this before the action or motion."""
        self._was_busy = self._is_busy

    def may_explain(self, code: int) -> bool:
        """True if a late computer may have caused a failure with this ReasonCode since begin()."""
        return code in LATE or self._was_busy and code not in NEVER_LATE
