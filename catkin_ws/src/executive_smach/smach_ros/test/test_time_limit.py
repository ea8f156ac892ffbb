"""Time limits across steps of the wall clock and of simulated time. No roscore."""

import socket
import time

import pytest
import rospy
import smach_ros
from smach_ros.util import TimeLimit, service_answers


class Clocks:
    """The three clocks of a process; they move only here."""

    def __init__(self, monkeypatch):
        self.steady, self.wall = 1000.0, 1.7e9
        monkeypatch.setattr(time, "monotonic", lambda: self.steady)
        monkeypatch.setattr(time, "time", lambda: self.wall)

    def wait(self, seconds, ros=None):
        """`ros`: what /clock shows afterwards."""
        self.steady, self.wall = self.steady + seconds, self.wall + seconds
        if ros is not None:
            rospy.rostime._set_rostime(rospy.Time.from_sec(ros))


@pytest.fixture
def clocks(monkeypatch):
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime.switch_to_wallclock()
    yield Clocks(monkeypatch)
    rospy.rostime.switch_to_wallclock()


def lasts(clocks, limit):
    """Seconds of the steady clock until the limit is over."""
    begun = clocks.steady
    while not limit.expired() and clocks.steady - begun < 100.0:
        clocks.wait(0.25)
    return clocks.steady - begun


@pytest.mark.parametrize("step", (60.0, -30.0))
def test_a_step_of_the_wall_clock_changes_nothing(clocks, step):
    limit = TimeLimit(20.0)
    clocks.wait(1.0)
    clocks.wall += step
    assert lasts(clocks, limit) == pytest.approx(19.0, abs=0.3)


def test_the_first_clock_message_is_no_passed_time(clocks):
    rospy.rostime._set_rostime(rospy.Time(0))
    limit = TimeLimit(20.0)
    clocks.wait(5.0)
    assert not limit.expired()
    clocks.wait(0.1, ros=1.7e9)
    assert not limit.expired()
    clocks.wait(0.1, ros=1.7e9 + 14.0)  # 5.1 s before the clock ran, and these
    assert not limit.expired()
    clocks.wait(0.1, ros=1.7e9 + 15.0)
    assert limit.expired()


def test_silent_or_reset_clock_does_not_shorten_the_limit(clocks):
    rospy.rostime._set_rostime(rospy.Time(100))
    limit = TimeLimit(20.0)
    clocks.wait(16.0)  # the first second may be a late message
    assert not limit.expired()
    clocks.wait(0.1, ros=70.0)
    assert not limit.expired()
    clocks.wait(1.0, ros=76.0)
    assert limit.expired()


def test_a_service_is_known_whatever_the_wall_clock_does(clocks, monkeypatch):
    """rospy.wait_for_service waits by the wall clock: set back by 30 s it does not return for so long."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        uri = f"rosrpc://127.0.0.1:{server.getsockname()[1]}"
        monkeypatch.setattr(smach_ros.util.rosgraph.Master, "lookupService", lambda _, name: uri)
        assert service_answers("/reset")
    assert not service_answers("/reset"), "registered, but its node is gone"
