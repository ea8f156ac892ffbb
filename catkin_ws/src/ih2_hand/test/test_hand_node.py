"""The hand node without a master: what can be set, what it polls and publishes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import ReasonCode
from diagnostic_msgs.msg import DiagnosticStatus
from ih2_hand.errors import HandCalibratingError, HandConnectionLost, HandInconsistentError, HandPortError
from ih2_hand.progress import OpenTask, Verdict
from ih2_hand.reasons import Reason
from ih2_hand.ros import hand_node
from node_parts import Topic, fails, last, report
from sensor_msgs.msg import JointState


def test_what_can_be_set_and_how_far(node):
    assert node.asked == {
        "~serial_port": ("",),
        "~rate": (30.0, 1.0, 200.0),
        "~dialect": ("legacy", ("legacy", "v17")),
        "~read_timeout": (0.05, 0.005, 0.5),
        "~use_tension": (False,),
        "~goal_time_limit": (10.0, 0.001, 60.0),
        "~grasps_file": ("",),
    }
    assert node._is_current and node._limit == 10.0
    node.settings |= {"~use_tension": True, "~goal_time_limit": 4.0}
    other = hand_node.HandNode()
    assert not other._is_current and other._limit == 4.0


# -- connection and polls ------------------------------------------------------------------------


def test_a_node_without_its_hand_says_so(node):
    with pytest.raises(HandConnectionLost, match="not connected: not connected yet"):
        node.connected_driver()
    node._poll_once()
    status = last()
    assert not status.connected and list(status.motors) == [] and status.event_code == ReasonCode.HAND_LINK_LOST
    assert report(node).level == DiagnosticStatus.ERROR and report(node).values["connected"] == "False"


def test_a_hand_just_connected_counts_as_holding(connected):
    status = last()
    assert status.connected and status.holding and not status.calibrated and not status.calibrating
    assert status.event_code == ReasonCode.NONE and "connected on virtual" in status.message
    assert connected.connected_driver() is connected.driver and connected.port == "virtual"


def test_a_poll_tells_five_motors_and_their_joints(connected, bench):
    for motor, position in zip(bench.hand.motors, (127.0, 254.0, 127.0, 0.0, 60.0), strict=True):
        motor.position = position
    connected._poll_once()
    assert [motor.position for motor in last().motors] == [127, 254, 127, 0, 60]
    assert [motor.force for motor in last().motors] == [-1, 0, 0, 0, 0]
    joints = last("~joint_states")
    assert isinstance(joints, JointState) and joints.header.stamp == last().header.stamp != rospy.Time()
    assert list(joints.position) == pytest.approx([0.7, 1.5, 0.75, 0.0, 60 / 254 * 1.5])
    for motor in bench.hand.motors:
        motor.position = 254.0
    bench.driver.line.resting = False
    connected._poll_once()
    assert list(last("~joint_states").position) == pytest.approx([1.4, 1.5, 1.5, 1.5, 1.5])
    assert joints.name[0] == "ih2_thumb_abduction" and len(joints.name) == 5
    assert last().holding, "nothing is proved by fingers on their way"


def test_an_open_hand_is_told_to_hold_nothing(connected):
    connected._poll_once()
    assert not last().holding and last().message == "the hand is open: it holds nothing"
    count = len(Topic.every["~hand_status"].told)
    connected._poll_once()
    assert len(Topic.every["~hand_status"].told) == count + 1, "it is an event once"


def test_a_hand_that_is_silent_is_lost_at_once(connected, bench):
    bench.faults.mute = True
    count = len(Topic.every["~hand_status"].told)
    connected._poll_once()
    assert len(Topic.every["~hand_status"].told) == count + 1
    assert connected.driver is None and not last().connected and list(last().motors) == []
    assert last().event_code == ReasonCode.HAND_LINK_LOST and "connection lost: the hand on virtual" in last().message
    assert not bench.link.plugged, "the port is let go"


def test_contradictions_are_borne_unless_three_come_in_a_row(connected, monkeypatch):
    read = connected.driver.read_motors
    for calls in (2, 0), (2, 0), (3, 1):
        monkeypatch.setattr(connected.driver, "read_motors", fails(HandInconsistentError("noise")))
        for _ in range(calls[0]):
            assert connected.driver is not None
            count = len(Topic.every["~hand_status"].told)
            connected._poll_once()
            assert len(Topic.every["~hand_status"].told) == count + (connected.driver is None), "nothing was read"
        assert (connected.driver is None) == bool(calls[1])
        if connected.driver:
            monkeypatch.setattr(connected.driver, "read_motors", read)
            connected._poll_once()
    assert last().message == "connection lost: noise"


def test_a_calibration_that_just_began_is_no_loss(connected, monkeypatch):
    monkeypatch.setattr(connected.driver, "read_motors", fails(HandCalibratingError("calibrates")))
    connected._poll_once()
    assert connected.driver is not None and list(last().motors) == []


def test_the_loss_of_an_older_connection_is_no_news(connected):
    connected.lost(HandConnectionLost("gone"), object())
    assert connected.driver is not None
    connected.lost(HandConnectionLost("gone"))
    assert connected.driver is None and last().message == "connection lost: gone"
    count = len(Topic.every["~hand_status"].told)
    connected.lost(HandConnectionLost("gone again"))
    assert len(Topic.every["~hand_status"].told) == count


@pytest.mark.parametrize("error", [HandPortError("no such port"), OSError("odd")])
def test_a_port_that_stays_closed_is_told_once(node, monkeypatch, error):
    monkeypatch.setattr(hand_node, "HandSerialDriver", fails(error))
    count = len(Topic.every["~hand_status"].told)
    for _ in range(3):
        node._connect()
    assert len(Topic.every["~hand_status"].told) == count + 1
    unforeseen = "the hand's port (the only serial device) cannot be opened" in last().message
    assert str(error) in last().message and unforeseen == isinstance(error, OSError)


def test_the_port_may_stand_in_another_parameter(node):
    assert node._resolve_port() == ""
    node._connect()
    node._port_setting = "/dev/hand"
    node._connect()
    assert node.opened == [None, "/dev/hand"]
    node._port_setting = "param:/cell/hand_port"
    with pytest.raises(HandPortError, match="parameter /cell/hand_port is not set"):
        node._resolve_port()
    node.settings["/cell/hand_port"] = "/dev/pts/7"
    assert node._resolve_port() == "/dev/pts/7"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (hand_node.parameters.ParameterError("it is a number"), "^it is a number$"),
        (OSError("nobody there"), "hand_port cannot be read .nobody there.: is the ROS master there"),
    ],
)
def test_a_parameter_that_cannot_be_read_is_a_port_that_cannot_be_opened(node, monkeypatch, error, words):
    node._port_setting = "param:hand_port"
    monkeypatch.setattr(hand_node.parameters, "read", fails(error))
    with pytest.raises(HandPortError, match=words):
        node._resolve_port()


def test_a_goal_becomes_a_task_while_there_is_a_hand(node):
    goal = SimpleNamespace(speed=300)
    with pytest.raises(HandConnectionLost):
        node.make_task("hand_open", goal)
    node._connect()
    task = node.make_task("hand_open", goal)
    assert isinstance(task, OpenTask) and task.speed == 300


class Rounds:
    """The end of the polling thread, after some rounds on a clock of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
        self.now, self.left, self.waited = 100.0, count, []
        monkeypatch.setattr(hand_node, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(rospy, "is_shutdown", lambda: False)

    def is_set(self) -> bool:
        self.left -= 1
        return self.left < 0

    def wait(self, seconds: float) -> None:
        self.waited.append(seconds)
        self.now += seconds


def test_the_hand_is_polled_at_its_rate_and_looked_for_twice_a_second(node, monkeypatch):
    polls: list[float] = []
    tries: list[float] = []
    node.rate, node._ended = 20.0, Rounds(monkeypatch, 25)
    monkeypatch.setattr(node, "_connect", lambda: tries.append(node._ended.now))
    monkeypatch.setattr(node, "_poll_once", lambda: polls.append(node._ended.now))
    node._poll()
    assert polls == pytest.approx([100.0 + 0.05 * n for n in range(25)])
    assert len(tries) == 3 and tries[:2] == pytest.approx([100.0, 100.5], abs=0.051)
    node._ended, node.driver, tries[:] = Rounds(monkeypatch, 25), object(), []
    node._poll()
    assert tries == [], "it has been found"


def test_a_late_poll_is_not_caught_up_on(node, monkeypatch):
    node.rate, node._ended, node.driver = 20.0, Rounds(monkeypatch, 3), object()
    durations = iter((0.02, 0.3, 0.0))

    def poll() -> None:
        node._ended.now += next(durations)

    monkeypatch.setattr(node, "_poll_once", poll)
    node._poll()
    assert node._ended.waited == pytest.approx([0.03, 0.0, 0.05])


@pytest.mark.parametrize("is_ending", [False, True])
def test_an_unforeseen_error_costs_the_connection_but_not_the_thread(connected, monkeypatch, is_ending):
    connected._ended = Rounds(monkeypatch, 3)
    monkeypatch.setattr(hand_node, "ending", lambda: is_ending)
    monkeypatch.setattr(connected, "_connect", lambda: None)
    monkeypatch.setattr(connected, "_poll_once", fails(KeyError("slip")))
    connected._poll()
    assert len(connected._ended.waited) == (0 if is_ending else 3)
    assert (connected.driver is None) is not is_ending
    assert ("connection lost: internal error: 'slip'" in last().message) is not is_ending


STUCK = """
import threading
import pytest, rospy
from ih2_hand.ros import hand_node
from node_parts import node_without_master
hand_node.HandNode._poll = lambda self: threading.Event().wait()
rospy.spin = lambda: None
node_without_master(pytest.MonkeyPatch(), None).run()
print("has ended", flush=True)
"""


def test_a_port_that_blocks_for_ever_does_not_keep_the_process():
    """As a driver of the kernel may whose device has gone; the polling thread is left behind."""
    here = str(Path(__file__).parent)
    ended = subprocess.run([sys.executable, "-c", STUCK], cwd=here, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0 and ended.stdout == "has ended\n", ended.stderr


def test_the_end_of_a_goal_is_told_with_the_grip(connected):
    connected.task_ended(OpenTask(100), Verdict("blocked", done=True, reason=Reason.HAND_STALLED))
    assert last().holding and last().message == "hand_open: blocked" and last().event_code == ReasonCode.HAND_STALLED
    connected.task_ended(OpenTask(100), Verdict("open", done=True, ok=True, holding=False))
    assert not last().holding and last().event_code == ReasonCode.NONE
