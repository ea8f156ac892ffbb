"""Conversion of poses from and to geometry_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage

from coglab_py.pose import Pose


def pose_of(message: Any) -> Pose:
    """Converts a geometry_msgs/Pose to a Pose."""
    p, q = message.position, message.orientation
    return Pose(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def pose_message(pose: Pose) -> PoseMessage:
    """Converts a Pose to a geometry_msgs/Pose."""
    return PoseMessage(Point(*pose.position), Quaternion(*pose.orientation))
