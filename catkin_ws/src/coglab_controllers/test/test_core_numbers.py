"""The cores against formulas written here: speeds before stops and borders, gains, ramps, clocks, goals, watches."""

from __future__ import annotations

import math

import coglab_controllers as cc
import numpy as np
import pytest

HOME = np.array([0.1, 0.6, -0.2, -1.3, 0.3, 0.9, 0.2])
AXES = np.eye(7)
EVERYWHERE = {"box_min": [-9] * 3, "box_max": [9] * 3, "base_radius": 0.0, "max_stretch": 1.0}


def stopping_speed(room: float, acceleration: float, lag: float) -> float:
    """v of v^2 / (2 a) + v lag = room."""
    return acceleration * (math.sqrt(lag**2 + 2.0 * room / acceleration) - lag) if room > 0.0 else 0.0


def guard_of(chain: cc.Chain, limits: cc.JointLimits, workspace: dict | None = None, **parameters: float) -> cc.Guard:
    return cc.Guard(chain, limits, cc.WorkspaceParameters(**(workspace or EVERYWHERE)), **parameters)


def test_the_speed_toward_a_stop_leaves_room_for_jerk_and_reaction(chain, limits) -> None:
    for parameters in ({}, {"reaction_time": 0.05, "position_margin": 0.03}):
        guard = guard_of(chain, limits, **parameters)
        margin, reaction = parameters.get("position_margin", 0.01), parameters.get("reaction_time", 0.015)
        for joint in range(7):
            a, lag = limits.acceleration[joint], 1.5 * limits.acceleration[joint] / limits.jerk[joint] + reaction
            for room in (-0.1, 0.0, margin, margin + 1e-3, 0.1, 1.0):
                expected = stopping_speed(room - margin, a, lag)
                assert guard.speed_to_stop(joint, room) == pytest.approx(expected, rel=1e-9, abs=1e-12), (joint, room)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_near_its_stop_gets_that_speed_and_the_others_their_share(chain, limits, sign: float) -> None:
    guard = guard_of(chain, limits, hand_speed=0.0, elbow_speed=0.0)
    for joint in range(7):
        stop = (limits.upper_position if sign > 0 else limits.lower_position)[joint]
        q = np.where(AXES[joint] > 0, stop - 0.05 * sign, HOME)
        request = np.where(AXES[joint] > 0, sign, 0.4)
        result = guard.limit(chain, q, request)
        allowed = guard.speed_to_stop(joint, 0.05)
        assert (result.reason, result.joint) == ("joint position limit", joint)
        assert result.scale == pytest.approx(allowed, rel=1e-9) and 0.0 < allowed < 1.0
        np.testing.assert_allclose(result.velocity, allowed * request, rtol=1e-9)


def elbow_speed(chain: cc.Chain, q: np.ndarray, velocity: np.ndarray) -> float:
    """Of the origin of the fourth of seven joints, by a difference."""
    h = 1e-6
    return float(
        np.linalg.norm(chain.joint_origins(q + h * velocity)[3] - chain.joint_origins(q - h * velocity)[3])
    ) / (2 * h)


@pytest.mark.parametrize("limit", [1.0, 0.25, 0.1])
def test_a_part_of_each_cartesian_speed_limit_is_kept_back(chain, limits, limit: float) -> None:
    """35 mm/s, at most 15 % of the limit: for joints that follow with different lags."""
    kept = limit - min(0.035, 0.15 * limit)
    request = np.array([1.9, 1.9, 0.0, -1.5, 0.0, 0.0, 0.0])
    hand = guard_of(chain, limits, hand_speed=limit, elbow_speed=0.0).limit(chain, HOME, request)
    assert hand.reason == "Cartesian speed limit of the hand" and hand.joint == -1
    assert np.linalg.norm(chain.jacobian(HOME)[:3] @ hand.velocity) == pytest.approx(kept, rel=1e-9)
    swing = np.array([1.9, 1.9, 0.0, 0.0, 0.0, 0.0, 0.0])
    if elbow_speed(chain, HOME, swing) > kept:
        elbow = guard_of(chain, limits, hand_speed=0.0, elbow_speed=limit).limit(chain, HOME, swing)
        assert elbow.reason == "Cartesian speed limit of the elbow" and elbow.joint == -1
        assert elbow_speed(chain, HOME, elbow.velocity) == pytest.approx(kept, rel=1e-5)
    assert guard_of(chain, limits, hand_speed=0.0, elbow_speed=0.0).limit(chain, HOME, swing * 0.9).scale == 1.0
    assert elbow_speed(chain, HOME, swing) > 0.3, "or the elbow's limit shows nothing"


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("upper", [False, True])
def test_a_side_of_the_box_is_approached_with_two_metres_per_second_squared(chain, limits, axis, upper) -> None:
    place = chain.fk(HOME)[0]
    box = {"box_min": np.full(3, -9.0), "box_max": np.full(3, 9.0), "base_radius": 0.0, "max_stretch": 1.0}
    side, sign = ("box_max", 1.0) if upper else ("box_min", -1.0)
    box[side] = np.where(np.arange(3) == axis, place + sign * 0.02, box[side])
    guard = guard_of(chain, limits, box, hand_speed=0.0, elbow_speed=0.0)
    request = np.linalg.pinv(chain.jacobian(HOME)[:3]) @ (sign * 0.7 * np.eye(3)[axis])
    assert np.abs(request).max() < 1.9
    result = guard.limit(chain, HOME, request)
    assert (
        result.reason == "workspace border"
        and result.joint == -1
        and result.border == f"{'upper' if upper else 'lower'} side of the workspace box"
    )
    assert result.scale == pytest.approx(stopping_speed(0.02, 2.0, 0.015) / 0.7, rel=1e-9)
    assert guard.limit(chain, HOME, -request).scale == 1.0, "away from it nothing is held up"


