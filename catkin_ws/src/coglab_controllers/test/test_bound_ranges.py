"""What the Python module adds to the cores: defaults of its arguments, their order, and its own ranges and refusals."""

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
AXES = np.eye(7)
UNIT, TURNED = [0.0, 0.0, 0.0, 1.0], [0.0, 0.6, 0.0, 0.8]
GOAL = [0.4, 0.1, -0.05]
CYCLE = 0.005
EVERYWHERE = {"box_min": [-9] * 3, "box_max": [9] * 3, "base_radius": 0.0, "max_stretch": 1.0}


@pytest.fixture(scope="module")
def chain() -> cc.Chain:
    return cc.Chain(URDF.read_text())


@pytest.fixture(scope="module")
def reach() -> cc.Primitive:
    times = np.linspace(0.0, 1.2, 61)
    u = times / 1.2
    return cc.learn("reach", [(times, np.outer(u**3 * (10 - 15 * u + 6 * u**2), [0.5, 0.0, 0.1]))])


def refusal(call: Callable[[], object]) -> str:
    """The whole sentence with which a call is refused."""
    with pytest.raises(ValueError) as error:
        call()
    return str(error.value)


def test_a_dmp_begins_at_rest_and_a_switch_keeps_the_ratio_of_one(reach: cc.Primitive) -> None:
    dmp = cc.Dmp(reach, [0.1, 0.2, 0.3], GOAL)
    np.testing.assert_array_equal(dmp.position, [0.1, 0.2, 0.3])
    assert not dmp.velocity.any() and dmp.tau == pytest.approx(1.2)
    led = cc.Dmp(reach, [0.1, 0.2, 0.3], GOAL, [0.3, -0.2, 0.1], 2.0)
    assert led.tau == pytest.approx(2.4)
    np.testing.assert_allclose(led.velocity, [0.3, -0.2, 0.1], atol=1e-12)
    led.switch_to(reach, GOAL)
    assert led.tau == pytest.approx(1.2)
    led.switch_to(reach, GOAL, 3.0)
    assert led.tau == pytest.approx(3.6)


def test_a_step_has_a_goal_at_rest_and_a_whole_clock_unless_it_is_told(reach: cc.Primitive) -> None:
    plain, told, slow = (cc.Dmp(reach, [0.0] * 3, GOAL) for _ in range(3))
    for _ in range(40):
        at = plain.step(CYCLE, GOAL)
        np.testing.assert_array_equal(at, plain.position)
        np.testing.assert_array_equal(at, told.step(CYCLE, GOAL, [0.0] * 3, 1.0))
        slow.step(CYCLE, GOAL, rate=0.5)
    assert plain.progress == pytest.approx(0.2 / 1.2) and slow.progress == pytest.approx(0.1 / 1.2)


def test_a_roll_out_has_a_row_for_each_step_and_one_for_its_start(reach: cc.Primitive) -> None:
    words = "expected a positive dt and at most 1e7 steps"
    for duration, dt, rows in ((0.0, 0.01, 1), (0.0299, 0.01, 3), (0.03, 0.01, 4), (0.1, 0.1, 2)):
        begun = cc.Dmp(reach, [0.1, 0.0, 0.0], GOAL, [0.2, 0.0, 0.0])
        times, positions, velocities = begun.roll_out(GOAL, duration, dt)
        assert (times.shape, positions.shape, velocities.shape) == ((rows,), (rows, 3), (rows, 3))
        np.testing.assert_allclose(times, dt * np.arange(rows), atol=1e-15)
        np.testing.assert_array_equal(positions[0], [0.1, 0.0, 0.0])
        np.testing.assert_allclose(velocities[0], [0.2, 0.0, 0.0], atol=1e-12)
    dmp = cc.Dmp(reach, [0.0] * 3, GOAL)
    for duration, dt in ((1.0, -0.01), (0.0, 0.0), (0.0, -0.01), (-1.0, 0.01), (1.0, 2.0**-24), (math.nan, 0.01)):
        assert refusal(lambda d=duration, s=dt: dmp.roll_out(GOAL, d, s)) == words, (duration, dt)
    assert refusal(lambda: dmp.roll_out([0.0, math.inf, 0.0], 0.1)) == "goal: expected finite numbers"
    np.testing.assert_array_equal(dmp.position, [0.0] * 3)


