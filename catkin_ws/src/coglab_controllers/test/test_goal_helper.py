"""The goal helper on ROS: published frames, place and rate of the goals, and ranges of the parameters."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rosgraph
import rospy

sys.path.insert(0, str(Path(__file__).resolve().parent))
from coglab_msgs.msg import DmpGoal
from geometry_msgs.msg import TransformStamped
from own_master import node_path, own_master
from robot_fixture import wait_until
from tf2_msgs.msg import TFMessage

TOPIC = "/controller_manager/dmp/dmp_goal"


class Tracker:
    """Publishes frames and receives the resulting goals."""

    def __init__(self, topic: str) -> None:
        self.goals: list[DmpGoal] = []
        self.moving = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self.still = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        self.heard = rospy.Subscriber(topic, DmpGoal, self.goals.append)
        wait_until(lambda: self.heard.get_num_connections() > 0 and self.moving.get_num_connections() > 0, "the helper")

    @staticmethod
    def frame(name: str, x: float, base: str = "lwr_base_link") -> TransformStamped:
        """Turned by a quarter about z."""
        message = TransformStamped(child_frame_id=name)
        message.header.frame_id, message.header.stamp = base, rospy.Time.now()
        message.transform.translation.x = x
        message.transform.rotation.z = message.transform.rotation.w = 0.5**0.5
        return message

    def see(self, name: str, x: float, wait: float = 0.04) -> rospy.Time:
        """One frame of a camera of 25 Hz; its stamp."""
        message = self.frame(name, x)
        self.moving.publish(TFMessage([message]))
        rospy.sleep(wait)
        return message.header.stamp


@contextmanager
def running(hear: str = TOPIC, **parameters: object) -> Iterator[tuple[Tracker, subprocess.Popen]]:
    for name, value in parameters.items():
        rospy.set_param(f"/goal_helper/{name}", value)
    node = subprocess.Popen([node_path("goal_helper_node")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        tracker = Tracker(hear)
        yield tracker, node
        tracker.heard.unregister()
    finally:
        node.kill()
        node.wait(timeout=60.0)
        for name in parameters:
            rospy.delete_param(f"/goal_helper/{name}")


@pytest.fixture(scope="module", autouse=True)
def master() -> Iterator[rosgraph.Master]:
    with own_master() as running_master:
        rospy.init_node("goal_helper_test", disable_signals=True)
        yield running_master
        rospy.signal_shutdown("the test is over")


def test_moving_frame_is_passed_on_without_leaps() -> None:
    with running(offset=[0.1, 0.0, 0.02]) as (tracker, node):
        stamps = []
        # One by one: a node that is late takes the newest of several frames.
        for i in range(12):
            stamps.append(tracker.see("human_hand", 0.5 + 0.001 * i))
            if tracker.goals:
                wait_until(lambda: tracker.goals[-1].header.stamp == stamps[-1], f"the goal of frame {i + 1}")
            else:
                rospy.sleep(0.1)
        told = [goal.header.stamp for goal in tracker.goals]
        assert told == stamps[-len(told) :] and 2 <= len(told) <= 10, "not before the third, and each once"
        goal = tracker.goals[-1]
        assert goal.header.frame_id == "lwr_base_link"
        place = (goal.goal.x, goal.goal.y, goal.goal.z)
        assert place == pytest.approx((0.511, 0.1, 0.02), abs=1e-9), "the offset turns with the frame"
        leap = tracker.see("human_hand", 0.9)
        back = tracker.see("human_hand", 0.512)
        wait_until(lambda: tracker.goals[-1].header.stamp == back, "the frame after the leap")
        assert leap not in [goal.header.stamp for goal in tracker.goals]
        node.send_signal(signal.SIGINT)
        assert node.wait(timeout=60.0) == 0


def test_static_frame_is_repeated_once_a_second() -> None:
    with running("/elsewhere", topic="elsewhere", frame="cup", dmp_frame_name="table") as (tracker, _):
        tracker.still.publish(TFMessage([Tracker.frame("cup", 0.3, "table")]))
        wait_until(lambda: len(tracker.goals) == 1, "the first one")
        begun = rospy.get_time()
        wait_until(lambda: len(tracker.goals) >= 3, "two more")
        assert rospy.get_time() - begun > 1.8
        goal = tracker.goals[-1]
        assert (goal.header.frame_id, goal.header.stamp) == ("table", rospy.Time())
        assert (goal.goal.x, goal.goal.y, goal.goal.z) == pytest.approx((0.3, 0.0, 0.0), abs=1e-9), (
            "no offset by default"
        )


@pytest.mark.parametrize(
    "name, value, expected",
    [
        ("rate", 0.09375, "a number from 0.1 to 1000, got 0.09375"),
        ("rate", 1001.0, "a number from 0.1 to 1000, got 1001"),
        ("offset", [0.0, 0.0], "3 finite numbers"),
        ("frame", [1.0], "a text, got "),
        ("dmp_frame_name", [1.0], "a text, got "),
        ("topic", [1.0], "a text, got "),
    ],
)
def test_a_parameter_that_cannot_be_used_ends_the_start_and_is_named(name: str, value: object, expected: str) -> None:
    rospy.set_param(f"/goal_helper/{name}", value)
    try:
        ended = subprocess.run(
            [node_path("goal_helper_node")], timeout=600, check=False, stderr=subprocess.PIPE, text=True
        )
    finally:
        rospy.delete_param(f"/goal_helper/{name}")
    assert ended.returncode == 1
    told = f"parameter goal_helper/{name}: expected {expected}"
    assert ended.stderr.count(told) == 1, ended.stderr
