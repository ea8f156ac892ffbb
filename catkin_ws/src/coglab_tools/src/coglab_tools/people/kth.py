"""Reads one handover of the KTH handovers dataset (Khanna et al. 2023, arXiv 2304.02154; MIT licence).

A folder has 30 CSV files of one length at 120 Hz: poses x,y,z,q0..q3 in m (the quaternion is x y z w: the forearm's
frame then carries the hand along one axis) of 13 frames each of giver and taker and of the baton, and the wrenches of
both grips. z is up. The tracker repeats lost samples; they are left out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coglab_tools.command import CheckFailed, NotThere
from coglab_tools.dmp.demonstration import Array, Demonstration
from coglab_tools.people.handover import Handover

RATE = 120.0  # Hz
GRIP = 1.0  # N above the hand's rest that count as a grip
SOURCE = "KTH-RPL/handovers_dataset (Khanna et al. 2023, arXiv 2304.02154, MIT licence)"
FARTHEST = 5.0  # m that a hand, a chest or the baton moves in a handover


def is_kth(folder: Path) -> bool:
    """Returns whether this is a folder of one handover."""
    return folder.is_dir() and any(folder.glob("giver_*_pose_saved.csv"))


def read_kth(folder: Path) -> Handover:
    """Read a folder. NotThere, CheckFailed with the file that is missing or wrong."""
    if not folder.is_dir():
        raise NotThere(f"{folder}: no such folder; expected one handover of the KTH dataset")
    hands, notes = {}, []
    for role in ("giver", "taker"):
        sides = {side: _pose(folder, f"{role}_{side}Hand") for side in "RL"}
        far = {side: float(np.linalg.norm(np.ptp(track.positions, axis=0))) for side, track in sides.items()}
        side = max(far, key=lambda s: far[s])
        hands[role] = sides[side]
        hand = f"the {role} uses the {'right' if side == 'R' else 'left'} hand"
        notes.append(f"{hand} ({'; '.join(sides[side].notes)})" if sides[side].notes else hand)
    baton = _pose(folder, "baton")
    toward = _pose(folder, "giver_chest").positions.mean(axis=0) - _pose(folder, "taker_chest").positions.mean(axis=0)
    toward[2] = 0.0
    touch = _touch(folder)
    if touch is not None:
        notes.append(f"both hold the baton from {touch:.2f} s on")
    else:
        notes.append("without the forces on the baton the touch is unknown: the longest way there is taken")
    return Handover(folder.name, hands, baton, toward / np.linalg.norm(toward), touch, SOURCE, tuple(notes))


def _pose(folder: Path, name: str) -> Demonstration:
    rows = _table(folder / f"{name}_pose_saved.csv", 7)
    finite = np.isfinite(rows).all(axis=1)
    kept = np.append(True, np.any(np.diff(rows[:, :3], axis=0) != 0.0, axis=1)) & finite
    if kept.sum() < 0.5 * len(rows):
        kept = finite  # it stands still
    extent = float(np.linalg.norm(np.ptp(rows[finite, :3], axis=0))) if finite.any() else 0.0
    if extent > FARTHEST:
        raise CheckFailed(
            f"{folder / name}_pose_saved.csv: it moves over {extent:.4g}; expected at most {FARTHEST:g} m: is it in mm?"
        )
    lengths = np.linalg.norm(rows[:, 3:], axis=1)
    if np.any(np.abs(lengths[kept] - 1.0) > 0.05):
        raise CheckFailed(
            f"{folder / name}_pose_saved.csv: a quaternion of length {lengths[kept].min():.2f}, expected 1"
        )
    if kept.sum() < 60:
        raise CheckFailed(f"{folder / name}_pose_saved.csv: {int(kept.sum())} samples, expected at least 60 (0.5 s)")
    q = rows[:, 3:] / lengths[:, None]
    q = q[kept]
    q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
    wrong = len(rows) - int(finite.sum())
    notes = tuple(
        f"{count} of {len(rows)} samples {what} and were left out"
        for count, what in ((wrong, "are not finite"), (len(rows) - wrong - len(q), "repeat the one before"))
        if count
    )
    return Demonstration(name, np.arange(len(rows))[kept] / RATE, rows[kept, :3], q, notes=notes)


def _table(path: Path, columns: int) -> Array:
    if not path.is_file():
        raise NotThere(f"{path}: no such file; a handover of the KTH dataset has 30 CSV files")
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines()[1:], 2):
        try:
            rows.append([float(word) for word in line.split(",")])
        except ValueError:
            raise CheckFailed(f"{path}:{number}: expected {columns} numbers, got {ascii(line)[:80]}") from None
        if len(rows[-1]) != columns:
            raise CheckFailed(f"{path}:{number}: expected {columns} columns, got {len(rows[-1])}")
    if not rows:
        raise CheckFailed(f"{path}: no samples in it; expected a header and lines of {columns} numbers")
    return np.array(rows)


def _touch(folder: Path) -> float | None:
    """s, first time at which both grip the baton; None without forces."""
    forces = {}
    for role in ("giver", "taker"):
        path = folder / f"Wrench_{role}_saved.csv"
        if not path.is_file():
            return None
        force = np.linalg.norm(_table(path, 6)[:, :3], axis=1)
        forces[role] = force - np.percentile(force, 10)
    both = (forces["giver"] > GRIP) & (forces["taker"] > GRIP)
    return float(np.argmax(both)) / RATE if both.any() else None
