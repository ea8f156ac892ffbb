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


def test_table_2_what_the_readings_return(bench):
    driver = bench.driver
    assert isinstance(driver.get_finger_position(1), int)
    assert isinstance(driver.get_finger_force(1), int)
    assert isinstance(driver.get_motor_current(1), int)
    assert isinstance(driver.get_finger_status(1), dict)
    statuses = driver.get_all_finger_status()
    assert [status["motor"] for status in statuses] == [0, 1, 2, 3, 4]


TABLE_3 = {
    # action: goal, result and feedback fields; `message` and the codes are ours
    "hand_open": ("HandOpen", {"speed": "int32"}),
    "hand_close": ("HandClose", {"speed": "int32"}),
    "hand_preshape": ("HandPreshape", {"mode": "string", "level": "string"}),
    "hand_preshape_close": ("HandPreshapeClose", {}),
}


@pytest.mark.parametrize("name", TABLE_3)
def test_table_3_actions(name):
    from coglab_msgs import msg as messages
    from ih2_hand.ros import goals

    stem, goal = TABLE_3[name]
    assert goals.SPECS[name][0] is getattr(messages, f"{stem}Action")

    def fields(part: str) -> dict[str, str]:
        kind = getattr(messages, stem + part)
        return dict(zip(kind.__slots__, kind._slot_types, strict=True))

    assert fields("Goal") == goal
    assert fields("Result") == {"isOk": "bool", "reason_code": "uint16", "message": "string"}
    assert fields("Feedback") == {"status": "string", "status_code": "uint16", "positions": "int32[]"}


def test_table_3_has_no_other_action():
    from ih2_hand.ros import goals

    assert sorted(goals.SPECS) == sorted(TABLE_3)


def test_reasons_have_the_numbers_of_the_message():
    from coglab_msgs.msg import ReasonCode as codes

    for reason in Reason:
        assert getattr(codes, reason.name) == reason
