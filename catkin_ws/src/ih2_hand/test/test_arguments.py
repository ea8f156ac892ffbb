"""Arguments out of range: ValueError that names the range, before any byte is sent."""

from __future__ import annotations

import pytest
from ih2_hand import grasps
from ih2_hand.driver import HandSerialDriver
from ih2_hand.errors import NoForceSensorError

BAD_MOTORS = [-1, 5, 2.0, "2", True]


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
    with pytest.raises(ValueError, match=r"motor .*0\.\.4"):
        getattr(bench.driver, call)(motor, *rest)
    assert bench.sent() == ""


@pytest.mark.parametrize(
    ("call", "arguments", "names"),
    [
        ("move_motor", (1, 512, True), "speed 0..511"),
        ("move_motor", (1, 1.5, True), "speed 0..511"),
        ("move_motor", (1, 100, "close"), "is_close_direction True False"),
        ("set_finger_position", (1, 255), "position 0..254"),
        ("set_finger_position", (1, float("nan")), "position 0..254"),
        ("set_finger_force", (1, -1), "force 0..254"),
        ("set_finger_current", (1, 1024), "current 0..1023"),
        ("set_hand_posture", ([0] * 6,), "pos 0..254"),
        ("set_hand_posture", (b"abcde",), "pos 0..254"),
        ("set_hand_posture", ([0, 0, 0, 255, 0],), "motor 3 0..254"),
        ("calibration", ("slow",), "fast complete"),
        ("set_grasp_mode", ("power", "low"), "cylindrical lateral tridigit bidigit tridigit2 bidigit2"),
        ("set_grasp_mode", ("lateral", "low"), "lateral high legacy"),
        ("set_grasp_mode", ("cylindrical", "soft"), "low medium high"),
        ("set_grasp_mode", ("cylindrical", "low", "yes"), "is_current True False"),
    ],
)
def test_values(bench, call, arguments, names):
    with pytest.raises(ValueError) as caught:
        getattr(bench.driver, call)(*arguments)
    assert all(name in str(caught.value) for name in names.split())
    assert bench.sent() == ""


@pytest.mark.parametrize(("call", "arguments"), [("get_finger_force", (0,)), ("set_finger_force", (0, 10))])
def test_force_of_the_motor_without_sensor(bench, call, arguments):
    with pytest.raises(NoForceSensorError):
        getattr(bench.driver, call)(*arguments)
    assert bench.sent() == ""


@pytest.mark.parametrize("seconds", [0.0049, 0.601, float("nan")])
def test_a_read_time_limit_out_of_range_is_refused_before_the_port_is_opened(seconds):
    with pytest.raises(ValueError, match=r"read_timeout .*0\.005\.\.0\.6 s"):
        HandSerialDriver("/dev/there-is-no-such-port", read_timeout=seconds)


@pytest.mark.parametrize(
    "options", [{"dialect": "v18"}, {"preshapes": {"lateral": [0] * 4}}, {"preshapes": {"lateral": [0, 0, 0, 0, 255]}}]
)
def test_options_out_of_range_are_refused_before_the_port_is_opened(options):
    with pytest.raises(ValueError):
        HandSerialDriver("/dev/there-is-no-such-port", **options)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("lateral: [1, 2, 3, 4]", "lateral needs 5 whole numbers"),
        ("lateral: [1, 2, 3, 4, 255]", "positions are 0..254"),
        ("lateral: [1, 2, 3, 4, x]", "lateral needs 5 whole numbers"),
        ("power: [1, 2, 3, 4, 5]", "of cylindrical"),
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
