"""Stamps that no message can carry: nanoseconds beyond a second lead past the last one. They end nobody's timer."""

import importlib.util
import threading
from pathlib import Path
from unittest.mock import MagicMock

import pytest
import rospy
from coglab_msgs.msg import FingertipForces, HandStatus
from coglab_py.pace import Pace
from sensor_msgs.msg import JointState

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "contact_detector_node.py"
JOINTS = [f"j{i}" for i in range(7)]


@pytest.fixture
def node(monkeypatch):
    """The contact detector's node without ROS; what it would publish and what its detector gets are recorded."""
    spec = importlib.util.spec_from_file_location("contact_detector_node", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(
        rospy, "logwarn_throttle", lambda period, words: made.said.append(words)
    )  # needs a clock of ROS
    made = module.ContactDetectorNode.__new__(module.ContactDetectorNode)
    made.pace, made.last_stamp = Pace(), rospy.Time()
    made.joints, made.position, made.velocity, made.joint_stamp = JOINTS, [0.0] * 7, [0.0] * 7, 0.0
    made.lock, made.last_sample, made.recorder, made.force_stamp = threading.Lock(), None, None, 0.0
    made.said = []
    made.detector, made.moving, made.publisher = MagicMock(), MagicMock(), MagicMock()
    for name in ("feed", "feed_measured", "feed_hand", "feed_touch", "force", "share_gone"):
        getattr(made.detector, name).return_value = None
    return made


def stamped(message, secs, nsecs=0):
    """Such a message."""
    message.header.stamp = rospy.Time()
    message.header.stamp.secs, message.header.stamp.nsecs = secs, nsecs
    return message


def test_the_last_stamp_is_not_rounded_to_one_beyond_it(node):
    node.on_torques(stamped(JointState(effort=[0.0] * 7), 2**32 - 1, 999_999_999))
    assert node.last_sample is None


def messages(secs):
    """One for each callback."""
    seven = [0.0] * 7
    return {
        "on_joints": stamped(JointState(name=JOINTS, position=seven, velocity=seven, effort=seven), secs),
        "on_torques": stamped(JointState(effort=seven), secs),
        "on_hand": stamped(HandStatus(), secs),
        "on_touch": stamped(FingertipForces(), secs),
    }


@pytest.mark.parametrize("callback", sorted(messages(0)))
@pytest.mark.parametrize("secs, taken", [(2**32 - 1, True), (1000, True), (2**32, False), (2**32 + 1, False)])
def test_the_contact_detector_refuses_what_it_could_not_pass_on(node, callback, secs, taken):
    getattr(node, callback)(messages(secs)[callback])
    fed = [call for call in node.detector.method_calls if call[0].startswith("feed")]
    assert bool(fed) is taken and len(node.said) == (not taken)
    assert node.last_sample in (None, float(secs)) and (taken or node.last_sample is None)
