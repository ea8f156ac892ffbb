"""External joint torques of a moving arm without accelerations: a momentum observer (De Luca, Haddadin).

    r = K (p - integral of (tau + C^T q' - g + r)),   p = M(q) q'

so that r follows the external torque as a first-order low-pass with the time constant 1/K. M, C and g are those of the
robot description with what the hand is told to carry; tau is the measured torque between motors and links, so that
friction of the drives and inertia of the motors do not enter. Velocities come from positions alone: the mean velocity
between two samples, in the middle of them. The torque of a sample counts as the mean over the period that it ends, or
over one so much earlier as torques lag behind positions: a heavy arm whose acceleration changes feels a millisecond.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

Joints = Sequence[float] | np.ndarray
"""seven numbers, one for each joint in wire order"""

LONGEST_GAP = 0.05  # s between two samples that the observer bridges; after a longer one it begins anew
SILENCE = 1.0
"""s without a sample, after which the robot may have begun a new session, whose time does not follow the old one"""
BESIDE = 0.4
"""periods by which a stamp may lie beside the grid of the measurements; farther away nobody can say how many have
passed, and one too many or too few would look like a push"""
JUMP = 12.0  # Nm by which one sample differs from the estimate if its stamp may be wrong: it is left out
DOUBTS = 2  # such samples in a row at most: what stays is a hit


class Terms(Protocol):
    """Rigid-body terms at one posture and velocity, as coglab_controllers.DynamicTerms."""

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
    """The model of the arm, as coglab_controllers.ArmDynamics."""

    def evaluate(self, q: np.ndarray, velocity: np.ndarray) -> Terms:
        """Terms at q (rad) and velocity (rad/s)."""

    def set_payload(self, mass: float, centre: np.ndarray) -> None:
        """A point of ``mass`` kg at ``centre`` (m, frame of the palm) from now on."""


@dataclass(frozen=True)
class Residual:
    """What the observer tells with one sample. Torques in Nm, rad/s, rad/s^2; seven joints each."""

    stamp: float
    torque: np.ndarray
    """estimate of the external torque"""
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    """low-passed as the estimate is"""
    rate: np.ndarray
    """of the measured torque, Nm/s, low-passed in the same way: a second more of lag takes this from the estimate"""
    fresh: bool = False
    """the observer has begun anew: the estimates before this one do not count"""


class MomentumObserver:
    """One sample after the other; a sample that is no number is left out, one that comes after a long gap or with a
    clock that was set begins a new estimate at zero error: what acts then counts as the arm's own."""

    def __init__(self, dynamics: Dynamics, gain: float = 40.0, period: float = 0.0) -> None:
        """``gain``: K, 1/s. ``period``: s between the robot's measurements, of which the times between samples are
        whole multiples; 0: the stamps are exact. Stamps of reception jitter, and a velocity feels that;
        up to a quarter of a period is taken away."""
        if not gain > 0.0 or not math.isfinite(gain):
            raise ValueError(f"gain must be a positive number of 1/s, got {gain}")
        self.gain, self.period = gain, period
        self.lag = 0.0
        """s by which the torques come later than the positions of the same sample"""
        self._dynamics = dynamics
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
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
        """The hand carries this from now on: what it weighs and its inertia are no external torque any more. The
        estimate begins anew. ValueError for what is no mass."""
        self._dynamics.set_payload(mass, np.asarray(centre, dtype=float))
        self.reset()

    def feed(self, stamp: float, position: Joints, torque: Joints, made: float | None = None) -> Residual | None:
        """One sample: s, rad, Nm. None while too few samples have followed each other. ``made``: s, the robot's time
        of the measurement, if it is known: then no stamp counts, which a busy computer gives too late."""
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
        if step is not None and step < 0.0:  # the estimate stays, velocities begin anew
            self._stamp, self._grid, self._velocity = stamp, stamp, None
            self._position, self._torque = q, tau
            return None
        last_position, last_torque = self._position, self._torque
        self._stamp, self._position, self._torque = stamp, q, tau
        return None if step is None else self._advance(stamp, step, last_position, last_torque)

    def _since_last(self, stamp: float, made: float | None) -> float | None:
        """s since the last sample; None if this one does not follow it; 0 for one that was there already; negative
        where nobody can say."""
        if self._stamp is None or (made is None) != (self._made is None):
            return None
        step = stamp - self._stamp
        if made is not None and self._made is not None:
            step = made - self._made
            return step if 0.0 <= step <= LONGEST_GAP and abs(stamp - self._stamp) <= SILENCE else None
        if step == 0.0 or not -LONGEST_GAP <= step <= LONGEST_GAP:
            return 0.0 if step == 0.0 else None
        if self.period > 0.0:
            # The measurements lie on a grid that the stamps tell with jitter, and that is followed slowly.
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
        # From the middle of the last interval to that of this one: each of the two torques is a mean over its interval.
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
