"""Events of a running robot across steps of the clock. No roscore."""

import threading
import time
from collections import deque

import pytest
import rospy
from coglab import running
from coglab_msgs.msg import HandoverResult, Say


class Robot:
    """Its back end without topics. `ahead`: of ROS time against the steady clock, s."""

    def __init__(self, monkeypatch):
        self.ahead = 1e9
        monkeypatch.setattr(rospy, "get_time", self.ros)
        self.back = running._RunningBackEnd.__new__(running._RunningBackEnd)
        self.back._lock, self.back._events, self.back._results = threading.Lock(), deque(), []
        self.back._note_connection()

    def ros(self):
        return time.monotonic() + self.ahead

    def say(self, text, ago=0.0):
        message = Say(text=text)
        message.header.stamp = rospy.Time.from_sec(self.ros() - ago)
        self.back._on_say(message)

    def end(self, action, ago=0.0):
        self.back._on_result(HandoverResult(action=action, ended=rospy.Time.from_sec(self.ros() - ago)))

    def heard(self):
        return [event.sentence for event in self.back.events()]


@pytest.mark.parametrize("step", [0.0, -3600.0, 3600.0])
def test_later_events_are_reported_and_latched_ones_are_not(monkeypatch, step):
    robot = Robot(monkeypatch)
    robot.say("latched", 60.0)
    robot.end("latched", 60.0)
    time.sleep(0.1)
    robot.ahead += step
    robot.say("I have it")
    robot.end("take")
    heard = robot.heard()
    assert len(heard) == 2 and heard[0] == "I have it" and heard[1].startswith("take"), heard
    robot.say("latched", 60.0)
    assert not robot.heard()
