"""Learns a primitive from demonstrations, and its rotation and finger closing, stored in a file beside it.

Demonstrations are aligned by their onset and end: each counts from 0 to 1 of its own duration. (Warping one
onto another would move the peak of the speed.) The library's primitive is the path. The
robot turns its palm along its own curve to the goal's orientation; the demonstrated turn is kept beside the library,
with the largest difference between the two, and so is the closing of the fingers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import coglab_controllers as cc
import numpy as np
import yaml

from coglab_tools.command import CheckFailed, NotThere, UsageError
from coglab_tools.dmp.demonstration import Array, Demonstration
from coglab_tools.files import write_whole

SHARES = np.linspace(0.0, 1.0, 51)
"""shares of the duration at which demonstrations are compared and turn and fingers are kept"""
STRANGE = 3.0  # a demonstration is strange if it is this many times farther from the mean than the median one
CLOSED_ENOUGH = 0.05  # change of the fingers that counts as closing or opening


@dataclass(frozen=True)
class Taught:
    """Result of learning from demonstrations."""

    primitive: cc.Primitive
    demonstrations: tuple[Demonstration, ...]
    rmse: Array
    """m, (number of demonstrations,): error of the reproduction from each one's start to its goal"""
    turn: Array | None = None
    """mean rotation vector from the start, (51, 3) rad, axes of the recording's world; None: not recorded"""
    turn_error: float = 0.0
    """rad, largest difference between the demonstrated turn and the one that the robot makes to the same end"""
    closing: Array | None = None
    """mean closing of the fingers, (51,), 0 open .. 1 closed; None: not recorded"""
    strange: tuple[str, ...] = field(default=())
    """names of demonstrations that are far from the others"""

    def beside(self) -> dict[str, Any]:
        """Values for the file beside the library."""
        p = self.primitive
        entry: dict[str, Any] = {
            "learnt": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "from": [d.name for d in self.demonstrations],
            "notes": sorted({note for d in self.demonstrations for note in d.notes}),
            "duration_s": round(p.duration, 4),
            "rmse_mm": [round(1000.0 * float(e), 3) for e in self.rmse],
        }
        if self.turn is not None:
            entry["turn_rad"] = self.turn.round(4).tolist()
            entry["robot_turn_differs_deg"] = round(float(np.degrees(self.turn_error)), 2)
        if self.closing is not None:
            entry["closing"] = self.closing.round(3).tolist()
            entry["fingers"] = fingers_in_words(self.closing, p.duration)
        return entry


def train(
    id: str,
    demonstrations: Sequence[Demonstration],
    basis_count: int = 20,
    mapping: str = "similarity",
    description: str = "",
    allow: Sequence[str] = (),
) -> Taught:
    """Learn from reaches, each from rest to rest. UsageError, CheckFailed with a reason."""
    if not demonstrations:
        raise UsageError("expected at least one demonstration")
    try:
        primitive = cc.learn(
            id, [(d.times, d.positions) for d in demonstrations], basis_count, mapping=mapping, allow=allow
        )
        primitive.description = description
        primitive.validate()
    except ValueError as error:
        names = ", ".join(f"{i + 1}: {d.name}" for i, d in enumerate(demonstrations[:10]))
        raise CheckFailed(f"{error} ({names})") from None
    rmse = np.array([_rmse(primitive, d) for d in demonstrations])
    turns = [_turn(d) for d in demonstrations if d.orientations is not None]
    turn = np.mean(turns, axis=0) if turns else None
    closings = [np.interp(SHARES, d.times / d.duration, d.closing) for d in demonstrations if d.closing is not None]
    return Taught(
        primitive,
        tuple(demonstrations),
        rmse,
        turn,
        0.0 if turn is None else _turn_error(turn),
        np.mean(closings, axis=0) if closings else None,
        _strange(demonstrations),
    )


def course(primitive: cc.Primitive, start: Array, goal: Array, ratio: float, times: Array) -> Array:
    """Positions (n, 3) in m of a primitive from `start` to `goal` (3,) m at `times` (n,) in s."""
    dmp = cc.Dmp(primitive, start, goal, np.asarray(primitive.start_velocity), ratio)
    t, path, _ = dmp.roll_out(goal, float(times[-1]) + 0.01, 0.002)
    return np.column_stack([np.interp(times, t, column) for column in path.T])


def _rmse(primitive: cc.Primitive, d: Demonstration) -> float:
    path = course(primitive, d.positions[0], d.positions[-1], d.duration / primitive.duration, d.times)
    return float(np.sqrt(np.mean(np.sum((path - d.positions) ** 2, axis=1))))


