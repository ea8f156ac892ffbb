"""Check of the values that a topic publishes about the cell."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from coglab_py.pose import Pose

LARGEST = 1e4  # m, N: largest plausible value
IMPLAUSIBLE = f"a number is not finite or beyond {LARGEST:g}, or an orientation has no direction"


def plausible(poses: Iterable[Pose], numbers: Iterable[float] = ()) -> bool:
    """True if all numbers are finite and below LARGEST, and no quaternion is zero."""
    poses = list(poses)
    values = [*numbers, *(value for pose in poses for value in (*pose.position, *pose.orientation))]
    if not np.all(np.abs(values) < LARGEST):  # also rejects NaN and infinity
        return False
    return all(np.linalg.norm(pose.orientation) > 1e-6 for pose in poses)
