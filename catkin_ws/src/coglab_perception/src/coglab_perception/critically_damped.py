"""A low-pass filter for what is corrected again and again: no step, no overshoot, samples at any times."""

from __future__ import annotations

import math

import numpy as np


class CriticallyDamped:
    """Second order, solved exactly: two time constants late behind what moves steadily, and at what stands still within
    about five."""

    def __init__(self) -> None:
        self._value: np.ndarray | None = None
        self._rate = np.zeros(3)
        self._stamp = -math.inf

    def forget(self) -> None:
        """What comes next is where it begins, at rest."""
        self._value = None

    def step(self, stamp: float, wanted: np.ndarray, time_constant: float) -> np.ndarray:
        """Where it is at ``stamp`` (s, later than the last one), with ``wanted`` (3,) and poles at 1/``time_constant``
        (s) since then; 0: what comes in goes out."""
        gap, self._stamp = stamp - self._stamp, stamp
        if self._value is None or time_constant <= 0.0:
            value, self._rate = np.array(wanted, dtype=float), np.zeros(3)
        else:
            pole = 1.0 / time_constant
            left = math.exp(-pole * gap)
            away = self._value - wanted
            drift = self._rate + pole * away
            value = wanted + left * (away + gap * drift)
            self._rate = left * (self._rate - pole * gap * drift)
        self._value = value
        return value
