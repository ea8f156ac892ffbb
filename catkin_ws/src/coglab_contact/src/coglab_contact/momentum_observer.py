"""External joint torques of a moving arm without accelerations: a momentum observer (De Luca, Haddadin).

    r = K (p - integral of (tau + C^T q' - g + r)),   p = M(q) q'

so that r follows the external torque as a first-order low-pass with time constant 1/K. M, C and g come from the robot
description with the set payload. tau is the measured torque between motors and links: friction of the drives and
inertia of the motors do not enter. Velocities are computed from positions only: the mean velocity between two samples
belongs to the middle between them. The torque of a sample counts as the mean over the period that it ends, or over
an earlier one if torques lag behind positions: for a heavy arm with changing acceleration, 1 ms has an effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

Joints = Sequence[float] | np.ndarray
"""seven numbers, one per joint in wire order"""

LONGEST_GAP = 0.05  # s, longest gap between two samples that is bridged; after a longer one the observer restarts
SILENCE = 1.0  # s without a sample: the robot may have started a new session with another time
BESIDE = 0.4
"""periods, largest distance of a stamp from the grid of the measurements. Beyond that, the number of passed periods is
unclear, and a wrong number would look like a push."""
JUMP = 12.0  # Nm, difference of one sample from the estimate; a larger one may come from a wrong stamp and is left out
DOUBTS = 2  # largest number of consecutive samples that are left out; a lasting difference is a hit


class Terms(Protocol):
    """Rigid-body terms at one posture and velocity; see coglab_controllers.DynamicTerms."""

    @property
    def momentum(self) -> np.ndarray:
        """M q', kg m^2/s."""

    @property
    def transposed(self) -> np.ndarray:
        """C^T q', Nm."""

    @property
    def gravity(self) -> np.ndarray:
        """g, Nm."""


class Dynamics(Protocol):
    """Model of the arm; see coglab_controllers.ArmDynamics."""

    def evaluate(self, q: np.ndarray, velocity: np.ndarray) -> Terms:
        """Returns the terms at q (rad) and velocity (rad/s)."""

    def set_payload(self, mass: float, centre: np.ndarray) -> None:
        """Set a point mass of ``mass`` kg at ``centre`` (m, frame of the palm)."""


@dataclass(frozen=True)
class Residual:
    """Result of the observer for one sample. Nm, rad, rad/s, rad/s^2; seven joints each."""

    stamp: float
    torque: np.ndarray
    """estimate of the external torque"""
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    """low-passed like the estimate"""
    rate: np.ndarray
    """derivative of the measured torque, Nm/s, low-passed too; a lag of 1 s more subtracts it from the estimate"""
    fresh: bool = False
    """the observer has restarted: earlier estimates do not count"""


