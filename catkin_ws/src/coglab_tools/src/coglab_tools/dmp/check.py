"""Runs a primitive on the model of the arm, without a robot: joint speeds, limits, reached goals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import coglab_controllers as cc
import numpy as np
from coglab_py.packages import package_path
from coglab_smach.context.config import Config
from coglab_smach.kinematics.reachability import default_arm, home_posture, joint_limits

from coglab_tools.dmp.demonstration import Array

CYCLE = 0.01  # s
SETTLE = 1.35  # length of a course, in durations of the primitive
NEAR = 0.01  # m, largest distance from the goal at the end
FULL_SPEED = 0.99  # factor on the palm's speed below which the arm counts as slowed by a limit
NAMES = ("A1", "A2", "E1", "A3", "A4", "A5", "A6")


@dataclass(frozen=True, eq=False)
class Course:
    """One run of a primitive on the arm, from the home posture."""

    goal: Array
    """m, (3,)"""
    times: Array
    """s, (n,)"""
    path: Array
    """m, (n, 3): of the palm"""
    shares: Array
    """joint speeds as share of their limits, (n, 7)"""
    error: float
    """m, distance from the goal at the end"""
    stopped_by: str
    """joint that is at its stop, or the border of the workspace that the goal violates; empty: none"""
    slowest: float
    """smallest factor 0..1 by which a joint's speed limit slowed the palm; 1: never"""

    @property
    def peak(self) -> float:
        """Largest joint speed, share of its limit."""
        return float(np.abs(self.shares).max())

    @property
    def fastest(self) -> str:
        """Name of the joint that is nearest to its speed limit."""
        return NAMES[int(np.argmax(np.abs(self.shares).max(axis=0)))]

    @property
    def reached(self) -> bool:
        """The palm came to the goal, without a joint at its stop."""
        return self.error <= NEAR and not self.stopped_by

    @property
    def verdict(self) -> str:
        """reached, slowed (the arm takes longer than the primitive), or the obstacle."""
        if not self.reached:
            return self.stopped_by or f"ends {1000 * self.error:.0f} mm off"
        return "slowed" if self.slowest < FULL_SPEED else "reached"


@lru_cache(maxsize=1)
def home_palm() -> tuple[Array, Array]:
    """Position (3,) m and orientation (4,) of the palm at home, base frame."""
    position, orientation = default_arm().fk(home_posture())
    return position, orientation


@lru_cache(maxsize=1)
def region() -> tuple[Array, Array]:
    """Corners (3,) in m of the handover region in the machines' configuration, base frame."""
    machines = Config.load(str(package_path("coglab_smach", "config", "machines.yaml")))
    low, high = (np.array(machines.get(f"handover.region_{end}"), dtype=float) for end in ("low", "high"))
    return low, high


def region_middle() -> Array:
    """Middle of the handover region, m, (3,)."""
    low, high = region()
    return np.asarray((low + high) / 2)


def run(primitive: cc.Primitive, goal: Array, ratio: float = 1.0) -> Course:
    """Follow a primitive from home to a goal (3,) m with the orientation of the palm at home."""
    arm, limits = default_arm(), joint_limits()
    position, orientation = home_palm()
    motion, ik = cc.CartesianMotion(), cc.TwoTaskIk(velocity_limit=limits.velocity)
    motion.start(primitive, position, orientation, goal, orientation, ratio=ratio)
    q, velocity = np.array(home_posture()), np.zeros(7)
    times = np.arange(0.0, SETTLE * ratio * primitive.duration, CYCLE)
    path, shares, at_stop, slowest = [], [], "", 1.0
    for _ in times:
        reference = motion.step(CYCLE, goal, orientation)
        result = ik.solve(arm, q, reference, velocity=velocity, dt=CYCLE)
        velocity, slowest = result.velocity, min(slowest, result.scale)
        shares.append(velocity / limits.velocity)
        asked = q + CYCLE * velocity
        q = np.clip(asked, limits.lower_position, limits.upper_position)
        if not at_stop and np.any(asked != q):
            at_stop = f"{NAMES[int(np.argmax(asked != q))]} at its stop"
        path.append(arm.fk(q)[0])
    workspace = cc.Workspace()
    outside = "" if workspace.contains(goal) else workspace.violated(goal)
    error = float(np.linalg.norm(path[-1] - goal))
    return Course(np.asarray(goal), times, np.array(path), np.array(shares), error, outside or at_stop, slowest)


def grid(counts: tuple[int, int, int] = (4, 5, 4)) -> list[Array]:
    """Goals on a grid of the handover region, each (3,) m."""
    low, high = region()
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    return [np.array([x, y, z]) for z in axes[2] for y in axes[1] for x in axes[0]]


def over_region(primitive: cc.Primitive, goals: Iterable[Array] | None = None, ratio: float = 1.0) -> list[Course]:
    """One course per goal."""
    return [run(primitive, goal, ratio) for goal in (grid() if goals is None else goals)]