def test_what_a_dmp_is_refused_for_is_named(reach: cc.Primitive) -> None:
    bad = [0.0, 0.0, math.nan]
    dmp = cc.Dmp(reach, [0.0] * 3, GOAL)
    for call, name in (
        (lambda: cc.Dmp(reach, bad, GOAL), "position"),
        (lambda: cc.Dmp(reach, [0.0] * 3, bad), "goal"),
        (lambda: cc.Dmp(reach, [0.0] * 3, GOAL, bad), "velocity"),
        (lambda: dmp.switch_to(reach, bad), "goal"),
        (lambda: dmp.step(CYCLE, bad), "goal"),
        (lambda: dmp.step(CYCLE, GOAL, bad), "goal_velocity"),
    ):
        assert refusal(call) == f"{name}: expected finite numbers"
    assert refusal(lambda: dmp.step(CYCLE, GOAL, rate=-0.1)) == "rate: expected 0 to 1"
    assert refusal(lambda: dmp.step(-1.0, GOAL)) == "dt: expected seconds, 0 or more, got -1.000000"
    assert refusal(lambda: dmp.step(1e6, GOAL)) == "dt: expected seconds, 0 or more, got 1000000.000000"
    assert dmp.progress == 0.0 and not dmp.position.any(), "what is refused does nothing"


def test_a_reproduction_steps_by_a_millisecond_unless_it_is_told(reach: cc.Primitive) -> None:
    times = [0.0, 0.2, 0.6]
    plain = cc.reproduce(reach, times)
    assert plain.shape == (3, 3)
    np.testing.assert_array_equal(plain, cc.reproduce(reach, times, 0.001))
    assert (plain != cc.reproduce(reach, times, 0.002)).any(), "another step rounds otherwise"
    np.testing.assert_array_equal(plain[0], reach.start)
    assert cc.reproduce(reach, [0.0, 3e-6], 1.1e-6).shape == (2, 3), "more than a microsecond is a step"
    assert refusal(lambda: cc.reproduce(reach, times, 1e-6)) == "dt: expected more than 1e-6 s"


def test_kinds_of_weights_are_told_as_they_were_given() -> None:
    for kind in ("linear", "sigmoid"):
        weight = cc.GoalWeight(kind, 0.25, 7.0)
        assert (weight.kind, weight.centre, weight.steepness) == (kind, 0.25, 7.0)
    plain = cc.GoalWeight("sigmoid")
    assert (plain.centre, plain.steepness) == (0.5, 10.0)
    for kind in ("", "Linear", "cubic"):
        assert refusal(lambda k=kind: cc.GoalWeight(k)) == f"kind: expected 'linear' or 'sigmoid', got '{kind}'"


def test_learning_that_is_told_nothing_has_the_documented_options() -> None:
    times = np.linspace(0.0, 1.2, 61)
    path = np.outer(np.sin(0.5 * np.pi * times / 1.2), [0.4, 0.1, 0.0])
    plain = cc.learn("p", [(times, path)], allow=["moving"])
    told = cc.learn("p", [(times, path)], 20, math.log(100.0), 150.0, cc.GoalWeight("linear"), "none", 1e-6, ["moving"])
    np.testing.assert_allclose(plain.weights, told.weights, rtol=0.0, atol=1e-9)
    assert plain.weights.shape == (20, 3) and plain.mapping == "none" and plain.goal_weight.kind == "linear"
    assert (
        np.abs(plain.weights - cc.learn("p", [(times, path)], regularisation=2e-6, allow=["moving"]).weights).max()
        > 1e-8
    )


def motion_of(reach: cc.Primitive, **options: object) -> cc.CartesianMotion:
    motion = cc.CartesianMotion()
    motion.start(reach, [0.1, 0.2, 0.0], UNIT, GOAL, TURNED, **options)
    return motion


def test_a_motion_controls_the_orientation_at_the_ratio_of_one_unless_it_is_told(reach: cc.Primitive) -> None:
    motion = motion_of(reach)
    assert motion.remaining_time == pytest.approx(1.2)
    assert not motion.velocity.any(), "from rest"
    assert motion.step(CYCLE, GOAL, TURNED).orientation_control
    slow = motion_of(reach, ratio=2.0, velocity=[0.1, 0.2, 0.3], orientation_control=False)
    assert slow.remaining_time == pytest.approx(2.4)
    np.testing.assert_allclose(slow.velocity, [0.1, 0.2, 0.3], atol=1e-12)
    assert not slow.step(CYCLE, GOAL, TURNED).orientation_control
    left = slow.remaining_time
    slow.switch_to(reach, GOAL, TURNED)
    assert slow.remaining_time == pytest.approx(0.5 * left)
    assert slow.step(CYCLE, GOAL, TURNED).orientation_control
    slow.switch_to(reach, GOAL, TURNED, 2.0, False)
    assert not slow.step(CYCLE, GOAL, TURNED).orientation_control


