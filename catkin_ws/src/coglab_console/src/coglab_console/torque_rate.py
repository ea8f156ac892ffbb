"""The signal of the contact work-bench: how fast the external torques change, and thresholds learnt at rest.

As the contact detector's own: low-passed torque, its difference over a short window (Nm), per joint; a threshold is k
robust standard deviations of that difference while the arm stood still. What is shown here decides nothing.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

JOINTS = 7
MAD_TO_SIGMA = 1.4826
LEARN_TIME = 5.0


@dataclass(frozen=True)
class Settings:
    """Parameters of /contact_detector that the signal depends on."""

    cutoff: float = 20.0
    window: float = 0.04
    k: float = 6.0
    floor: float = 0.02
    still_speed: float = 0.02


class TorqueRate:
    """Fed with each torque sample; the newest difference per joint can be asked at any time."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self._filtered: list[float] | None = None
        self._last = 0.0
        self._history: deque[tuple[float, list[float]]] = deque()
        self._learnt: list[list[float]] = []
        self._learn_until: float | None = None
        self.sigma = [settings.floor] * JOINTS
        self.learnt = False
        self._peaks = [0.0] * JOINTS

    def learn(self) -> None:
        """From now on, for LEARN_TIME s of samples at rest."""
        self._learnt, self._learn_until = [], self._last + LEARN_TIME

    def learning(self) -> bool:
        """Whether it still gathers."""
        return self._learn_until is not None

    def feed(self, stamp: float, torque: tuple[float, ...], moving: bool) -> str:
        """One sample (Nm). Returns what came of learning, in words, once; else an empty string."""
        if len(torque) != JOINTS or not all(map(math.isfinite, torque)) or not math.isfinite(stamp):
            return ""
        dt = stamp - self._last
        self._last = stamp
        if self._filtered is None or not 0.0 < dt <= 0.1:
            self._filtered = list(torque)
            self._history.clear()
            if self._learn_until is not None:
                self._learn_until = stamp + LEARN_TIME
        else:
            blend = 1.0 - math.exp(-2.0 * math.pi * self.settings.cutoff * dt)
            self._filtered = [old + blend * (new - old) for old, new in zip(self._filtered, torque, strict=True)]
        self._history.append((stamp, self._filtered))
        while len(self._history) > 1 and self._history[1][0] <= stamp - self.settings.window + 1e-9:
            self._history.popleft()
        now = self.newest()
        self._peaks = [a if abs(a) > abs(b) else b for a, b in zip(now, self._peaks, strict=True)]
        return self._gather(stamp, now, moving) if self._learn_until is not None else ""

    def newest(self) -> list[float]:
        """Difference over the window, Nm, (7); zeros before the first sample."""
        if self._filtered is None:
            return [0.0] * JOINTS
        return [new - old for new, old in zip(self._filtered, self._history[0][1], strict=True)]

    def take_peaks(self) -> list[float]:
        """The largest difference per joint since the last call: a slow chart misses no spike."""
        peaks, self._peaks = self._peaks, self.newest()
        return peaks

    def thresholds(self, k: float = 0.0) -> list[float]:
        """Nm per joint."""
        return [(k or self.settings.k) * sigma for sigma in self.sigma]

    def _gather(self, stamp: float, difference: list[float], moving: bool) -> str:
        if moving:
            self._learn_until, self._learnt = None, []
            return "learning ended: the arm moved; try again at rest"
        self._learnt.append(difference)
        assert self._learn_until is not None
        if stamp < self._learn_until:
            return ""
        self._learn_until = None
        columns = list(zip(*self._learnt, strict=True))
        self.sigma = [max(self.settings.floor, MAD_TO_SIGMA * _spread(column)) for column in columns]
        self.learnt = True
        return f"learnt from {len(self._learnt)} samples at rest: " + ", ".join(f"{s:.3f}" for s in self.sigma) + " Nm"


def _spread(values: tuple[float, ...]) -> float:
    """Median absolute deviation."""
    middle = _median(values)
    return _median(tuple(abs(value - middle) for value in values))


def _median(values: tuple[float, ...]) -> float:
    ordered = sorted(values)
    half = len(ordered) // 2
    return ordered[half] if len(ordered) % 2 else (ordered[half - 1] + ordered[half]) / 2
