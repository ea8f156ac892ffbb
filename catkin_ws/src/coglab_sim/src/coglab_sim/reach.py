"""How a hand moves from here to there: decoupled minimum jerk and a conic (elliptic) path.

Minimum jerk: Flash and Hogan's fifth-order polynomial. Decoupled: the vertical part is a little quicker than the
horizontal one. Conic: the same timing along an ellipse arc, as unconstrained handovers show.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def min_jerk(x: float) -> tuple[float, float]:
    """Share of the way and its derivative at share x of the duration; constant outside 0..1."""
    if x <= 0.0:
        return 0.0, 0.0
    if x >= 1.0:
        return 1.0, 0.0
    return x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2


@dataclass(frozen=True)
class Reach:
    """One reach from ``start`` to ``end`` (m) in ``duration`` s, beginning at time ``begin`` (s)."""

    start: np.ndarray
    end: np.ndarray
    begin: float
    duration: float
    vertical_share: float = 0.85
    """the vertical part takes this share of the duration"""
    bow: float = 0.0
    """m, largest deviation from the straight line, upward; makes the path an arc of an ellipse"""

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Position (m) and velocity (m/s) at time t."""
        way = self.end - self.start
        s, ds = min_jerk((t - self.begin) / self.duration)
        sz, dsz = min_jerk((t - self.begin) / (self.duration * self.vertical_share))
        position = self.start + way * np.array([s, s, sz])
        velocity = way * np.array([ds, ds, dsz / self.vertical_share]) / self.duration
        if self.bow != 0.0:
            # Half an ellipse over the chord, its height reached in the middle: y = bow * sin(pi s).
            position[2] += self.bow * np.sin(np.pi * s)
            velocity[2] += self.bow * np.pi * np.cos(np.pi * s) * ds / self.duration
        return position, velocity

    def over(self, t: float) -> bool:
        """Whether the reach has ended."""
        return t >= self.begin + self.duration


def duration_for(distance: float, base: float) -> float:
    """Duration (s) of a human reach over ``distance`` m; ``base`` is that of 0.45 m. Grows with the power 0.3."""
    return base * max(0.3, (max(distance, 1e-3) / 0.45) ** 0.3)
