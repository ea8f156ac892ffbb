"""The action server across steps of the clock. No roscore."""

import pytest
import rospy
from actionlib.msg import TestAction, TestActionGoal
from actionlib_msgs.msg import GoalID
from coglab_py.action_server import ActionServer


@pytest.fixture
def clock():
    """Sets ROS time, s."""
    rospy.rostime.set_rostime_initialized(True)
    yield lambda seconds: rospy.rostime._set_rostime(rospy.Time(seconds))
    rospy.rostime.switch_to_wallclock()


class Silent(ActionServer):
    """Accepts messages without topics; `begun` are the ids of the goals that it began, `ended` of those it refused."""

    def __init__(self):
        self.begun, self.ended = [], []
        super().__init__("work", TestAction, lambda goal: self.begun.append(goal.get_goal_id().id), auto_start=False)
        self.started = True

    def publish_result(self, status, _result):
        self.ended.append(status.goal_id.id)

    def publish_status(self):
        pass


def send(server, name, stamp):
    server.internal_goal_callback(TestActionGoal(goal_id=GoalID(rospy.Time(stamp), name)))


def test_a_cancel_with_a_stamp_refuses_only_older_goals(clock):
    clock(1000)
    server = Silent()
    server.internal_cancel_callback(GoalID(rospy.Time(900), ""))
    send(server, "old", 800)
    send(server, "new", 1000)
    assert (server.begun, server.ended) == (["new"], ["old"])


def test_a_goal_begins_after_a_cancel_from_the_future(clock):
    clock(1000)
    server = Silent()
    server.internal_cancel_callback(GoalID(rospy.Time(4_000_000_000), ""))
    clock(1001)
    send(server, "new", 1001)
    assert server.begun == ["new"]


def test_a_goal_begins_after_a_cancel_and_a_clock_that_is_set_back(clock):
    clock(1000)
    server = Silent()
    server.internal_cancel_callback(GoalID(rospy.Time(1000), ""))
    clock(400)
    send(server, "new", 400)
    assert server.begun == ["new"]
