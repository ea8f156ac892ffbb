"""Reaches of a hand: decoupled minimum jerk and a conic (elliptic) path.

Minimum jerk: Flash and Hogan's fifth-order polynomial. Decoupled: the vertical part is a little faster than the
horizontal one. Conic: the same timing along an arc of an ellipse, as in unconstrained handovers. Corrections during the
reach are superposed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from coglab_py.rotation import Rotation


def min_jerk(x: float) -> tuple[float, float]:
    """Returns share of the path and its derivative at share x of the duration; constant outside 0..1."""
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
    """m, largest upward deviation from the straight line; the path is then an arc of an ellipse"""

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Position (m) and velocity (m/s) at time t (s)."""
        way = self.end - self.start
        s, ds = min_jerk((t - self.begin) / self.duration)
        sz, dsz = min_jerk((t - self.begin) / (self.duration * self.vertical_share))
        position = self.start + way * np.array([s, s, sz])
        velocity = way * np.array([ds, ds, dsz / self.vertical_share]) / self.duration
        if self.bow != 0.0:
            # Half an ellipse over the chord, highest in the middle: y = bow * sin(pi s).
            position[2] += self.bow * math.sin(math.pi * s)
            velocity[2] += self.bow * math.pi * math.cos(math.pi * s) * ds / self.duration
        return position, velocity

    def over(self, t: float) -> bool:
        """True if the reach has ended."""
        return t >= self.begin + self.duration


class CorrectedReach:
    """A reach whose end can change while it runs. Each correction adds a minimum-jerk displacement (superposition,
    Flash and Henis 1991), so that position and velocity have no step."""

    def __init__(self, reach: Reach) -> None:
        self.parts = [reach]

    @property
    def end(self) -> np.ndarray:
        """m, present target of the hand"""
        return self.parts[0].end + sum((part.end for part in self.parts[1:]), np.zeros(3))

    @property
    def duration(self) -> float:
        """s, from the beginning of the reach to the end of the last correction"""
        return max(part.begin + part.duration for part in self.parts) - self.parts[0].begin

    @property
    def begin(self) -> float:
        """s, time of the reach's beginning"""
        return self.parts[0].begin

    def retarget(self, t: float, end: np.ndarray, duration: float) -> None:
        """Changes the target to ``end`` (m) at time t (s); the correction takes ``duration`` s."""
        self.parts.append(Reach(np.zeros(3), end - self.end, t, duration, vertical_share=1.0))

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Position (m) and velocity (m/s) at time t (s)."""
        position, velocity = self.parts[0].at(t)
        for part in self.parts[1:]:
            more, faster = part.at(t)
            position, velocity = position + more, velocity + faster
        return position, velocity

    def over(self, t: float) -> bool:
        """True if the reach and all its corrections have ended."""
        return all(part.over(t) for part in self.parts)


@dataclass(frozen=True)
class Turn:
    """Rotation of the hand during a reach: about one axis, with minimum jerk, from ``start`` to ``end``."""

    start: Rotation
    end: Rotation
    begin: float
    duration: float

    def at(self, t: float) -> tuple[Rotation, np.ndarray]:
        """Orientation and spin (rad/s, world axes) at time t (s)."""
        s, ds = min_jerk((t - self.begin) / self.duration)
        way = (self.end * self.start.inv()).as_rotvec()
        return Rotation.from_rotvec(s * way) * self.start, way * ds / self.duration


def duration_for(distance: float, base: float) -> float:
    """Duration (s) of a human reach: ``base`` (s) at 0.45 m, proportional to ``distance`` (m) to the power 0.3."""
    return base * max(0.3, (max(distance, 1e-3) / 0.45) ** 0.3)