def _turn(d: Demonstration) -> Array:
    """Rotation vectors (51, 3) from the start, without jumps beyond half a turn."""
    from scipy.spatial.transform import Rotation

    assert d.orientations is not None
    turns = Rotation.from_quat(d.orientations)
    steps = (turns[1:] * turns[:-1].inv()).as_rotvec()
    angle = float(np.linalg.norm(steps, axis=1).max(initial=0.0))
    if angle > 0.7:
        raise CheckFailed(f"{d.name}: the hand turns by {np.degrees(angle):.0f} deg between two samples; cut it there")
    vectors = (turns * turns[0].inv()).as_rotvec()
    return np.column_stack([np.interp(SHARES, d.times / d.duration, column) for column in vectors.T])


def _turn_error(turn: Array) -> float:
    from scipy.spatial.transform import Rotation

    end = Rotation.from_rotvec(turn[-1])
    curve = cc.OrientationCurve([0.0, 0.0, 0.0, 1.0], end.as_quat())
    robot = Rotation.from_quat([curve.at(float(s)) for s in SHARES])
    return float((Rotation.from_rotvec(turn) * robot.inv()).magnitude().max())


def _strange(demonstrations: Sequence[Demonstration]) -> tuple[str, ...]:
    """Names of those whose path, turned and scaled onto one line, is far from the mean of all."""
    if len(demonstrations) < 4:
        return ()
    paths = []
    for d in demonstrations:
        shares = d.times / d.duration
        at = np.column_stack([np.interp(SHARES, shares, column) for column in d.positions.T]) - d.positions[0]
        line = at[-1] / max(1e-6, float(np.linalg.norm(at[-1])) ** 2)
        along = at @ line
        across = np.linalg.norm(at - np.outer(along, at[-1]), axis=1) / max(1e-6, float(np.linalg.norm(at[-1])))
        paths.append(np.column_stack([along, across]))
    far = np.sqrt(np.mean((np.array(paths) - np.median(paths, axis=0)) ** 2, axis=(1, 2)))
    limit = max(STRANGE * float(np.median(far)), 0.03)
    return tuple(d.name for d, distance in zip(demonstrations, far, strict=True) if distance > limit)


def fingers_in_words(closing: Array, duration: float) -> str:
    """When the fingers close or open, relative to the end of the reach."""
    change = float(closing[-1] - closing[0])
    if abs(change) < CLOSED_ENOUGH:
        return f"the fingers stay at {closing[-1]:.2f}"
    share = (closing - closing[0]) / change
    begin, end = (float(SHARES[int(np.argmax(share >= s))]) for s in (0.05, 0.95))
    return (
        f"the fingers {'close' if change > 0 else 'open'} from {closing[0]:.2f} to {closing[-1]:.2f}, from "
        f"{(1 - begin) * duration:.2f} s to {(1 - end) * duration:.2f} s before the end"
    )


def beside(library: Path) -> Path:
    """The file beside a library: sources, turn and fingers of its primitives."""
    return library.with_suffix(".taught.yaml")


def load_beside(library: Path) -> dict[str, Any]:
    """Entries by primitive; empty without the file."""
    path = beside(library)
    if not path.is_file():
        return {}
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise CheckFailed(f"{path}: no YAML: {error}") from None
    if not isinstance(entries, dict):
        raise CheckFailed(f"{path}: expected primitives by name")
    return entries


def add_to_library(taught: Taught, library: Path, replace: bool = False) -> int:
    """Add the primitive to a library file, which is created if it is missing, and its entry to the file beside it.

    Returns the number of primitives in the library. UsageError if the name is taken, unless `replace`.
    """
    primitives = load_library(library) if library.exists() else cc.Library()
    name = taught.primitive.id
    if name in primitives and not replace:
        raise UsageError(f"{library} has a primitive '{name}' already; choose another --id, or --replace")
    try:
        primitives.add(taught.primitive)
    except ValueError as error:
        raise UsageError(str(error)) from None
    entries = {**load_beside(library), name: taught.beside()}
    write_whole(beside(library), yaml.safe_dump(entries, sort_keys=False, width=120, default_flow_style=None))
    write_whole(library, primitives.format())
    return len(primitives)


def load_library(path: Path) -> cc.Library:
    """Read a library file. NotThere: there is none. CheckFailed with file and line."""
    library = cc.Library()
    if not path.exists():
        raise NotThere(f"{path}: no such file; expected a library of primitives (.xml)")
    try:
        library.load(str(path))
    except cc.LibraryError as error:
        raise CheckFailed(str(error)) from None
    return library
