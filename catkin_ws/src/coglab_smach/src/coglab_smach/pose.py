"""Poses of rigid frames: a position (m) and a unit quaternion (x y z w), and the few operations machines need."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np


def normalised(quaternion: Sequence[float]) -> np.ndarray:
    """Unit quaternion (x y z w) of the same direction; ValueError if it has no direction or is not finite."""
    q = np.asarray(quaternion, dtype=float)
    if q.shape != (4,) or not np.all(np.isfinite(q)):
        raise ValueError(f"a quaternion has four finite numbers x y z w, got {list(quaternion)}")
    norm = float(np.linalg.norm(q))
    if norm < 1e-9:
        raise ValueError("a quaternion of zeros has no direction; write 0 0 0 1 for no rotation")
    return q / norm


def multiply(a: Sequence[float], b: Sequence[float]) -> np.ndarray:
    """Quaternion product a*b: the rotation b followed by a, in fixed axes."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return np.array([
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz])


def conjugate(q: Sequence[float]) -> np.ndarray:
    """Inverse rotation of a unit quaternion."""
    return np.array([-q[0], -q[1], -q[2], q[3]])


def rotate(q: Sequence[float], v: Sequence[float]) -> np.ndarray:
    """The vector v turned by the unit quaternion q."""
    u = np.asarray(q[:3], dtype=float)
    v = np.asarray(v, dtype=float)
    t = 2.0 * np.cross(u, v)
    return v + q[3] * t + np.cross(u, t)


def from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Quaternion of fixed-axis roll, pitch, yaw (rad), the convention of URDF."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array([sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                     cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy])


def from_matrix(m: np.ndarray) -> np.ndarray:
    """Quaternion of a 3x3 rotation matrix."""
    w = math.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    x = math.sqrt(max(0.0, 1 + m[0, 0] - m[1, 1] - m[2, 2])) / 2
    y = math.sqrt(max(0.0, 1 - m[0, 0] + m[1, 1] - m[2, 2])) / 2
    z = math.sqrt(max(0.0, 1 - m[0, 0] - m[1, 1] + m[2, 2])) / 2
    # Signs relative to the largest component, which is the well conditioned one.
    k = int(np.argmax([x, y, z, w]))
    if k == 3:
        x, y, z = (math.copysign(x, m[2, 1] - m[1, 2]), math.copysign(y, m[0, 2] - m[2, 0]),
                   math.copysign(z, m[1, 0] - m[0, 1]))
    elif k == 0:
        y, z, w = (math.copysign(y, m[0, 1] + m[1, 0]), math.copysign(z, m[0, 2] + m[2, 0]),
                   math.copysign(w, m[2, 1] - m[1, 2]))
    elif k == 1:
        x, z, w = (math.copysign(x, m[0, 1] + m[1, 0]), math.copysign(z, m[1, 2] + m[2, 1]),
                   math.copysign(w, m[0, 2] - m[2, 0]))
    else:
        x, y, w = (math.copysign(x, m[0, 2] + m[2, 0]), math.copysign(y, m[1, 2] + m[2, 1]),
                   math.copysign(w, m[1, 0] - m[0, 1]))
    return normalised([x, y, z, w])


def angle_between(a: Sequence[float], b: Sequence[float]) -> float:
    """Smallest rotation (rad, 0..pi) between two orientations."""
    d = abs(float(np.dot(normalised(a), normalised(b))))
    return 2.0 * math.acos(min(1.0, d))


@dataclass(frozen=True)
class Pose:
    """Pose of a frame in a parent frame: position (m) and unit quaternion (x y z w)."""

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    orientation: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))

    def __mul__(self, other: Pose) -> Pose:
        """Pose of a frame given in this frame, expressed in this frame's parent."""
        return Pose(self.position + rotate(self.orientation, other.position),
                    multiply(self.orientation, other.orientation))

    def inverse(self) -> Pose:
        """Pose of the parent in this frame."""
        q = conjugate(self.orientation)
        return Pose(-rotate(q, self.position), q)

    def to_dict(self) -> dict[str, list[float]]:
        """Plain lists, as user data and files hold it."""
        return {"xyz": [float(v) for v in self.position],
                "quaternion": [float(v) for v in self.orientation]}

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> Pose:
        """Read ``{xyz: [m], rpy_deg: [deg]}`` or ``{xyz: [m], quaternion: [x, y, z, w]}``; ValueError if malformed."""
        xyz = np.asarray(data.get("xyz", [0.0, 0.0, 0.0]), dtype=float)
        if xyz.shape != (3,) or not np.all(np.isfinite(xyz)):
            raise ValueError(f"xyz has three finite numbers in m, got {data.get('xyz')}")
        if "quaternion" in data:
            return Pose(xyz, normalised(data["quaternion"]))
        rpy = np.radians(np.asarray(data.get("rpy_deg", [0.0, 0.0, 0.0]), dtype=float))
        if rpy.shape != (3,) or not np.all(np.isfinite(rpy)):
            raise ValueError(f"rpy_deg has three finite numbers in degrees, got {data.get('rpy_deg')}")
        return Pose(xyz, from_rpy(*rpy))


def mean_pose(poses: Sequence[Pose]) -> Pose:
    """Average of poses that differ by noise: mean position, normalised mean quaternion (signs aligned)."""
    if not poses:
        raise ValueError("the mean of no poses is undefined")
    first = poses[0].orientation
    aligned = [p.orientation if float(np.dot(p.orientation, first)) >= 0 else -p.orientation for p in poses]
    return Pose(np.mean([p.position for p in poses], axis=0), normalised(np.mean(aligned, axis=0)))
