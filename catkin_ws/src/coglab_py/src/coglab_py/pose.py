"""Poses of rigid frames: a position (m) and a unit quaternion (x y z w)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.spatial.transform
from numpy.typing import ArrayLike

from coglab_py.rotation import Rotation

IDENTITY = (0.0, 0.0, 0.0, 1.0)  # quaternion without rotation


def length(vector: np.ndarray) -> float:
    """Euclidean length of a vector, bit-identical to numpy.linalg.norm but faster."""
    return math.sqrt(vector.dot(vector))


def rotation(quaternion: ArrayLike) -> Rotation:
    """Rotation from a quaternion (x y z w) of any length. Raises ValueError if it is zero or not finite."""
    q = np.asarray(quaternion, dtype=float)
    if q.shape != (4,) or not np.all(np.isfinite(q)):
        raise ValueError(f"a quaternion has four finite numbers x y z w, got {quaternion!r}")
    if length(q) < 1e-9:
        raise ValueError("a quaternion of zeros has no direction; write 0 0 0 1 for no rotation")
    return Rotation.from_quat(q)


def about_z(angle: float) -> np.ndarray:
    """Quaternion of a rotation about the vertical axis by `angle` (rad)."""
    return Rotation.from_rotvec([0.0, 0.0, angle]).as_quat()


@dataclass(frozen=True)
class Pose:
    """Pose of a frame in a parent frame: position (m) and unit quaternion (x y z w)."""

    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    orientation: np.ndarray = field(default_factory=lambda: np.array(IDENTITY))

    @property
    def rotation(self) -> Rotation:
        """The orientation as a Rotation of this package; ``scipy.spatial.transform.Rotation.from_quat(orientation)`` is
        the same for scipy."""
        return Rotation.from_quat(self.orientation)

    def __mul__(self, other: Pose) -> Pose:
        """`other` is the pose of a frame in this frame. Returns its pose in the parent of this frame."""
        turn = self.rotation
        return Pose(self.position + turn.apply(other.position), (turn * other.rotation).as_quat())

    def inverse(self) -> Pose:
        """Pose of the parent in this frame."""
        back = self.rotation.inv()
        return Pose(-back.apply(self.position), back.as_quat())

    def apply(self, point: ArrayLike) -> np.ndarray:
        """Coordinates in the parent frame of a point given in this frame (m)."""
        placed: np.ndarray = self.position + self.rotation.apply(point)
        return placed

    def axis(self, i: int) -> np.ndarray:
        """Unit vector of axis i (0 x, 1 y, 2 z) in the parent frame."""
        return self.rotation.as_matrix()[:, i]

    def distance(self, other: Pose) -> tuple[float, float]:
        """Distance (m) and angle (rad) between this pose and another one in the same parent."""
        angle = (self.rotation.inv() * other.rotation).magnitude()
        return length(self.position - other.position), angle

    def to_dict(self) -> dict[str, list[float]]:
        """The pose as plain lists, for user data and files."""
        return {"xyz": [float(v) for v in self.position], "quaternion": [float(v) for v in self.orientation]}

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> Pose:
        """Pose from ``{xyz: [m], rpy_deg: [deg]}`` or ``{xyz: [m], quaternion: [x, y, z, w]}``. Roll, pitch and yaw are
        about fixed axes, as in URDF. Raises ValueError if malformed."""
        xyz = np.asarray(data.get("xyz", [0.0, 0.0, 0.0]), dtype=float)
        if xyz.shape != (3,) or not np.all(np.isfinite(xyz)):
            raise ValueError(f"xyz has three finite numbers in m, got {data.get('xyz')}")
        if "quaternion" in data:
            return Pose(xyz, rotation(data["quaternion"]).as_quat())
        rpy = np.asarray(data.get("rpy_deg", [0.0, 0.0, 0.0]), dtype=float)
        if rpy.shape != (3,) or not np.all(np.isfinite(rpy)):
            raise ValueError(f"rpy_deg has three finite numbers in degrees, got {data.get('rpy_deg')}")
        return Pose(xyz, scipy.spatial.transform.Rotation.from_euler("xyz", rpy, degrees=True).as_quat())


def mean_pose(poses: Sequence[Pose]) -> Pose:
    """Mean position and mean rotation of poses, to reduce noise."""
    if not poses:
        raise ValueError("the mean of no poses is undefined")
    turned = scipy.spatial.transform.Rotation.from_quat(np.array([pose.orientation for pose in poses])).mean()
    return Pose(np.mean([pose.position for pose in poses], axis=0), turned.as_quat())
