"""One demonstrated motion, and its file.

A demonstration file is a CSV that `recording:=` can play: a header `t,x,y,z[,qx,qy,qz,qw][,closing]`, then one line
per sample. t in s, x y z in m, quaternion of length 1, closing of the fingers 0 (open) .. 1 (closed).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from coglab_tools.files import write_whole

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Demonstration:
    """Samples of a hand or a palm in one frame, and notes about them."""

    name: str
    times: Array
    """s, (n,), increasing"""
    positions: Array
    """m, (n, 3)"""
    orientations: Array | None = None
    """quaternions x y z w, (n, 4); None: not recorded"""
    closing: Array | None = None
    """closing of the fingers, (n,), 0 open .. 1 closed; None: not recorded"""
    notes: tuple[str, ...] = ()
    """sentences on units, gaps, repeated samples and the cut"""
    begin: float = 0.0
    """s, time in the recording at time 0 of this part"""
    noise: float = 0.0
    """m, standard deviation per axis of the noise removed by smoothing"""

    @property
    def duration(self) -> float:
        """s"""
        return float(self.times[-1] - self.times[0])

    @property
    def way(self) -> float:
        """m, distance from the first sample to the farthest one."""
        return float(np.linalg.norm(self.positions - self.positions[0], axis=1).max())

    @property
    def speed(self) -> Array:
        """m/s, (n,)"""
        return np.asarray(np.linalg.norm(np.gradient(self.positions, self.times, axis=0), axis=1), dtype=float)

    def save(self, path: Path) -> Path:
        """Write the demonstration file. It is written completely or not at all. Returns its path."""
        columns, header = [self.times - self.times[0], *self.positions.T], "t,x,y,z"
        if self.orientations is not None:
            columns, header = [*columns, *self.orientations.T], header + ",qx,qy,qz,qw"
        if self.closing is not None:
            columns, header = [*columns, self.closing], header + ",closing"
        lines = [header, *(",".join(f"{value:.9g}" for value in row) for row in np.column_stack(columns))]
        return write_whole(path, "\n".join(lines) + "\n")


def for_shell(path: Path) -> str:
    """The absolute path, for a launch argument."""
    return str(path) if path.is_absolute() else f"$PWD/{path}"