def test_a_step_of_a_motion_goes_upright_on_a_whole_clock_unless_it_is_told(reach: cc.Primitive) -> None:
    plain, told, half = (motion_of(reach) for _ in range(3))
    for _ in range(60):
        one, other = plain.step(CYCLE, GOAL), told.step(CYCLE, GOAL, UNIT, 1.0)
        np.testing.assert_array_equal(one.orientation, other.orientation)
        np.testing.assert_array_equal(one.position, other.position)
        half.step(CYCLE, GOAL, UNIT, 0.5)
    assert plain.remaining_time == pytest.approx(1.2 - 0.3) and half.remaining_time == pytest.approx(1.2 - 0.15)
    assert refusal(lambda: plain.step(CYCLE, GOAL, UNIT, 1.5)) == "rate: expected 0 to 1, got 1.500000"
    assert refusal(lambda: plain.step(CYCLE, GOAL, [0.0, 0.0, 0.0, 2.0])) == (
        "goal: expected a unit quaternion x y z w"
    )
    assert refusal(lambda: motion_of(reach, ratio=0.0)).startswith("dmp_ratio: expected a number from")
    bad = [math.inf, 0.0, 0.0]
    for options in ({"velocity": bad}, {"angular_velocity": bad}):
        assert refusal(lambda o=options: motion_of(reach, **o)) == f"{next(iter(options))}: expected finite numbers"


def test_a_curve_lasts_a_second_unless_it_is_told() -> None:
    turning = [0.1, 0.0, 0.4]
    plain, told = (
        cc.OrientationCurve(UNIT, TURNED, angular_velocity=turning),
        cc.OrientationCurve(UNIT, TURNED, 1.0, turning),
    )
    longer = cc.OrientationCurve(UNIT, TURNED, 2.0, turning)
    np.testing.assert_array_equal(plain.at(0.3), told.at(0.3))
    assert np.abs(plain.at(0.3) - longer.at(0.3)).max() > 1e-3
    still = cc.OrientationCurve(UNIT, TURNED)
    np.testing.assert_array_equal(still.at(0.3), cc.OrientationCurve(UNIT, TURNED, 5.0, [0.0] * 3).at(0.3))
    words = "duration: expected a positive number of seconds"
    assert refusal(lambda: cc.OrientationCurve(UNIT, TURNED, 0.0)) == words
    cc.OrientationCurve(UNIT, TURNED, 1e-9)
    assert refusal(lambda: cc.OrientationCurve([0.0] * 4, TURNED)) == "quaternion: expected a unit quaternion x y z w"
    assert refusal(lambda: cc.rotation_between(UNIT, [0.0] * 4)) == "quaternion: expected a unit quaternion x y z w"


def test_a_rotation_is_that_from_the_first_to_the_second() -> None:
    for vector in ([0.3, 0.0, 0.0], [0.0, -0.4, 0.1], [0.2, 0.1, 0.5]):
        np.testing.assert_allclose(cc.rotation_between(UNIT, cc.exp_rotation(vector)), vector, atol=1e-12)
        np.testing.assert_allclose(cc.rotation_between(cc.exp_rotation(vector), UNIT), np.negative(vector), atol=1e-12)
        assert cc.exp_rotation(vector).shape == (4,) and np.linalg.norm(cc.exp_rotation(vector)) == pytest.approx(1.0)


def test_a_reference_keeps_each_of_its_parts() -> None:
    told = cc.CartesianReference([0.1, 0.2, 0.3], TURNED, [0.4, 0.5, 0.6], [0.7, 0.8, 0.9], False)
    for value, wanted in (
        (told.position, [0.1, 0.2, 0.3]),
        (told.orientation, TURNED),
        (told.velocity, [0.4, 0.5, 0.6]),
        (told.angular_velocity, [0.7, 0.8, 0.9]),
    ):
        np.testing.assert_allclose(value, wanted, atol=1e-15)
    plain = cc.CartesianReference([0.1, 0.2, 0.3], TURNED)
    assert not plain.velocity.any() and not plain.angular_velocity.any() and plain.orientation_control
    assert not told.orientation_control
    assert refusal(lambda: cc.CartesianReference([math.nan, 0.0, 0.0], UNIT)) == "pose: expected finite numbers"


