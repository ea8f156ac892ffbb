"""Estimates the duration of a motion from its path, the limits of speed and acceleration, and the speed scale.

The estimates are rather too long than too short: they are time limits of waits, not plans.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_py.packages import package_path

from coglab_smach.kinematics.reachability import default_arm

LEVER = 0.4  # m/rad, motion of the hand per rotation of one joint, in a bent posture
HALF_TURN = float(np.pi)  # rad, largest rotation of the hand during a reach


@dataclass(frozen=True)
class MotionLimits:
    """Speed limits of the arm that are in force, seven joints each, in wire order."""

    velocity: tuple[float, ...]
    """rad/s, limits of the arm"""
    acceleration: tuple[float, ...]
    """rad/s^2, limits of the arm"""
    ptp_velocity: tuple[float, ...]
    """rad/s, default of a point-to-point motion"""
    ptp_acceleration: tuple[float, ...]
    """rad/s^2, default of a point-to-point motion"""
    hand_speed: float = float("inf")
    """m/s, speed at which the reference is slowed down; the smaller one of hand and elbow"""


def ptp_time(
    limits: MotionLimits, start: Sequence[float], target: Sequence[float], max_velocity: Sequence[float] = ()
) -> float:
    """Returns the duration (s) of a point-to-point motion at full speed scale. ``max_velocity``: rad/s, as
    requested."""
    way = np.abs(np.asarray(target, dtype=float) - np.asarray(start, dtype=float))
    velocity = np.asarray(max_velocity if len(max_velocity) else limits.ptp_velocity, dtype=float)
    acceleration = np.asarray(limits.ptp_acceleration, dtype=float)
    joints = float(np.max(way / velocity + velocity / acceleration))
    return max(joints, hand_path(start, target) / limits.hand_speed)


def reach_time(limits: MotionLimits, distance: float) -> float:
    """Returns the duration (s) that the limits require for a reach over ``distance`` (m) with a rotation of the hand,
    at full speed scale."""
    slowest = min(limits.velocity)
    along = distance / min(limits.hand_speed, LEVER * slowest)
    return along + HALF_TURN / slowest + max(np.divide(limits.velocity, limits.acceleration))


def hand_path(start: Sequence[float], target: Sequence[float], steps: int = 20) -> float:
    """Returns the path length (m) of the hand on the straight line between two postures in joint space."""
    line = np.linspace(np.asarray(start, dtype=float), np.asarray(target, dtype=float), steps)
    places = np.array([default_arm().fk(q)[0] for q in line])
    return float(np.sum(np.linalg.norm(np.diff(places, axis=0), axis=1)))


def read_limits(parameters: Mapping[str, Any]) -> MotionLimits:
    """Returns the limits in force, from the parameters below /controller_manager, with the manager's defaults."""
    table = str(parameters.get("joint_limits_file") or package_path("lwr_description", "config", "joint_limits.yaml"))
    limits = cc.load_joint_limits(table, str(parameters.get("joint_limits_profile", "default")))
    velocity = np.asarray(parameters.get("joint_vel_limit", limits.velocity), dtype=float)
    acceleration = np.asarray(limits.acceleration, dtype=float)
    ptp = dict(parameters.get("ptp", {}))
    speeds = [float(parameters.get(name, 1.0)) for name in ("hand_speed_limit", "elbow_speed_limit")]
    return MotionLimits(
        tuple(velocity),
        tuple(acceleration),
        tuple(float(ptp.get("default_speed", 0.3)) * velocity),
        tuple(float(ptp.get("default_acceleration", 0.2)) * acceleration),
        min((v for v in speeds if v > 0.0), default=float("inf")),
    )
