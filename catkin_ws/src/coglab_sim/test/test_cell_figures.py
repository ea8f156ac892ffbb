"""Every parameter of the cell: the default that it ships with, its unit, and both ends of what the cell can compute
with. Launch files, pages and recorded trials are written against these figures."""

import numpy as np
import pytest
from coglab_sim import _cell
from conftest import URDF

SPEEDS = [2.0943951, 2.0943951, 2.7925268, 2.7925268, 4.3633231, 3.8397244, 3.8397244]
REACHES = [2.96705973, 2.0943951, 2.96705973, 2.0943951, 2.96705973, 2.0943951, 2.96705973]
HOME = [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782]

# name: (default, unit, low, high)
FIGURES = {
    "seed": (1, "", 0, 2147483647),
    "home": (HOME, "rad", -3.2, 3.2),
    "krc/period": (0.005, "s", 0.001, 0.1),
    "krc/quality_perfect": (0.99, "1", 0, 1),
    "krc/quality_ok": (0.95, "1", 0, 1),
    "krc/quality_bad": (0.80, "1", 0, 1),
    "krc/entry_quality": (2, "", 1, 3),
    "krc/extrapolated_packets": (5, "", 0, 100),
    "krc/entry_position_tolerance": (1e-4, "rad", 0, 0.1),
    "krc/entry_frame_tolerance": (1e-3, "m, rad", 0, 1),
    "krc/torque_tolerance": (1.0, "Nm", 0, 1000),
    "krc/speed_limit": (SPEEDS, "rad/s", 1e-4, 50),
    "krc/t1_speed_limit": (0.24, "rad/s", 1e-4, 50),
    "krc/speed_margin": (0.05, "1", 0, 1),
    "krc/frame_speed_limit": (2.0, "m/s", 1e-4, 50),
    "krc/frame_turn_limit": (4.0, "rad/s", 1e-4, 50),
    "krc/frame_orthonormality": (1e-3, "1", 1e-6, 0.1),
    "krc/position_limit": (REACHES, "rad", 0.1, 3.2),
    "krc/torque_limit_time": (0.05, "s", 0, 600),
    "krc/joint_stiffness_max": (5000.0, "Nm/rad", 0, 1e7),
    "krc/frame_stiffness_max": (10000.0, "N/m", 0, 1e7),
    "krc/rotation_stiffness_max": (1000.0, "Nm/rad", 0, 1e7),
    "krc/joint_stiffness": (1000.0, "Nm/rad", 0, 1e7),
    "krc/frame_stiffness": (2000.0, "N/m", 0, 1e7),
    "krc/rotation_stiffness": (200.0, "Nm/rad", 0, 1e7),
    "krc/damping": (0.7, "1", 0, 1),
    "krc/krl_poll": (0.05, "s", 0.001, 10),
    "krc/krl_message_wait": (0.3, "s", 0, 600),
    "krc/krl_drive_wait": (3.0, "s", 0, 600),
    "krc/krl_quality_wait": (12.0, "s", 0, 600),
    "krc/brake_release": (0.3, "s", 0, 600),
    "krc/power_up": (0.5, "s", 0, 600),
    "krc/close_linger": (1.5, "s", 0, 600),
    "krc/ambient_temperature": (25.0, "degree Celsius", -50, 200),
    "krc/drive_heating": (20.0, "K", 0, 200),
    "krc/drive_heating_time": (600.0, "s", 1, 1e6),
    "krc/drive_warning": (70.0, "degree Celsius", -50, 200),
    "krc/payload_error": (0.10, "1", 0, 0.5),
    "krc/inertia_error": (0.05, "1", 0, 0.5),
    "arm/torque_limit": ([176, 176, 100, 100, 100, 38, 38], "Nm", 1, 1000),
    "arm/rotor_inertia": ([3.0, 3.0, 2.0, 2.0, 0.8, 0.4, 0.4], "kg m^2", 0.01, 100),
    "arm/coulomb_friction": ([0.4, 0.4, 0.25, 0.25, 0.2, 0.1, 0.1], "Nm", 0, 1000),
    "arm/friction_spread": (0.3, "1", 0, 1),
    "arm/coulomb_speed": (0.01, "rad/s", 1e-4, 50),
    "arm/servo_bandwidth": (60.0, "rad/s", 1, 500),
    "arm/nullspace_stiffness": (20.0, "Nm/rad", 0, 1e7),
    "arm/block_stiffness": (2e5, "Nm/rad", 0, 1e7),
    "arm/brake_torque": ([352, 352, 200, 200, 200, 76, 76], "Nm", 1, 1000),
    "arm/unknown_load": (0.0, "kg", 0, 10),
    "torque_noise/sigma": (0.05, "Nm", 0, 1000),
    "torque_noise/speed_gain": (7.0, "s/rad", 0, 1000),
    "torque_noise/correlation_time": (0.01, "s", 1e-4, 10),
    "torque_noise/bias": (0.4, "Nm", 0, 1000),
    "torque_noise/offset": (0.3, "Nm", 0, 1000),
    "torque_noise/hysteresis": (0.1, "Nm", 0, 1000),
    "torque_noise/hysteresis_speed": (0.02, "rad/s", 1e-4, 50),
    "object/mass": (0.31, "kg", 0.01, 10),
    "object/size": ([0.08, 0.08, 0.10], "m", 1e-3, 2),
    "object/center": ([0.0, 0.0, 0.05], "m", -5, 5),
    "object/friction": (0.6, "1", 0, 2),
    "object/position": ([-0.08, 0.0, -0.05], "m", -5, 5),
    "object/rotation": ([0.0, 0.0, 0.0, 1.0], "1", -1, 1),
    "person/arm_bandwidth": (40.0, "rad/s", 1e-4, 500),
    "person/arm_force": (60.0, "N", 0, 1000),
    "person/arm_torque": (6.0, "Nm", 0, 1000),
    "person/grip_bandwidth": (60.0, "rad/s", 1e-4, 500),
    "person/grip_lever": (0.04, "m", 0, 1),
    "contact/human_reach": (0.06, "m", 0, 1),
    "contact/floor_height": (-0.75, "m", -5, 5),
    "contact/board_center": ([0.45, -0.55, 0.05], "m", -5, 5),
    "contact/board_size": ([0.50, 0.40, 0.0], "m", 0, 5),
}
WORDS = {
    "urdf": "",
    "hand_model": "",
    "krc/convention": "coglab",
    "krc/mode": "AUT",
    "krc/acknowledge_by_program": True,
    "object/id": "mug",
    "object/shape": "cylinder",
    "object/start": "human_hand",
}
ROWS = {row["name"]: row for row in _cell.parameter_table()}


