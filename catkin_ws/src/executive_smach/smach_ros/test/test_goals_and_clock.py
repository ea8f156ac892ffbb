"""Goals of a wrapped machine across steps of the clock. No roscore."""

import pytest
import rospy
from actionlib.msg import TestAction, TestActionGoal
from actionlib.simple_action_server import SimpleActionServer
from actionlib_msgs.msg import GoalID
from smach_ros.action_server_wrapper import _SteadyActionServer


@pytest.fixture
def clock():
    """Sets ROS time, s."""
    rospy.rostime.set_rostime_initialized(True)
    yield lambda seconds: rospy.rostime._set_rostime(rospy.Time(seconds))
    rospy.rostime.switch_to_wallclock()


class Server:
    """The server of a wrapper, without topics. A goal ends at once."""

    def __init__(self, monkeypatch):
        for name in ("publish_result", "publish_status"):
            monkeypatch.setattr(_SteadyActionServer, name, lambda *_arguments: None)
        self.begun = []
        self.simple = SimpleActionServer("work", TestAction, auto_start=False)
        self.simple.register_goal_callback(self.run)
        self.server = _SteadyActionServer(
            "work", TestAction, self.simple.internal_goal_callback, self.simple.internal_preempt_callback, False
        )
        self.simple.action_server, self.server.started = self.server, True

    def run(self):
        self.begun.append(self.simple.accept_new_goal().goal)
        self.simple.set_succeeded()

    def send(self, number, stamp):
        goal = TestActionGoal(goal_id=GoalID(rospy.Time(stamp), f"goal {number}"))
        goal.goal.goal = number
        self.server.internal_goal_callback(goal)

    def cancel(self, stamp):
        self.server.internal_cancel_callback(GoalID(rospy.Time(stamp), ""))


@pytest.fixture
def server(monkeypatch, clock):
    clock(1000)
    return Server(monkeypatch)


def test_a_cancel_with_a_stamp_refuses_only_older_goals(server):
    server.cancel(900)
    server.send(1, 800)
    server.send(2, 1000)
    assert server.begun == [2]


def test_a_goal_begins_after_a_cancel_from_the_future(server, clock):
    server.cancel(4_000_000_000)
    clock(1001)
    server.send(1, 1001)
    assert server.begun == [1]


def test_a_goal_begins_after_a_cancel_and_a_clock_that_is_set_back(server, clock):
    server.cancel(1000)
    clock(400)
    server.send(1, 400)
    assert server.begun == [1]


def test_a_goal_begins_after_another_and_a_clock_that_is_set_back(server, clock):
    server.send(1, 1000)
    clock(400)
    server.send(2, 400)
    clock(401)
    server.send(3, 401)
    assert server.begun == [1, 2, 3]


def test_a_goal_begins_after_one_of_a_client_whose_clock_is_ahead(server, clock):
    server.send(1, 5000)
    clock(1001)
    server.send(2, 1001)
    assert server.begun == [1, 2]
