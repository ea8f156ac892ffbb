"""Calibration of the hand: refused with a reason if the hand would refuse it, else answered with its message."""

import asyncio
import threading
import time
from dataclasses import replace

import pytest
from coglab_console.desk.control_conditions import Standing, reasons
from coglab_console.desk.motion_guard import MotionGuard
from coglab_console.ros import commands
from coglab_msgs.msg import HandStatus, ReasonCode
from console_double import READY
from desk_double import ask, hold_for

FAST, FORCED = {"mode": "fast"}, {"mode": "complete", "force": True}


@pytest.mark.parametrize(
    "change, plain, forced",
    [
        ({}, "", ""),
        ({"calibrated": True}, "is calibrated", ""),
        ({"holding": True}, "may hold", ""),
        ({"calibrating": True}, "calibrates", "calibrates"),
        ({"hand_connected": False}, "does not answer", "does not answer"),
        ({"hand_alive": False}, "is not there", "is not there"),
        ({"in_hub": False}, "under way", "under way"),
    ],
)
def test_calibration_is_refused_if_the_hand_would_refuse_it(change, plain, forced):
    found = reasons(replace(Standing(**READY), **change), MotionGuard())
    for button, part in (("calibrate", plain), ("calibrate_complete", plain), ("calibrate_forced", forced)):
        assert (found[button] == "") == (part == "") and part in found[button], button


def test_calibrated_hand_needs_force_to_calibrate_again(desk):
    desk.backend.now = replace(desk.backend.now, calibrated=True)
    assert "is calibrated" in ask(desk, "a", "calibrate", **FAST)["message"]
    (refused,) = hold_for(desk, 0.1, what=("calibrate", {"mode": "complete"}))
    assert "is calibrated" in refused["message"] and not desk.backend.calls
    (answer,) = hold_for(desk, 1.0, what=("calibrate", FORCED))
    assert answer["success"] and desk.backend.calls == [("calibrate", FORCED)]


class Hand:
    """In place of the view and of the publisher: answers an order with these statuses, one after the other."""

    def __init__(self, *statuses, connections=1):
        self.hand, self.hand_number, self.orders = HandStatus(), 5, []
        self.statuses, self.connections = statuses, connections

    def get_num_connections(self):
        return self.connections

    def publish(self, message):
        self.orders.append(message.data)
        self.answer(self.statuses[:1])  # at once, however busy this computer is
        threading.Thread(target=self.answer, args=(self.statuses[1:],)).start()

    def answer(self, statuses):
        for status in statuses:
            time.sleep(0.02)
            self.hand = status
            self.hand_number += 1


def calibrated_by(hand, monkeypatch, limit=60.0, **arguments):
    monkeypatch.setattr(commands.rospy, "Publisher", lambda *_, **__: hand)
    monkeypatch.setattr(commands, "HAND_LIMIT", limit)
    return asyncio.run(commands.RosBackend(hand, lambda who: None, False).call("calibrate", arguments))


REFUSED = HandStatus(event_code=ReasonCode.HAND_REFUSED, message="calibration refused: the hand may hold an object")
BEGUN = HandStatus(calibrating=True, event_code=ReasonCode.HAND_STARTED, message="calibration complete started")


def test_answer_is_the_message_of_the_hand(monkeypatch):
    hand = Hand(HandStatus(), REFUSED)
    answer = calibrated_by(hand, monkeypatch, **FAST)
    assert not answer["success"] and "may hold an object" in answer["message"] and hand.orders == ["fast"]
    hand = Hand(HandStatus(), BEGUN)
    answer = calibrated_by(hand, monkeypatch, **FORCED)
    assert answer["success"] and "started" in answer["message"] and hand.orders == ["complete force"]


def test_silent_hand_is_reported(monkeypatch):
    answer = calibrated_by(Hand(), monkeypatch, 0.5, **FAST)
    assert not answer["success"] and "answer" in answer["message"]
    answer = calibrated_by(Hand(connections=0), monkeypatch, **FAST)
    assert not answer["success"] and "not there" in answer["message"]


def test_earlier_refusal_is_not_taken_as_answer(monkeypatch):
    hand = Hand(REFUSED, REFUSED, BEGUN)
    hand.hand = REFUSED
    assert calibrated_by(hand, monkeypatch, **FAST)["success"]
    hand = Hand(*[REFUSED] * 8)
    hand.hand = REFUSED
    answer = calibrated_by(hand, monkeypatch, 0.5, **FAST)
    assert not answer["success"] and "may hold an object" in answer["message"]
