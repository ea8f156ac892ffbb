"""tf2 listener for nodes in Python that stand whatever stamp a transform has."""
from __future__ import annotations

import rospy
import tf2_ros
from tf2_msgs.msg import TFMessage

AHEAD = 0.05
"""s by which clocks that are synchronised differ"""
LARGEST = 2.0**32 - 1.0
"""s: tf2's C++ part ends the process on a stamp beyond it, which secs and nsecs together can be"""


class TfListener(tf2_ros.TransformListener):
    """Keeps transforms from the future out of the buffer, where one far ahead would lock out all that come after it,
    and static ones with a stamp that tf2 does not survive."""

    def callback(self, data: TFMessage) -> None:
        limit = min(rospy.get_time() + AHEAD, LARGEST)
        data.transforms = [each for each in data.transforms if 0.0 <= each.header.stamp.to_sec() <= limit]
        super().callback(data)

    def static_callback(self, data: TFMessage) -> None:
        data.transforms = [each for each in data.transforms if 0.0 <= each.header.stamp.to_sec() < LARGEST]
        super().static_callback(data)