def test_a_watch_says_why_and_with_which_code() -> None:
    box = ([0.0] * 3, [1.0] * 3)
    for arguments, words in (
        ((*box, -1.0, 0.0), "goal_retreat or goal_drop is negative; expected a distance in m, or 0 for none"),
        (([0.0, 2.0, 0.0], [1.0] * 3, 0.0, 0.0), "goal_region_low is above goal_region_high in x, y or z"),
        (([0.0] * 3, [1.0, math.nan, 1.0], 0.0, 0.0),
         "goal_region_low, goal_region_high, goal_retreat or goal_drop is not finite"),
    ):  # fmt: skip
        assert refusal(lambda a=arguments: cc.GoalWatch(*a, [0.0] * 3, [0.5] * 3)) == words
    for bad, name in (((GOAL, [math.nan] * 3), "goal"), (([math.nan] * 3, GOAL), "hand")):
        assert refusal(lambda b=bad: cc.GoalWatch(*box, 0.0, 0.0, *b)) == f"{name}: expected finite numbers"
    for limits, goal, code, words in (
        ((0.0, 0.125), [0.5, 0.5, 0.25], 309, "the goal falls: it is 0.250 m below where it just was; the reach ends"),
        ((0.25, 0.0), [1.0, 0.5, 0.5], 308, "the goal went back by 0.500 m; the reach ends"),
        ((0.0, 0.0), [0.5, 0.5, 1.5], 307,
         "the goal has left its region: it is at (0.500, 0.500, 1.500) m; the reach ends"),
    ):  # fmt: skip
        watch = cc.GoalWatch(*box, *limits, [0.0, 0.5, 0.5], [0.5] * 3)
        assert watch.update(CYCLE, [0.5] * 3) == (0, "")
        assert watch.update(CYCLE, goal) == (code, words)


def test_an_estimator_is_updated_with_the_step_first() -> None:
    estimator, same = cc.GoalEstimator(), cc.GoalEstimator(0.06, 0.15)
    for each in (estimator, same):
        each.reset([1.0, 2.0, 3.0])
        np.testing.assert_array_equal(each.position, [1.0, 2.0, 3.0])
        assert not each.velocity.any()
    for _ in range(20):
        one, other = estimator.update(CYCLE, [1.5, 2.0, 3.0]), same.update(CYCLE, [1.5, 2.0, 3.0])
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(one, (estimator.position, estimator.velocity))
    bad = [0.0, math.nan, 0.0]
    for call in (lambda: estimator.reset(bad), lambda: estimator.update(CYCLE, bad)):
        assert refusal(call) == "goal: expected finite numbers"
    assert "dt: expected seconds" in refusal(lambda: estimator.update(-CYCLE, [0.0] * 3))


def test_joints_are_judged_before_the_chain_is_asked(chain: cc.Chain) -> None:
    bad = np.where(AXES[6] > 0, math.nan, HOME)
    for call in (chain.fk, chain.jacobian, chain.joint_origins):
        assert refusal(lambda c=call: c(bad)) == "q: expected finite numbers"
    position, orientation = chain.fk(HOME)
    assert (position.shape, orientation.shape) == ((3,), (4,))
    origins = chain.joint_origins(HOME)
    assert origins.shape == (7, 3) and np.linalg.norm(origins[6] - origins[0]) > 0.3
    ik, reference = cc.TwoTaskIk(), cc.CartesianReference(position, orientation)
    assert refusal(lambda: ik.solve(chain, bad, reference)) == "q: expected finite numbers"
    assert refusal(lambda: ik.solve(chain, HOME, reference, velocity=bad)) == "velocity: expected finite numbers"
    assert "dt: expected seconds" in refusal(lambda: ik.solve(chain, HOME, reference, dt=math.nan))
    interpolator = cc.Interpolator(cc.load_joint_limits(str(LIMITS)))
    assert refusal(lambda: interpolator.reset(bad)) == "position: expected finite numbers"
    interpolator.reset(HOME)
    assert refusal(lambda: interpolator.step(bad, CYCLE)) == "velocity: expected finite numbers"
    np.testing.assert_array_equal(interpolator.position, HOME)
    np.testing.assert_array_equal(interpolator.step(AXES[0], CYCLE), interpolator.position)


def test_a_library_gives_what_it_has_and_names_what_it_has_not(reach: cc.Primitive) -> None:
    library = cc.Library()
    assert (len(library), library.ids(), "reach" in library) == (0, [], False)
    library.add(reach)
    assert (len(library), library.ids(), "reach" in library, "wave" in library) == (1, ["reach"], True, False)
    assert library["reach"].duration == reach.duration
    with pytest.raises(KeyError, match="'wave' is unknown; loaded are: reach"):
        library["wave"]
    assert library.ids() == ["reach"], "asking adds nothing"
