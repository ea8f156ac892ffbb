"""The hand node without a master: what it polls, publishes, calibrates, stops and says."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import HandStatus, ReasonCode
from diagnostic_msgs.msg import DiagnosticStatus
from goal_parts import queue_of_goals
from ih2_hand.errors import HandCalibratingError, HandConnectionLost, HandInconsistentError, HandPortError
from ih2_hand.progress import OpenTask, Verdict
from ih2_hand.reasons import Reason
from ih2_hand.ros import diagnostics, hand_node, tracing
from sensor_msgs.msg import JointState
from std_msgs.msg import String


class Topic:
    """A topic that keeps what is published on it."""

    every: dict[str, Topic] = {}

    def __init__(self, name: str, kind: type, **_: object) -> None:
        self.kind, self.told, self.listeners = kind, [], 1
        Topic.every[name] = self

    def publish(self, message: object) -> None:
        assert isinstance(message, self.kind)
        self.told.append(message)

    def get_num_connections(self) -> int:
        return self.listeners


class Report:
    """What one look at the diagnostics says."""

    def __init__(self) -> None:
        self.values: dict[str, str] = {}

    def summary(self, level: int, message: str) -> None:
        self.level, self.message = level, message

    def add(self, key: str, value: str) -> None:
        self.values[key] = value


class Updater:
    """Counts the reports."""

    def __init__(self) -> None:
        self.sent = 0

    def add(self, name: str, fill: object) -> None:
        self.name, self.fill = name, fill

    def setHardwareID(self, name: str) -> None:
        self.hardware = name

    def force_update(self) -> None:
        self.sent += 1


@pytest.fixture
def node(monkeypatch, bench):
    """A node whose port leads to the emulated hand of `bench`, on its clock."""
    settings: dict[str, object] = {}
    rospy.rostime.set_rostime_initialized(True)
    rospy.rostime.switch_to_wallclock()
    queue, master = queue_of_goals(monkeypatch)
    monkeypatch.setattr(rospy, "Publisher", Topic)
    monkeypatch.setattr(rospy, "Service", lambda *_: None)
    monkeypatch.setattr(rospy, "loginfo", lambda *_: None)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)
    monkeypatch.setattr(diagnostics, "Updater", Updater)
    monkeypatch.setattr(hand_node, "GoalQueue", lambda owner: queue)
    monkeypatch.setattr(hand_node, "HandSerialDriver", lambda port, **_: bench.driver)
    monkeypatch.setattr(hand_node.parameters, "read", lambda name, kind, default, *_, **__: settings.get(name, default))
    node = hand_node.HandNode()
    node.settings, node.warnings = settings, master.warnings
    return node


@pytest.fixture
def connected(node):
    node._connect()
    assert node.driver is not None
    return node


def last(name: str = "~hand_status"):
    return Topic.every[name].told[-1]


def report(node) -> Report:
    return node._diagnostics._updater.fill(Report())


def works_off(node) -> None:
    """What was asked of the goals' thread."""
    while not node.goals._mailbox.empty():
        node.goals._handle(node.goals._mailbox.get())


def ends_calibration() -> None:
    for thread in threading.enumerate():
        if thread.name == "calibration":
            thread.join(10.0)


def fails(error: Exception):
    def call(*_: object, **__: object):
        raise error

    return call


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
    connected._poll_once()
    assert connected.driver is None and not last().connected and list(last().motors) == []
    assert last().event_code == ReasonCode.HAND_LINK_LOST and "connection lost: the hand on virtual" in last().message
    assert not bench.link.plugged, "the port is let go"


def test_contradictions_are_borne_unless_three_come_in_a_row(connected, monkeypatch):
    read = connected.driver.read_motors
    for calls in (2, 0), (2, 0), (3, 1):
        monkeypatch.setattr(connected.driver, "read_motors", fails(HandInconsistentError("noise")))
        for _ in range(calls[0]):
            assert connected.driver is not None
            connected._poll_once()
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
    node._port_setting = "/dev/hand"
    assert node._resolve_port() == "/dev/hand"
    node._port_setting = "param:/cell/hand_port"
    with pytest.raises(HandPortError, match="parameter /cell/hand_port is not set"):
        node._resolve_port()
    node.settings["/cell/hand_port"] = "/dev/pts/7"
    assert node._resolve_port() == "/dev/pts/7"


def test_the_end_of_a_goal_is_told_with_the_grip(connected):
    connected.task_ended(OpenTask(100), Verdict("blocked", done=True, reason=Reason.HAND_STALLED))
    assert last().holding and last().message == "hand_open: blocked" and last().event_code == ReasonCode.HAND_STALLED
    connected.task_ended(OpenTask(100), Verdict("open", done=True, ok=True, holding=False))
    assert not last().holding and last().event_code == ReasonCode.NONE


# -- calibration and stop ------------------------------------------------------------------------


def test_a_calibration_is_told_from_begin_to_end(connected):
    connected._poll_once()
    connected._on_calibration(String("fast"))
    works_off(connected)
    ends_calibration()
    told = [(status.event_code, status.calibrating, status.calibrated) for status in Topic.every["~hand_status"].told]
    assert told[-2:] == [(ReasonCode.HAND_STARTED, True, False), (ReasonCode.HAND_ENDED, False, True)]
    assert list(Topic.every["~hand_status"].told[-2].motors) == [], "read before it began"
    assert last().message == "calibration fast ended"


