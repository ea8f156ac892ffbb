"""What the cores take and what they refuse: each documented range at both ends and just beyond, and every default."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
HOME = np.array([0.1, 0.6, -0.2, -1.3, 0.3, 0.9, 0.2])
ZERO, ONE = np.zeros(7), np.ones(7)
UNIT = [0.0, 0.0, 0.0, 1.0]


@pytest.fixture(scope="module")
def chain() -> cc.Chain:
    return cc.Chain(URDF.read_text())


@pytest.fixture(scope="module")
def reach() -> cc.Primitive:
    times = np.linspace(0.0, 1.2, 61)
    u = times / 1.2
    return cc.learn("reach", [(times, np.outer(u**3 * (10 - 15 * u + 6 * u**2), [0.5, 0.0, 0.1]))])


def beyond(value: float, away: float) -> float:
    """A little outside of an end of a range."""
    return value + math.copysign(max(1e-9, 1e-6 * abs(value)), away)


def check_range(build: Callable[[float], object], least: float, most: float, words: str) -> None:
    """Both ends are taken; what is beyond them, and what is no number, is refused with these words."""
    outside = [beyond(end, away) for end, away in ((least, -1.0), (most, 1.0)) if math.isfinite(end)]
    for end in (least, most):
        build(end)
    for value in (*outside, math.nan):
        with pytest.raises(ValueError) as refusal:
            build(value)
        assert words in str(refusal.value), (value, str(refusal.value))


def primitive(**fields: object) -> cc.Primitive:
    """A valid primitive of three basis functions, changed as told."""
    made = cc.Primitive()
    made.id, made.centres, made.widths = "p", [1.0, 0.5, 0.1], [4.0, 4.0, 4.0]
    made.weights, made.goal = np.zeros((3, 3)), [0.5, 0.0, 0.0]
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def with_entry(size: tuple[int, ...], place: tuple[int, ...], fill: float = 0.0) -> Callable[[float], np.ndarray]:
    """Arrays with a value at one place."""

    def build(value: float) -> np.ndarray:
        array = np.full(size, fill)
        array[place] = value
        return array

    return build


@pytest.mark.parametrize(
    "field, least, most",
    [("duration", 0.05, 600), ("alpha", 0.5, 50), ("stiffness", 1, 1e5), ("damping", 0.1, 1e4)],
)
def test_a_system_has_numbers_in_their_ranges(field: str, least: float, most: float) -> None:
    words = f"{field}: expected a number from {least:g} to {most:g}"
    words = words.replace("1e+05", "100000")
    check_range(lambda value: primitive(**{field: value}).validate(), least, most, words)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_points_of_a_primitive_are_within_a_hundred_metres(axis: int) -> None:
    for field, name in (("start", "start.position"), ("start_velocity", "start.velocity"), ("goal", "goal.position")):
        point = with_entry((3,), (axis,))
        words = f"{name}.{'xyz'[axis]}: expected a number from -100 to 100"
        check_range(lambda v, f=field, p=point: primitive(**{f: p(v)}).validate(), -100.0, 100.0, words)
    weights = with_entry((3, 3), (1, axis))
    check_range(lambda v: primitive(weights=weights(v)).validate(), -1e4, 1e4, "basis[1].weight: expected")


@pytest.mark.parametrize("function", [0, 1, 2])
def test_basis_functions_are_placed_in_the_phase(function: int) -> None:
    centres, widths = with_entry((3,), (function,), 0.5), with_entry((3,), (function,), 4.0)
    check_range(lambda v: primitive(centres=centres(v)).validate(), 0.0, 1.0, f"basis[{function}].centre")
    made = [1e-6, 1e14]
    for width in made:
        primitive(widths=widths(width)).validate()
    for width in (0.9e-6, 1.1e14, math.nan):
        with pytest.raises(ValueError, match=rf"basis\[{function}\].width"):
            primitive(widths=widths(width)).validate()


def test_a_sigmoid_has_its_place_and_steepness_in_range_and_a_linear_weight_needs_none() -> None:
    weight = cc.GoalWeight
    check_range(lambda v: primitive(goal_weight=weight("sigmoid", v, 5.0)).validate(), 0.0, 1.0, "goal_weight.centre")
    steep = "goal_weight.steepness: expected a number from 1 to 100"
    check_range(lambda v: primitive(goal_weight=weight("sigmoid", 0.5, v)).validate(), 1.0, 100.0, steep)
    primitive(goal_weight=weight("linear", 7.0, 500.0)).validate()
    steepness, centre = 8.0, 0.3
    logistic = lambda s: 1.0 / (1.0 + np.exp(steepness * (s - centre)))  # noqa: E731
    for s in (0.0, 0.2, 0.5, 0.9, 1.0):
        expected = (logistic(s) - logistic(1.0)) / (logistic(0.0) - logistic(1.0))
        assert weight("sigmoid", centre, steepness)(s) == pytest.approx(expected, abs=1e-12)
        assert weight()(s) == 1.0 - s


def test_names_texts_and_counts_of_a_primitive() -> None:
    for fine in ("x", "A-z_0.9", "x" * 64):
        primitive(id=fine).validate()
    for bad in ("", "x" * 65, "a b", "a/b", "ä"):
        with pytest.raises(ValueError, match="id: expected 1 to 64 letters"):
            primitive(id=bad).validate()
    primitive(description="x" * 500).validate()
    with pytest.raises(ValueError, match="description: expected at most 500 characters, got 501"):
        primitive(description="x" * 501).validate()
    for count in (2, cc.MAX_BASIS):
        primitive(centres=np.full(count, 0.5), widths=np.ones(count), weights=np.zeros((count, 3))).validate()
    for count in (1, cc.MAX_BASIS + 1):
        many = primitive(centres=np.full(count, 0.5), widths=np.ones(count), weights=np.zeros((count, 3)))
        with pytest.raises(ValueError, match=f"basis: expected 2 to 64 functions, got {count}"):
            many.validate()
    for widths, weights in ((2, 3), (3, 4)):
        with pytest.raises(ValueError, match=rf"as centres \(3\), got {widths} and {weights}"):
            primitive(widths=np.ones(widths), weights=np.zeros((weights, 3))).validate()
    for word in ("none", "similarity", "upright"):
        assert primitive(mapping=word).mapping == word
    with pytest.raises(ValueError, match="expected none, similarity or upright, got 'mirror'"):
        primitive(mapping="mirror")


def test_a_new_primitive_is_critically_damped_lasts_a_second_and_knows_no_shape() -> None:
    made = cc.Primitive()
    assert (made.id, made.description, made.duration, made.stiffness, made.mapping) == ("", "", 1.0, 150.0, "none")
    assert made.alpha == pytest.approx(math.log(100.0), abs=1e-14)
    assert made.damping == pytest.approx(2.0 * math.sqrt(150.0), abs=1e-14)
    assert (made.goal_weight.kind, made.goal_weight.centre, made.goal_weight.steepness) == ("linear", 0.5, 10.0)
    for point in (made.start, made.goal, made.start_velocity):
        np.testing.assert_array_equal(point, np.zeros(3))
    assert cc.MAX_BASIS == 64


@pytest.mark.parametrize("joint", [0, 3, 6])
def test_a_point_to_point_motion_names_the_joint_whose_number_is_out_of_range(joint: int) -> None:
    at = {name: with_entry((7,), (joint,), 1.0) for name in ("position", "velocity", "target", "max_vel", "max_acc")}
    build = {
        "position": lambda v: cc.PtpTrajectory(at["position"](v), ZERO, ONE, ONE, ONE),
        "velocity": lambda v: cc.PtpTrajectory(ONE, at["velocity"](v), ONE, ONE, ONE),
        "target": lambda v: cc.PtpTrajectory(ONE, ZERO, at["target"](v), ONE, ONE),
        "max_vel": lambda v: cc.PtpTrajectory(ONE, ZERO, ONE, at["max_vel"](v), ONE),
        "max_acc": lambda v: cc.PtpTrajectory(ONE, ZERO, ONE, ONE, at["max_acc"](v)),
    }
    ranges = {"max_vel": (1e-4, 100.0), "max_acc": (1e-4, 1e4)}
    for name, make in build.items():
        check_range(make, *ranges.get(name, (-100.0, 100.0)), f"{name}[{joint}]: expected")


def test_a_point_to_point_motion_has_one_to_seven_joints() -> None:
    for joints in (1, 7):
        cc.PtpTrajectory(ZERO, ZERO, ONE, ONE, ONE, joints)
    for joints in (0, 8):
        with pytest.raises(ValueError, match=f"joints: expected 1 to 7, got {joints}"):
            cc.PtpTrajectory(ZERO, ZERO, ONE, ONE, ONE, joints)


@pytest.mark.parametrize(
    "name, least, most",
    [
        ("pos_clik_gain", 0.0, 500.0),
        ("rot_clik_gain", 0.0, 500.0),
        ("correction_speed", 1e-3, math.inf),
        ("singularity_threshold", 1e-6, 1.0),
        ("stretch_threshold", 1e-6, 0.2),
    ],
)
def test_the_inverse_kinematics_has_its_parameters_in_range(name: str, least: float, most: float) -> None:
    check_range(lambda v: cc.TwoTaskIk(**{name: v}), least, most, f"{name}: expected a")


@pytest.mark.parametrize("joint", range(7))
def test_the_inverse_kinematics_needs_positive_limits_of_each_joint(joint: int) -> None:
    for name, most in (("velocity_limit", 100.0), ("acceleration_limit", math.inf), ("jerk_limit", math.inf)):
        array = with_entry((7,), (joint,), 1.0)
        check_range(lambda v, n=name, a=array: cc.TwoTaskIk(**{n: a(v)}), 1e-3, most, f"{name}[{joint}]: expected")


def test_a_posture_task_needs_a_finite_posture_and_a_gain_of_zero_or_more(chain: cc.Chain) -> None:
    for gain in (-1e-9, math.nan, math.inf):
        with pytest.raises(ValueError, match="posture gain: expected a gain of at least 0"):
            cc.PostureTask(HOME, gain)
    with pytest.raises(ValueError, match="seven finite joint positions"):
        cc.PostureTask(with_entry((7,), (5,))(math.nan), 1.0)
    reference = cc.CartesianReference(*chain.fk(HOME))
    tasks = (cc.PostureTask(HOME + 0.1), cc.PostureTask(HOME + 0.1, 1.0), cc.PostureTask(HOME + 0.1, 0.0))
    velocity = [cc.TwoTaskIk().solve(chain, HOME, reference, task=task).velocity for task in tasks]
    np.testing.assert_array_equal(velocity[0], velocity[1])
    assert np.abs(velocity[1]).max() > 0.01 and np.abs(velocity[2]).max() < 1e-12


def guard_of(chain: cc.Chain, limits: cc.JointLimits | None = None, **parameters: float) -> cc.Guard:
    return cc.Guard(chain, limits or cc.load_joint_limits(str(LIMITS)), **parameters)


@pytest.mark.parametrize("name", ["hand_speed", "elbow_speed", "position_margin", "reaction_time"])
def test_a_guard_takes_no_negative_limits(chain: cc.Chain, name: str) -> None:
    guard_of(chain, **{name: 0.0})
    for value in (-1e-9, math.nan, math.inf):
        with pytest.raises(ValueError) as refusal:
            guard_of(chain, **{name: value})
        assert "position limits of" in str(refusal.value) or f"{name}: expected a number of at least 0" in str(
            refusal.value
        )


def test_a_guard_needs_positive_limits_and_room_between_the_ends_of_each_joint(chain: cc.Chain) -> None:
    for joint in (0, 4, 6):
        name = chain.joint_names[joint]
        for field in ("velocity", "acceleration", "jerk"):
            for value in (0.0, -1.0, math.nan, math.inf):
                limits = cc.load_joint_limits(str(LIMITS))
                values = np.array(getattr(limits, field))
                values[joint] = value
                setattr(limits, field, values)
                with pytest.raises(ValueError, match=f"joint {field} limit of {name}: expected a positive number"):
                    guard_of(chain, limits)
        for room, fine in ((0.0201, True), (0.02, False)):
            limits = cc.load_joint_limits(str(LIMITS))
            lower = np.array(limits.lower_position)
            lower[joint] = 0.0
            limits.lower_position, upper = lower, np.array(limits.upper_position)
            upper[joint] = room
            limits.upper_position = upper
            if fine:
                guard_of(chain, limits)
                continue
            with pytest.raises(ValueError, match=f"position limits of {name}: .*twice the margin, got 0.0+ and 0.020"):
                guard_of(chain, limits)


def test_a_workspace_is_a_box_with_room_beside_the_sphere() -> None:
    parameters = cc.WorkspaceParameters
    for axis in range(3):
        low, high = [-1.0] * 3, [1.0] * 3
        low[axis] = high[axis]
        for bad in (parameters(low, high), parameters([-1, -1, -1], np.where(np.arange(3) == axis, math.inf, 1.0)),
                    parameters(np.where(np.arange(3) == axis, math.nan, -1.0), [1, 1, 1])):  # fmt: skip
            with pytest.raises(ValueError, match="workspace box: expected box_max above box_min"):
                cc.Workspace(bad)
    wide = {"box_min": [-20] * 3, "box_max": [20] * 3}
    for radius in (0.0, 9.99):
        cc.Workspace(parameters(**wide, base_radius=radius))
    for radius in (-1e-9, 10.0, math.nan):
        with pytest.raises(ValueError, match="workspace base sphere: expected a finite centre and a radius"):
            cc.Workspace(parameters(**wide, base_radius=radius))
    with pytest.raises(ValueError, match="finite centre"):
        cc.Workspace(parameters(base_centre=[0, math.nan, 0]))
    for stretch in (0.2, 1.0):
        cc.Workspace(parameters(max_stretch=stretch))
    for stretch in (0.1999, 1.0001, math.nan):
        with pytest.raises(ValueError, match="max_stretch: expected a share from 0.2 to 1, got"):
            cc.Workspace(parameters(max_stretch=stretch))


@pytest.mark.parametrize("corner", range(8))
def test_one_corner_outside_the_sphere_is_room_enough(corner: int) -> None:
    centre = np.array([0.2 if corner >> axis & 1 == 0 else -0.2 for axis in range(3)])
    box = {"box_min": [-1.0] * 3, "box_max": [1.0] * 3, "base_centre": centre}
    farthest = 1.2 * math.sqrt(3.0)
    cc.Workspace(cc.WorkspaceParameters(**box, base_radius=farthest - 1e-3))
    with pytest.raises(ValueError, match="leaves no room in the box"):
        cc.Workspace(cc.WorkspaceParameters(**box, base_radius=farthest + 1e-3))


def test_the_workspace_that_nobody_names_is_the_documented_one() -> None:
    given = cc.WorkspaceParameters()
    np.testing.assert_array_equal(given.box_min, [-1.2, -1.2, 0.0])
    np.testing.assert_array_equal(given.box_max, [1.2, 1.2, 1.6])
    np.testing.assert_array_equal(given.base_centre, [0.0, 0.0, 0.2])
    assert (given.base_radius, given.max_stretch) == (0.25, 0.98)


def test_estimator_curve_governor_and_watch_refuse_what_they_cannot_use() -> None:
    for fine in (0.0, 0.005, 2.0):
        cc.GoalEstimator(fine)
    for bad in (0.0049, 2.01, -0.1, math.nan):
        with pytest.raises(ValueError, match="goal time constant: expected 0 .off. or 0.005 to 2 s"):
            cc.GoalEstimator(bad)
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="goal max innovation: expected a positive distance"):
            cc.GoalEstimator(0.06, bad)
        for rates in ((bad, 1.0), (1.0, bad)):
            with pytest.raises(ValueError, match="positive rates of change"):
                cc.PhaseGovernor(*rates)
    for bad in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="duration: expected a positive number"):
            cc.OrientationCurve(UNIT, UNIT, bad)
    box = ([0.0] * 3, [1.0] * 3)
    for low, high, retreat, drop, words in (
        ([math.nan, 0, 0], [1] * 3, 0.0, 0.0, "is not finite"),
        ([0] * 3, [0, math.inf, 0], 0.0, 0.0, "is not finite"),
        (*box, math.nan, 0.0, "is not finite"),
        (*box, 0.0, math.inf, "is not finite"),
        ([0, 0, 0.1], [1, 1, 0], 0.0, 0.0, "goal_region_low is above"),
        (*box, -1e-9, 0.0, "negative"),
        (*box, 0.0, -1e-9, "negative"),
    ):
        with pytest.raises(ValueError, match=words):
            cc.GoalWatch(low, high, retreat, drop, [0, 0, 0], [0.5] * 3)


def test_steps_ratios_and_rates_of_a_motion_are_checked(reach: cc.Primitive) -> None:
    check_range(lambda v: cc.Dmp(reach, [0] * 3, [1, 0, 0], ratio=v), 0.05, 100.0, "dmp_ratio: expected a number from")
    dmp, motion = cc.Dmp(reach, [0] * 3, [1, 0, 0]), cc.CartesianMotion()
    motion.start(reach, [0] * 3, UNIT, [0.5, 0, 0], UNIT)
    for ratio in (0.04, 101.0):
        for call in (lambda r: dmp.switch_to(reach, [1, 0, 0], r), dmp.set_ratio,
                     lambda r: motion.switch_to(reach, [1, 0, 0], UNIT, ratio=r)):  # fmt: skip
            with pytest.raises(ValueError, match="dmp_ratio"):
                call(ratio)
    for step in (lambda dt, rate: dmp.step(dt, [1, 0, 0], rate=rate),
                 lambda dt, rate: motion.step(dt, [1, 0, 0], UNIT, rate)):  # fmt: skip
        check_range(lambda v, s=step: s(0.005, v), 0.0, 1.0, "rate: expected 0 to 1")
        step(0.0, 1.0)
        for dt in (-1e-9, 1e6, math.nan):
            with pytest.raises(ValueError, match="dt: expected seconds, 0 or more"):
                step(dt, 1.0)
    for duration, dt in ((1.0, 0.0), (-1e-9, 0.01), (1.0, 0.9e-7)):
        with pytest.raises(ValueError, match="positive dt and at most 1e7 steps"):
            dmp.roll_out([1, 0, 0], duration, dt)
    for dt in (1e-6, 0.0, math.nan):
        with pytest.raises(ValueError, match="dt: expected more than 1e-6 s"):
            cc.reproduce(reach, [0.0, 1.0], dt)


def test_an_orientation_is_a_unit_quaternion_within_a_thousandth() -> None:
    for norm in (0.9991, 1.0009):
        taken = cc.CartesianReference([0] * 3, [0.0, 0.0, 0.0, norm])
        np.testing.assert_allclose(taken.orientation, UNIT, atol=1e-15)
    for norm in (0.9989, 1.0011):
        with pytest.raises(ValueError, match="pose: expected a unit quaternion"):
            cc.CartesianReference([0] * 3, [0.0, 0.0, 0.0, norm])
    for fields, words in (
        ({"velocity": [math.nan, 0, 0]}, "velocity: expected finite"),
        ({"angular_velocity": [0, math.inf, 0]}, "angular_velocity: expected finite"),
    ):
        with pytest.raises(ValueError, match=words):
            cc.CartesianReference([0] * 3, UNIT, **fields)
    assert cc.CartesianReference([0] * 3, UNIT).orientation_control
    assert not cc.CartesianReference([0] * 3, UNIT, orientation_control=False).orientation_control
