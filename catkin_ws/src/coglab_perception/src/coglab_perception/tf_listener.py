"""tf2 listener for Python nodes that tolerates every stamp of a transform."""

from __future__ import annotations

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from .frames import CLOCK_TOLERANCE

LARGEST = 2.0**32 - 1.0  # s; the C++ part of tf2 ends the process at a larger stamp, which secs and nsecs can form


class TfListener(tf2_ros.TransformListener):
    """Rejects four kinds of transforms: from the future (they would block all later ones); static with a stamp that
    ends tf2; static for a moving frame (it would stand still); and any that gives ``root`` a parent (tf2 would keep
    it)."""

    def __init__(self, buffer: tf2_ros.Buffer, root: str) -> None:
        self._root = root
        self._moving: set[str] = set()
        super().__init__(buffer)

    def moving(self) -> list[str]:
        """Names of the frames that have moved so far."""
        return list(self._moving)

    def callback(self, data: TFMessage) -> None:
        limit = min(rospy.get_time() + CLOCK_TOLERANCE, LARGEST)
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
