"""Runs a motion without a robot, as the control cycle would: for tests and plots of its reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from coglab.control.motion import (
    ControlError,
    MotionCycle,
    MotionSetup,
    MotionStart,
    Reference,
    SetPoint,
    Vector,
    is_done,
)

HOME = (-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782)  # rad, start posture of the robots


@dataclass(frozen=True, eq=False)
class Simulated:
    """References of a whole motion, one row for each cycle. `joints` or `position` is empty."""

    time: Vector  # s of motion time, (n,)
    joints: Vector  # rad, (n, 7) or (0, 7)
    position: Vector  # m, (n, 3) or (0, 3)
    velocity: Vector  # rad/s (n, 7), or twist in m/s and rad/s (n, 6)

    @property
    def jump(self) -> float:
        """Largest step (rad or m) between two cycles that the velocity does not explain: the arm would lag behind it.

        The first reference is not compared with the set-point.
        """
        at = self.joints if len(self.joints) else self.position
        if len(at) < 2:
            return 0.0
        speed = 0.5 * (self.velocity[1:] + self.velocity[:-1])[:, : at.shape[1]]
        steps = np.diff(at, axis=0) - speed * np.diff(self.time)[:, None]
        return float(np.abs(steps).max())


def simulate(
    motion: Any,
    arguments: Mapping[str, float] | None = None,
    *,
    set_point: SetPoint | None = None,
    cycle_time: float = 0.005,
    longest: float = 60.0,
) -> Simulated:
    """Run a motion until it is done and collect its references. The measured joints are those of the last reference.

    `arguments`: as in a request; `set_point`: its start (default: at rest in the home posture, the palm at
    0.5, 0, 0.5 m); `longest`: s of motion time. Raises ControlError if it takes longer, changes between joints and
    poses, or returns no Reference.
    """
    setup = MotionSetup(None, cycle_time)
    configure = getattr(motion, "configure", None)
    if configure is not None:
        configure(setup)
    start = set_point or SetPoint(
        np.array(HOME), np.zeros(7), np.array([0.5, 0.0, 0.5]), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(6)
    )
    motion.start(MotionStart(setup.values(arguments or {}), start))
    rows: list[Reference] = []
    times: list[float] = []
    joints = start.joints
    while not (rows and is_done(motion)):
        time = len(rows) * cycle_time
        if time > longest:
            raise ControlError(f"the motion is not done after {longest} s; does done() become true?")
        reference = motion.reference(MotionCycle(time, time + cycle_time, joints.copy()))
        if not isinstance(reference, Reference):
            raise ControlError(f"reference() returned {reference!r}; a coglab.control.Reference is expected")
        if rows and (reference.joints is None) != (rows[0].joints is None):
            raise ControlError(f"after {time:.3f} s the motion changes between joints and poses; begin a new motion")
        joints = joints if reference.joints is None else reference.joints
        rows.append(reference)
        times.append(time)
    in_joints = [row for row in rows if row.joints is not None]
    in_space = [row for row in rows if row.position is not None]
    velocity = [row.joint_velocity for row in in_joints] or [row.twist for row in in_space]
    return Simulated(
        np.array(times),
        np.array([row.joints for row in in_joints]).reshape(-1, 7),
        np.array([row.position for row in in_space]).reshape(-1, 3),
        np.array(velocity),
    )
