"""Positions and quaternions (x y z w) for the simulated person and tracker: plain numpy, nothing more than
they need."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

IDENTITY = (0.0, 0.0, 0.0, 1.0)


def quat_multiply(a: Sequence[float], b: Sequence[float]) -> np.ndarray:
    """Rotation b followed by a, in fixed axes."""
    av, bv = np.asarray(a[:3], dtype=float), np.asarray(b[:3], dtype=float)
    v = a[3] * bv + b[3] * av + np.cross(av, bv)
    return np.array([*v, a[3] * b[3] - float(av @ bv)])


def quat_rotate(q: Sequence[float], v: Sequence[float]) -> np.ndarray:
    """Vector v turned by q."""
    u = np.asarray(q[:3], dtype=float)
    t = 2.0 * np.cross(u, np.asarray(v, dtype=float))
    return np.asarray(v, dtype=float) + q[3] * t + np.cross(u, t)


def quat_from_rotvec(w: Sequence[float]) -> np.ndarray:
    """Quaternion of a rotation vector (rad)."""
    angle = float(np.linalg.norm(w))
    if angle < 1e-12:
        return np.array([0.5 * w[0], 0.5 * w[1], 0.5 * w[2], 1.0])
    return np.array([*(math.sin(angle / 2) / angle * np.asarray(w, dtype=float)), math.cos(angle / 2)])


@dataclass(frozen=True)
class Frame:
    """Pose of a frame in world: position (m), unit quaternion (x y z w)."""

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    orientation: np.ndarray = field(default_factory=lambda: np.array(IDENTITY))

    def axis(self, i: int) -> np.ndarray:
        """Unit vector of axis i (0 x, 1 y, 2 z) in world."""
        return quat_rotate(self.orientation, np.eye(3)[i])

    def apply(self, point: Sequence[float]) -> np.ndarray:
        """World position of a point given in this frame."""
        return self.position + quat_rotate(self.orientation, point)