def test_the_workspace_takes_its_faces_and_projects_to_what_is_allowed() -> None:
    workspace = cc.Workspace()
    for face in (
        [1.2, 0, 1],
        [-1.2, 0, 1],
        [0, 1.2, 1],
        [0, -1.2, 1],
        [0.5, 0, 0.0],
        [0.5, 0, 1.6],
        [0.25, 0, 0.2],
        [0, 0, 0.45],
    ):
        assert workspace.violated(face) == "inside the workspace" and workspace.contains(face)
        np.testing.assert_array_equal(workspace.project(face), face)
    for point, border in (
        ([1.2001, 0, 1], "upper side"),
        ([0, -1.2001, 1], "lower side"),
        ([0.5, 0, -0.001], "lower side"),
        ([0.5, 0, 1.601], "upper side"),
        ([0.2499, 0, 0.2], "sphere around the base"),
    ):
        assert workspace.violated(point).startswith(border) and not workspace.contains(point)
    np.testing.assert_allclose(workspace.project([5, -5, 1]), [1.2, -1.2, 1])
    np.testing.assert_allclose(workspace.project([0.1, 0.0, 0.2]), [0.25, 0.0, 0.2], atol=1e-8)
    np.testing.assert_allclose(workspace.project([0.0, 0.06, 0.28]), [0.0, 0.15, 0.4], atol=1e-8)
    np.testing.assert_allclose(workspace.project([0.0, 0.0, 0.2]), [0.25, 0.0, 0.2], atol=1e-8)
    everywhere = cc.Workspace(cc.WorkspaceParameters(base_radius=0.0))
    np.testing.assert_array_equal(everywhere.project([0.0, 0.0, 0.2]), [0.0, 0.0, 0.2])


def test_the_governor_rises_by_two_and_falls_by_ten_per_second_and_follows_limits_at_once() -> None:
    governor = cc.PhaseGovernor()
    assert governor.rate == 1.0
    assert governor.update(0.01, 0.0, 1.0) == pytest.approx(0.9, abs=1e-12)
    assert governor.update(0.01, 1.0, 1.0) == pytest.approx(0.92, abs=1e-12)
    assert governor.update(0.01, 1.0, 0.5) == pytest.approx(0.46, abs=1e-12)
    assert governor.update(0.01, 0.4601, 1.0) == pytest.approx(0.4601, abs=1e-12)
    assert governor.update(1.0, 7.0, 1.0) == 1.0 and governor.update(1.0, -1.0, 1.0) == 0.0
    governor.reset()
    assert governor.rate == 1.0 and governor.update(0.01, 1.0, -0.5) == 0.0
    governor.reset(0.3)
    assert governor.update(0.0, 1.0, 1.0) == 0.3
    slow = cc.PhaseGovernor(0.5, 1.0)
    assert slow.update(0.1, 0.0, 1.0) == pytest.approx(0.9) and slow.update(0.1, 1.0, 1.0) == pytest.approx(0.95)


def test_errors_are_answered_with_the_speed_from_which_each_joint_can_brake(chain) -> None:
    """Half the deceleration limit, 15 ms of reaction and 1.5 a / j of jerk for the slowest joint."""
    acceleration, jerk = np.full(7, 10.0), np.full(7, 500.0)
    acceleration[1], jerk[3] = 4.0, 200.0
    ik = cc.TwoTaskIk(velocity_limit=np.full(7, 90.0), acceleration_limit=acceleration, jerk_limit=jerk)
    position, orientation = chain.fk(HOME)
    inverse = np.linalg.pinv(chain.jacobian(HOME)[:3])
    for size in (1e-4, 0.003, 0.02, 0.2):
        error = size * np.array([0.6, -0.5, 0.62])
        result = ik.solve(chain, HOME, cc.CartesianReference(position + error, orientation, orientation_control=False))
        way = inverse @ error
        lag = 0.015 + 1.5 * acceleration / jerk
        slowest = (np.sqrt(lag**2 + 2.0 * np.abs(way) / (0.5 * acceleration)) + lag).max()
        np.testing.assert_allclose(result.velocity, min(20.0, 2.0 / slowest) * way, rtol=1e-9)


def test_singular_values_of_a_stretched_arm_are_damped_below_ten_millimetres(chain) -> None:
    q = np.array([0.3, 0.4, 0.2, 0.005, 0.3, 0.02, 0.2])
    jacobian = chain.jacobian(q)[:3]
    u, sigma, vt = np.linalg.svd(jacobian, full_matrices=False)
    for threshold in (0.01, 2.0 * sigma[2]):
        ik = cc.TwoTaskIk(velocity_limit=np.full(7, 99.0), stretch_threshold=threshold)
        ik = cc.TwoTaskIk(velocity_limit=np.full(7, 99.0)) if threshold == 0.01 else ik
        inverse = np.where(sigma >= threshold, 1.0 / sigma, sigma / threshold**2)
        asked = np.array([0.01, 0.02, -0.01])
        reference = cc.CartesianReference(*chain.fk(q), asked, orientation_control=False)
        result = ik.solve(chain, q, reference)
        assert result.smallest_singular_value_position == pytest.approx(sigma[2], abs=1e-12)
        np.testing.assert_allclose(result.velocity, vt.T @ (inverse * (u.T @ asked)), atol=1e-9)