class MomentumObserver:
    """Processes consecutive samples. A sample that is not finite is left out. After a long gap or a set clock, a new
    estimate starts at zero: the torque that acts then counts as the arm's own."""

    def __init__(self, dynamics: Dynamics, gain: float = 40.0, period: float = 0.0) -> None:
        """``gain``: K, 1/s. ``period``: of the robot's measurements, s; the time between samples is a multiple of it.
        0: the stamps are exact. Stamps of reception jitter, which affects velocities; jitter up to a quarter of a
        period is removed."""
        if not gain > 0.0 or not math.isfinite(gain):
            raise ValueError(f"gain must be a positive number of 1/s, got {gain}")
        self.gain, self.period = gain, period
        self.lag = 0.0
        """s by which the torques lag behind the positions of the same sample"""
        self._dynamics = dynamics
        self.reset()

    def reset(self) -> None:
        """Delete all past samples."""
        self._stamp: float | None = None
        self._made: float | None = None
        self._grid = 0.0
        self._position = self._torque = np.zeros(7)
        self._step = 0.0
        self._velocity: np.ndarray | None = None
        self._momentum = self._forces = np.zeros(7)
        self._residual: np.ndarray | None = None
        self._acceleration, self._rate = np.zeros(7), np.zeros(7)
        self._doubts = 0

    def set_payload(self, mass: float, centre: Joints) -> None:
        """Set the payload: its weight and inertia are then no external torque. The estimate restarts. ValueError:
        invalid mass."""
        self._dynamics.set_payload(mass, np.asarray(centre, dtype=float))
        self.reset()

    def feed(self, stamp: float, position: Joints, torque: Joints, made: float | None = None) -> Residual | None:
        """Process one sample: s, rad, Nm. None until enough consecutive samples have come. ``made``: the robot's time
        (s) of the measurement, if known; then the stamp, which is late on a busy computer, is not used."""
        q, tau = np.asarray(position, dtype=float), np.asarray(torque, dtype=float)
        if not (math.isfinite(stamp) and np.isfinite(q).all() and np.isfinite(tau).all()):
            return None
        step = self._since_last(stamp, made)
        if step is None:
            self.reset()
            self._grid = stamp
        self._made = made
        if step == 0.0:
            return None
        if step is not None and step < 0.0:  # the estimate stays, the velocities restart
            self._stamp, self._grid, self._velocity = stamp, stamp, None
            self._position, self._torque = q, tau
            return None
        last_position, last_torque = self._position, self._torque
        self._stamp, self._position, self._torque = stamp, q, tau
        return None if step is None else self._advance(stamp, step, last_position, last_torque)

    def _since_last(self, stamp: float, made: float | None) -> float | None:
        """Returns the time (s) since the last sample. None: it does not follow the last one. 0: it is a repetition.
        Negative: the time is unclear."""
        if self._stamp is None or (made is None) != (self._made is None):
            return None
        step = stamp - self._stamp
        if made is not None and self._made is not None:
            step = made - self._made
            return step if 0.0 <= step <= LONGEST_GAP and abs(stamp - self._stamp) <= SILENCE else None
        if step == 0.0 or not -LONGEST_GAP <= step <= LONGEST_GAP:
            return 0.0 if step == 0.0 else None
        if self.period > 0.0:
            # The measurements lie on a regular grid. The stamps show it with jitter, so the grid follows them slowly.
            since = (stamp - self._grid) / self.period
            periods = max(1, round(since))
            if abs(since - periods) > BESIDE:
                return -1.0
            self._grid += periods * self.period
            self._grid += 0.05 * (stamp - self._grid)
            return periods * self.period
        return step if step > 0.0 else None

    def _advance(self, stamp: float, step: float, before: np.ndarray, torque_before: np.ndarray) -> Residual | None:
        velocity = (self._position - before) / step
        terms = self._dynamics.evaluate(0.5 * (self._position + before), velocity)
        momentum, forces = np.array(terms.momentum), terms.gravity - terms.transposed
        last_velocity, last_momentum, last_forces, last_step = self._velocity, self._momentum, self._forces, self._step
        self._velocity, self._momentum, self._forces, self._step = velocity, momentum, forces, step
        if last_velocity is None:
            return None
        # From the middle of the last interval to the middle of this one: each torque is a mean over its interval.
        span = 0.5 * (step + last_step)
        torque = (last_step * torque_before + step * self._torque) / (step + last_step)
        rate = (self._torque - torque_before) / span
        outside = (momentum - last_momentum) / span + 0.5 * (forces + last_forces) - torque - self.lag * rate
        jumps = self._residual is not None and np.abs(outside - self._residual).max() > JUMP
        if jumps and self._doubts < DOUBTS:
            self._doubts, self._velocity = self._doubts + 1, None
            return None
        self._doubts = 0
        fresh = self._residual is None
        keep = 0.0 if fresh else math.exp(-self.gain * span)
        last = np.zeros(7) if self._residual is None else self._residual
        residual = self._residual = keep * last + (1.0 - keep) * outside
        self._acceleration = keep * self._acceleration + (1.0 - keep) * (velocity - last_velocity) / span
        self._rate = keep * self._rate + (1.0 - keep) * rate
        return Residual(stamp, residual, self._position, velocity, self._acceleration, self._rate, fresh)