def test_every_parameter_is_looked_at_here():
    assert set(ROWS) == {*FIGURES, *WORDS}
    assert len(_cell.parameter_table()) == len(ROWS), "no name twice"


@pytest.mark.parametrize("name", FIGURES)
def test_figures_are_those_that_are_shipped(name):
    default, unit, low, high = FIGURES[name]
    row = ROWS[name]
    assert row["default"] == default and row["unit"] == unit
    assert (row["low"], row["high"]) == (low, high)


@pytest.mark.parametrize("name", WORDS)
def test_words_are_those_that_are_shipped_and_have_no_range(name):
    assert ROWS[name]["default"] == WORDS[name] and type(ROWS[name]["default"]) is type(WORDS[name])
    assert (ROWS[name]["low"], ROWS[name]["high"]) == (0.0, 0.0)


RISING = {"krc/quality_perfect": "krc/quality_ok", "krc/quality_ok": "krc/quality_bad"}
"""which has to be at least as high as which"""


@pytest.mark.parametrize(
    "name",
    [name for name in FIGURES if name.startswith(("krc/", "torque_noise/")) and not isinstance(FIGURES[name][0], list)],
)
def test_both_ends_of_a_range_are_inside(name):
    """And a little beyond either is not: a session begins with the end itself."""
    low, high = FIGURES[name][2:]
    whole = isinstance(FIGURES[name][0], int)
    for end, beyond in (
        (low, low - 1 if whole else low - 1e-7),
        (high, high + 1 if whole else high * (1 + 1e-6) + 1e-7),
    ):
        others = {}
        if name.startswith("krc/quality"):  # the three have to rise
            others = {each: end for each in ("krc/quality_perfect", "krc/quality_ok", "krc/quality_bad")}
        _cell.Cell(URDF, {**others, name: end})
        with pytest.raises(ValueError) as refusal:
            _cell.Cell(URDF, {name: beyond})
        assert f"{name} = {beyond:g} is outside its range {low:g}..{high:g}" in str(refusal.value)


@pytest.mark.parametrize("name, not_above", RISING.items())
def test_qualities_rise(name, not_above):
    figures = {"krc/quality_perfect": 0.9, "krc/quality_ok": 0.8, "krc/quality_bad": 0.7}
    _cell.Cell(URDF, {**figures, name: figures[not_above]})
    with pytest.raises(
        ValueError, match="krc/quality_bad, krc/quality_ok, krc/quality_perfect: expected rising values"
    ):
        _cell.Cell(URDF, {**figures, name: figures[not_above] - 0.01})


@pytest.mark.parametrize(
    "name, value, words",
    [
        ("krc/period", "fast", "parameter krc/period: expected a number"),
        ("home", [0.0] * 6, "parameter home: expected a list of 7 numbers"),
        ("home", 1.0, "parameter home: expected a list of 7 numbers"),
        ("home", [0.0] * 6 + [4.0], r"parameter home\[6\] = 4 is outside its range -3.2..3.2"),
        ("object/size", [0.1, 0.1], "parameter object/size: expected a list of 3 numbers"),
        ("object/rotation", [0.0, 0.0, 1.0], "parameter object/rotation: expected a list of 4 numbers"),
        ("object/rotation", [0.0, 0.0, 0.0, 0.998], "object/rotation: expected a quaternion x y z w of length 1"),
        ("object/id", 3, "parameter object/id: expected a text"),
        ("krc/mode", "T3", "parameter krc/mode: expected T1, T2 or AUT, got T3"),
        ("krc/mode", 1, "parameter krc/mode: expected a text"),
        ("krc/convention", "nobody", "unknown KRL convention 'nobody'; known: coglab, centro_epiaggio, stanford"),
        ("krc/acknowledge_by_program", "yes", "acknowledge_by_program: expected true or false"),
        ("object/start", "moon", "unknown placement 'moon'; known: human_hand, robot_hand, world"),
        ("krc/nothing", 1.0, "the simulated cell has no parameter 'krc/nothing'"),
    ],
)
def test_what_does_not_fit_is_said(name, value, words):
    with pytest.raises(ValueError, match=words):
        _cell.Cell(URDF, {name: value})


def test_a_whole_number_is_a_number_and_a_quaternion_need_not_be_exact():
    cell = _cell.Cell(URDF, {"torque_noise/sigma": 0, "object/rotation": [0.0, 0.0, 0.6005, 0.8]})
    rotation = cell.truth()["object"]["rotation"]
    assert np.linalg.norm(rotation) == pytest.approx(1.0, abs=1e-12)
    assert rotation == pytest.approx(np.array([0.0, 0.0, 0.6005, 0.8]) / np.hypot(0.6005, 0.8), abs=1e-9)
