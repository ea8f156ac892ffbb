"""D4.10 Tables 2 and 3, letter for letter: function, parameter, action, field and topic names."""

from __future__ import annotations

import inspect

import pytest
from ih2_hand.driver import HandSerialDriver, handSerialDriver
from ih2_hand.reasons import Reason

TABLE_2 = {
    "calibration": "data",
    "move_motor": "motor speed is_close_direction",
    "set_finger_position": "finger position",
    "set_finger_force": "motor force",
    "stop_all": "",
    "get_finger_position": "finger",
    "get_finger_force": "finger",
    "get_motor_current": "motor",
    "get_finger_status": "finger",
    "get_all_finger_status": "",
    "set_hand_posture": "pos",
    "set_grasp_mode": "mode force_level is_current",
    "grasp_mode_close": "",
}


@pytest.mark.parametrize("name", TABLE_2)
def test_table_2(name):
    parameters = list(inspect.signature(getattr(HandSerialDriver, name)).parameters)[1:]
    assert parameters == TABLE_2[name].split()


def test_table_2_constructor_and_defaults():
    assert handSerialDriver is HandSerialDriver
    first, *others = inspect.signature(HandSerialDriver).parameters.values()
    assert (first.name, first.default) == ("serial_port", None)
    assert all(other.kind is other.KEYWORD_ONLY for other in others)
    assert inspect.signature(HandSerialDriver.set_grasp_mode).parameters["is_current"].default


def test_reasons_have_the_numbers_of_the_message():
    from coglab_msgs.msg import ReasonCode as codes

    for reason in Reason:
        assert getattr(codes, reason.name) == reason
