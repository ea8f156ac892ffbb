"""tf2 listener for nodes in Python that stand whatever stamp a transform has."""

from __future__ import annotations

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

AHEAD = 0.05
"""s by which clocks that are synchronised differ"""
LARGEST = 2.0**32 - 1.0
"""s: tf2's C++ part ends the process on a stamp beyond it, which secs and nsecs together can be"""


class TfListener(tf2_ros.TransformListener):
    """Keeps out of the buffer: transforms from the future, one of which would lock out all that come after it; static
    ones with a stamp that tf2 does not survive; static ones of a frame that moves, which would stand from then on; and
    any that gives ``root`` a parent, which tf2 would never forget."""

    def __init__(self, buffer: tf2_ros.Buffer, root: str) -> None:
        self._root = root
        self._moving: set[str] = set()
        super().__init__(buffer)

    def moving(self) -> list[str]:
        """Names of the frames that have been seen to move so far."""
        return list(self._moving)

    def callback(self, data: TFMessage) -> None:
        limit = min(rospy.get_time() + AHEAD, LARGEST)
        data.transforms = [
            each for each in data.transforms if 0.0 <= each.header.stamp.to_sec() <= limit and self._allowed(each)
        ]
        self._moving.update(each.child_frame_id for each in data.transforms)
        super().callback(data)

    def static_callback(self, data: TFMessage) -> None:
        data.transforms = [
            each
            for each in data.transforms
            if 0.0 <= each.header.stamp.to_sec() < LARGEST
            and self._allowed(each)
            and each.child_frame_id not in self._moving
        ]
        super().static_callback(data)

    def _allowed(self, transform: TransformStamped) -> bool:
        return transform.child_frame_id.lstrip("/") != self._root
