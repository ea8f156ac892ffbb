"""Arguments out of range: ValueError that names the range, before any byte is sent."""

from __future__ import annotations

import numpy as np
import pytest
from ih2_hand import grasps
from ih2_hand.driver import HandSerialDriver
from ih2_hand.errors import NoForceSensorError

BAD_MOTORS = [-1, 5, 255, 2.0, "2", None, True]


@pytest.mark.parametrize("motor", BAD_MOTORS)
@pytest.mark.parametrize(
    ("call", "rest"),
    [
        ("move_motor", (100, True)),
        ("set_finger_position", (10,)),
        ("set_finger_force", (10,)),
        ("get_finger_position", ()),
        ("get_finger_force", ()),
        ("get_motor_current", ()),
        ("get_finger_status", ()),
        ("set_finger_current", (10,)),
    ],
)
def test_motor(bench, call, rest, motor):
    with pytest.raises(ValueError, match=r"motor must be a whole number 0\.\.4"):
        getattr(bench.driver, call)(motor, *rest)
    assert bench.sent() == ""


@pytest.mark.parametrize(
    ("call", "arguments", "words"),
    [
        ("move_motor", (1, 512, True), "speed must be a whole number 0..511"),
        ("move_motor", (1, -1, True), "speed must be a whole number 0..511"),
        ("move_motor", (1, 1.5, True), "speed must be a whole number 0..511"),
        ("move_motor", (1, 100, "close"), "is_close_direction must be True"),
        ("move_motor", (1, 100, None), "is_close_direction must be True"),
        ("move_motor", (1, 100, 2), "is_close_direction must be True"),
        ("set_finger_position", (1, 255), "position must be a whole number 0..254"),
        ("set_finger_position", (1, -1), "position must be a whole number 0..254"),
        ("set_finger_position", (1, float("nan")), "position must be a whole number 0..254"),
        ("set_finger_force", (1, 255), "force must be a whole number 0..254"),
        ("set_finger_force", (1, -1), "force must be a whole number 0..254"),
        ("set_finger_current", (1, 1024), "current must be a whole number 0..1023"),
        ("set_hand_posture", ([0] * 4,), "pos must be 5 positions 0..254"),
        ("set_hand_posture", ([0] * 6,), "pos must be 5 positions 0..254"),
        ("set_hand_posture", (None,), "pos must be 5 positions 0..254"),
        ("set_hand_posture", (b"abcde",), "pos must be 5 positions 0..254"),
        ("set_hand_posture", ([0, 0, 0, 255, 0],), "position of motor 3 must be a whole number 0..254"),
        ("calibration", ("slow",), "calibration must be fast or complete"),
        ("calibration", (None,), "calibration must be fast or complete"),
        ("set_grasp_mode", ("power", "low"), "cylindrical, lateral, tridigit, bidigit, tridigit2, bidigit2"),
        ("set_grasp_mode", ("lateral", "low"), "lateral has force level high in the legacy"),
        ("set_grasp_mode", ("bidigit", "medium"), "bidigit has force level low in the legacy"),
        ("set_grasp_mode", ("cylindrical", "soft"), "low, medium, high"),
        ("set_grasp_mode", ("cylindrical", "low", "yes"), "is_current must be True or False"),
    ],
)
def test_values(bench, call, arguments, words):
    with pytest.raises(ValueError) as caught:
        getattr(bench.driver, call)(*arguments)
    assert words in str(caught.value)
    assert bench.sent() == ""


@pytest.mark.parametrize(("call", "arguments"), [("get_finger_force", (0,)), ("set_finger_force", (0, 10))])
def test_force_of_the_motor_without_sensor(bench, call, arguments):
    with pytest.raises(NoForceSensorError, match="no tension sensor"):
        getattr(bench.driver, call)(*arguments)
    assert bench.sent() == ""


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 0.004, 0.0049, 0.501, 0.6, float("nan"), float("inf")])
def test_a_read_time_limit_out_of_range_is_refused_before_the_port_is_opened(seconds):
    with pytest.raises(ValueError, match=r"read_timeout must be 0\.005\.\.0\.5 s"):
        HandSerialDriver("/dev/there-is-no-such-port", read_timeout=seconds)


@pytest.mark.parametrize(
    "options", [{"dialect": "v18"}, {"preshapes": {"lateral": [0] * 4}}, {"preshapes": {"lateral": [0, 0, 0, 0, 255]}}]
)
def test_options_out_of_range_are_refused_before_the_port_is_opened(options):
    with pytest.raises(ValueError):
        HandSerialDriver("/dev/there-is-no-such-port", **options)


def test_numpy_integers_are_whole_numbers(bench):
    bench.driver.set_finger_position(np.int64(2), np.uint8(7))
    assert bench.sent() == "44 02 07"


def test_every_mode_has_a_level_and_a_preshape():
    preshapes = grasps.load_preshapes()
    for mode in grasps.MODES:
        assert grasps.levels_of(mode, "legacy")
        assert grasps.levels_of(mode, "v17") == grasps.LEVELS
        assert len(preshapes[mode]) == 5
        assert max(preshapes[mode]) <= 254


def test_each_mode_closes_the_fingers_that_it_names():
    assert grasps.CLOSING_MOTORS == {
        "cylindrical": (1, 2, 3, 4),
        "lateral": (1,),
        "tridigit": (1, 2, 3),
        "bidigit": (1, 2),
        "tridigit2": (1, 2, 3),
        "bidigit2": (1, 2),
    }


@pytest.mark.parametrize(("length", "shown"), [(40, "'" + "x" * 40 + "'"), (41, "'" + "x" * 40 + "...'")])
def test_a_foreign_text_is_shown_up_to_forty_characters(length, shown):
    assert grasps.quoted("x" * length) == shown


def test_a_grasp_file_may_have_remarks_and_its_faults_have_lines(tmp_path):
    file = tmp_path / "grasps.yaml"
    modes = [f"{mode}: [1, 2, 3, 4, {number}] # own # value" for number, mode in enumerate(grasps.MODES)]
    file.write_text("\n".join(["# all", "", *modes]) + "\n")
    assert grasps.load_preshapes(file)["lateral"] == (1, 2, 3, 4, 1)
    file.write_text("\n".join(["# all", "", *modes, "power: [1]"]) + "\n")
    with pytest.raises(ValueError, match="grasps.yaml:9: mode 'power'"):
        grasps.load_preshapes(file)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("lateral: [1, 2, 3, 4]", "lateral needs 5 whole numbers"),
        ("lateral: [1, 2, 3, 4, 255]", "positions are 0..254"),
        ("lateral: [1, 2, 3, 4, x]", "lateral needs 5 whole numbers"),
        ("power: [1, 2, 3, 4, 5]", "is not one of cylindrical"),
        ("cylindrical: [1, 2, 3, 4, 5]", "second time"),
        ("lateral 1 2 3 4 5", "expected `mode:"),
        ("", "no preshape for lateral"),
    ],
)
def test_bad_grasp_files(tmp_path, line, words):
    file = tmp_path / "grasps.yaml"
    file.write_text("cylindrical: [1, 2, 3, 4, 5]\n" + line + "\n")
    with pytest.raises(ValueError) as caught:
        grasps.load_preshapes(file)
    assert words in str(caught.value)
    assert str(file) in str(caught.value)
