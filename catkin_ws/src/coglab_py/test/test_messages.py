"""Poses from and to geometry_msgs: every number in its field."""

import numpy as np
import pytest
from coglab_py.messages import pose_message, pose_of
from coglab_py.pose import Pose
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage

MESSAGE = PoseMessage(Point(1.0, 2.0, 3.0), Quaternion(0.1, 0.3, 0.5, 0.7))


def test_a_message_as_a_pose():
    pose = pose_of(MESSAGE)
    assert pose.position == pytest.approx([1.0, 2.0, 3.0])
    assert pose.orientation == pytest.approx([0.1, 0.3, 0.5, 0.7])


def test_a_pose_as_a_message():
    assert pose_message(Pose(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.3, 0.5, 0.7]))) == MESSAGE
    assert pose_message(Pose()) == PoseMessage(Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