def test_a_calibration_is_refused_with_its_reason(connected):
    connected._on_calibration(String("slow"))
    works_off(connected)
    assert last().event_code == ReasonCode.HAND_REFUSED and "must be fast" in last().message
    connected.lost(HandConnectionLost("gone"))
    connected._on_calibration(String("fast force"))
    works_off(connected)
    assert last().event_code == ReasonCode.HAND_REFUSED and "not connected: connection lost: gone" in last().message
    assert not connected.calibrating


def test_a_calibration_without_an_answer_is_a_lost_hand(connected, bench):
    connected.calibration_began()
    bench.link.plugged = False
    connected._run_calibration(connected.driver, "fast")
    assert not connected.calibrating and not connected.calibrated and connected.driver is None


def test_while_it_calibrates_nothing_is_read(connected, bench):
    connected.calibrating = True
    bench.sent()
    connected._poll_once()
    assert bench.sent() == "" and last().calibrating and list(last().motors) == []


def test_a_stop_is_confirmed_by_the_motors(connected, bench):
    bench.driver.move_motor(2, 100, True)
    answer = connected._on_stop(None)
    assert answer.success and answer.message == "every motor stands"
    assert [motor.mode for motor in bench.hand.motors] == ["stop"] * 5


def test_a_stop_that_is_not_taken_is_repeated_and_then_told(connected, bench, monkeypatch):
    driving = [{"mode": "speed"}] * 5
    asked: list[int] = []
    monkeypatch.setattr(bench.driver, "get_all_finger_status", lambda: asked.append(1) or driving)
    bench.sent()
    answer = connected._on_stop(None)
    assert not answer.success and "a motor still reports a driven mode" in answer.message
    assert len(asked) == 5
    filler = "41 " * 13
    assert bench.sent() == "41 41 " + (filler + "41 ") * 3 + filler + "41"


def test_a_stop_says_what_it_cannot_do(connected, bench):
    connected.calibrating = True
    answer = connected._on_stop(None)
    assert not answer.success and "while it calibrates" in answer.message
    connected.calibrating, bench.link.plugged = False, False
    answer = connected._on_stop(None)
    assert not answer.success and "not confirmed: the hand's port virtual is gone" in answer.message
    connected.lost(HandConnectionLost("gone"))
    answer = connected._on_stop(None)
    assert not answer.success and "nothing sent: connection lost: gone" in answer.message


# -- diagnostics and trace -----------------------------------------------------------------------


def test_diagnostics_warn_of_what_needs_a_hand_and_fail_for_what_is_broken(connected):
    assert report(connected).level == DiagnosticStatus.WARN, "not calibrated"
    connected.calibrated = True
    for reason, level in (
        (Reason.NONE, DiagnosticStatus.OK),
        (Reason.HAND_ENDED, DiagnosticStatus.OK),
        (Reason.HAND_REFUSED, DiagnosticStatus.WARN),
        (Reason.HAND_STALLED, DiagnosticStatus.ERROR),
    ):
        connected.event("so it is", reason)
        told = report(connected)
        assert (told.level, told.message, told.values["reason_code"]) == (level, "so it is", str(int(reason)))
    assert told.values["port"] == "virtual" and told.values["connected"] == "True"
    assert told.values["action"] == "None" and told.values["rate (Hz)"] == "30.0"
    assert {"requests", "resynchronisations", "of these by StopALL", "failed requests"} <= set(told.values)


def test_diagnostics_come_once_a_second_and_with_each_event(node, monkeypatch):
    now = [50.0]
    monkeypatch.setattr(diagnostics, "time", SimpleNamespace(monotonic=lambda: now[0]))
    updater = node._diagnostics._updater
    for elapsed, sent in ((0.0, 1), (0.99, 1), (1.0, 2), (1.5, 2), (2.0, 3)):
        now[0] = 50.0 + elapsed
        node._diagnostics.tick()
        assert updater.sent == sent, elapsed
    node.event("refused", Reason.HAND_REFUSED)
    assert updater.sent == 4 and updater.hardware == node.port


def test_the_trace_is_published_while_somebody_listens(node):
    trace, topic = tracing.TracePublisher(), Topic.every["~trace"]
    trace.hook(">", b"\x44\x02")
    trace.hook(">", b"\x64")
    assert "SetFingerPosition motor 2 to 100" in topic.told[-1].data
    topic.listeners, count = 0, len(topic.told)
    trace.hook(">", b"\x44\x02")
    assert len(topic.told) == count
    topic.listeners = 1
    trace.hook(">", b"\x4c")
    assert "OpenALL" in topic.told[-1].data, "what was cut off before nobody listened is forgotten"


def test_a_status_is_told_again_with_what_was_learnt_since(connected):
    connected._poll_once()
    count = len(Topic.every["~hand_status"].told)
    before: HandStatus = last()
    connected.calibrated = True
    connected.event("news")
    assert len(Topic.every["~hand_status"].told) == count + 1
    assert last().calibrated and not before.calibrated and last().header.stamp == before.header.stamp
    assert len(last().motors) == 5
