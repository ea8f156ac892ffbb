"""What the hand node is asked and told: calibration, stop, diagnostics, trace; without a master."""

from __future__ import annotations

from types import SimpleNamespace

from coglab_msgs.msg import HandStatus, ReasonCode
from diagnostic_msgs.msg import DiagnosticStatus
from ih2_hand.errors import HandConnectionLost
from ih2_hand.reasons import Reason
from ih2_hand.ros import diagnostics, tracing
from node_parts import Topic, ends_calibration, last, report, works_off
from std_msgs.msg import String

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


def test_what_was_read_while_a_calibration_began_is_not_told(connected, bench, monkeypatch):
    read = bench.driver.read_motors
    monkeypatch.setattr(bench.driver, "read_motors", lambda: (read(), connected.calibration_began())[0])
    joints = len(Topic.every["~joint_states"].told)
    connected._poll_once()
    assert len(Topic.every["~joint_states"].told) == joints and list(last().motors) == []
    assert last().holding, "an open hand that is about to move proves nothing"


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
