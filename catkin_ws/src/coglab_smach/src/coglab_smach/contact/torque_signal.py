"""Synthetic external joint torques as D4.10 describes them, to test and tune the contact detector without a robot.

``J^T F + bias + AR(1) noise``; the noise grows with joint speed as friction does. Defaults: 0.05 Nm for good sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass
class TorqueSignal:
    """Seven joint torques (Nm) at each call of ``sample``; seeded."""

    seed: int
    sigma: float = 0.05
    bias: float = 0.4
    correlation_time: float = 0.01
    motion_gain: float = 8.0
    """factor on the noise per rad/s"""

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng([self.seed, 41])
        self._bias = self._rng.uniform(-self.bias, self.bias, 7)
        self._noise = self.sigma * self._rng.normal(size=7)

    def sample(
        self,
        dt: float,
        jacobian: np.ndarray,
        force: Sequence[float] | np.ndarray,
        velocity: Sequence[float] | np.ndarray,
    ) -> np.ndarray:
        """One sample dt s after the last: ``jacobian`` 3 x 7, ``force`` (N) on the hand, base frame."""
        keep = float(np.exp(-dt / self.correlation_time))
        self._noise = keep * self._noise + np.sqrt(1 - keep**2) * self.sigma * self._rng.normal(size=7)
        speed = np.abs(np.asarray(velocity, dtype=float))
        friction = 0.3 * np.tanh(np.asarray(velocity, dtype=float) / 0.05)
        return jacobian.T @ np.asarray(force) + self._bias + self._noise * (1 + self.motion_gain * speed) + friction
