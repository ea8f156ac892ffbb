"""The recogniser's node processes every sight once, even if ROS time steps. No roscore."""

import importlib.util
import time
from pathlib import Path
from unittest.mock import MagicMock

import pytest
import rospy
import tf2_ros
import yaml
from coglab_py import steady
from geometry_msgs.msg import TransformStamped

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "motion_recogniser_node.py"


@pytest.mark.parametrize("step", [0.0, -3.0, -30.0, 60.0])
def test_no_sight_is_lost_when_the_clock_is_set(monkeypatch, step):
    spec = importlib.util.spec_from_file_location("node", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    ros, boot = [1000.0], 50.0
    monkeypatch.setattr(rospy, "get_time", lambda: ros[0])
    monkeypatch.setattr(time, "monotonic", lambda: boot)
    config = SCRIPT.parents[1] / "config"
    frames = yaml.safe_load((config / "frames.yaml").read_text())
    given = {"~patterns": str(config / "patterns.json"), "perception/frames": frames}
    monkeypatch.setattr(rospy, "get_param", given.get)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    for kind in ("Publisher", "Subscriber"):
        monkeypatch.setattr(rospy, kind, MagicMock())
    for part in ("Buffer", "TransformBroadcaster"):
        monkeypatch.setattr(tf2_ros, part, MagicMock())
    monkeypatch.setattr(module, "TfListener", MagicMock())
    monkeypatch.setattr(steady, "SteadyTimer", MagicMock())
    node = module.RecogniserNode()
    node.buffer.lookup_transform = lambda *_: seen
    taken = []
    for tick in range(20):
        boot, ros[0] = boot + 0.01, ros[0] + 0.01 + (step if tick == 10 else 0.0)
        seen = TransformStamped()
        seen.header.stamp = rospy.Time.from_sec(ros[0] - 0.05)
        for _ in range(2):
            if node.newest("human_hand") is not None:
                taken.append(node.seen["human_hand"])
    assert [b - a for a, b in zip(taken, taken[1:], strict=False)] == pytest.approx([0.01] * 19, abs=0.001)
