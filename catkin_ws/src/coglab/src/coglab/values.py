"""Checks of the arguments of this package. Each ValueError has the expected and the actual value."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

import numpy as np
from coglab_py.pose import Pose, rotation
from scipy.spatial.transform import Rotation


def finite(value: Any, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Array of floats of this shape. ValueError: another shape, NaN, infinite, or no numbers."""
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: numbers of shape {shape} are expected, got {value!r}") from None
    if array.shape != shape:
        raise ValueError(f"{name}: shape {shape} is expected, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name}: finite numbers are expected, got {array.tolist()}")
    return array


def has_shape(value: Any, shape: tuple[int, ...]) -> bool:
    """True if the value is made of numbers in this shape."""
    try:
        return bool(np.shape(value) == shape)
    except ValueError:  # of rows of different lengths
        return False


def joints_of(value: Any, name: str) -> np.ndarray:
    """Seven joint positions, rad."""
    return finite(value, name, (7,))


def number(value: Any, name: str, unit: str, above: float) -> float:
    """A finite number larger than ``above``."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise ValueError(f"{name}: a finite number ({unit}) is expected, got {value!r}")
    if not value > above:
        raise ValueError(f"{name}: more than {above:g} ({unit}) is expected, got {value!r}")
    return float(value)


def whole(value: Any, name: str) -> int:
    """A whole number of Python or of numpy, 0 or more, that a float64 holds exactly."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value < 2**53:
        raise ValueError(f"{name}: a whole number 0 or more and below 2**53 is expected, got {value!r}")
    return int(value)


def path_of(value: Any, name: str) -> str:
    """The path of a file as text; empty for none."""
    if not isinstance(value, str | PathLike):
        raise ValueError(f"{name}: the path of a file is expected, got {value!r}")
    return str(value)


def pose_of(value: Any, name: str) -> Pose:
    """A Pose from a Pose, from (position [3] m, quaternion [4] x y z w), from these 7 numbers, or from a 4 x 4
    matrix."""
    if isinstance(value, Pose):
        position, orientation = value.position, value.orientation
    elif has_shape(value, (4, 4)):
        matrix = finite(value, name, (4, 4))
        turn = matrix[:3, :3]
        if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-6 or np.linalg.det(turn) < 0.0:
            raise ValueError(f"{name}: the upper left 3 x 3 of the matrix is no rotation")
        return Pose(matrix[:3, 3], Rotation.from_matrix(turn).as_quat())
    elif has_shape(value, (7,)):
        position, orientation = value[:3], value[3:]
    elif isinstance(value, tuple | list) and len(value) == 2:
        position, orientation = value
    else:
        raise ValueError(
            f"{name}: a coglab.Pose, (position [3], quaternion [4]), 7 numbers or a 4 x 4 matrix is expected, "
            f"got {value!r}"
        )
    where = finite(position, f"{name} position", (3,))
    quaternion = finite(orientation, f"{name} quaternion", (4,))
    try:
        return Pose(where, rotation(quaternion).as_quat())
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
