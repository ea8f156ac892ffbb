"""Learns the robot's primitives and the recogniser's patterns from recorded handovers between people.

The robot takes like the recorded taker, and gives like the recorded giver. Patterns are of the person's reaches: each
recorded reach is mapped to drawn ends near the pattern's place, because one recording shows the motion of a hand, but
not all places of handovers. Both files name their sources.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import coglab_controllers as cc
import numpy as np
from coglab_perception.recogniser import RecogniserSettings, save_patterns, train_patterns

from coglab_tools.command import CheckFailed
from coglab_tools.dmp.demonstration import Array, Demonstration
from coglab_tools.dmp.train import load_library, train
from coglab_tools.files import write_whole
from coglab_tools.people.handover import Handover

PLACES = {
    "centre": (0.86, 0.03, 0.44),
    "high": (0.86, 0.05, 0.66),
    "left": (0.90, -0.28, 0.42),
    "right": (0.92, 0.42, 0.40),
}
"""m, base frame: end of a person's reach for each pattern"""
REST = np.array([1.30, 0.20, 0.15])  # m, its start
REST_SCATTER = 0.02  # m, standard deviation of REST on each axis
PLACE_SCATTER = np.array([0.03, 0.035, 0.03])  # m, standard deviation of an end in PLACES on each axis
TIME_SCATTER = 0.15  # standard deviation of the logarithm of the duration
RATE = 30.0  # Hz, of the tracker
NOISE = 0.004  # m, standard deviation of the tracker on each axis
HOLD = 0.4  # s at rest after a reach
BEFORE = 0.6  # s at rest before a reach
PER_PATTERN = 40  # reaches drawn for each pattern
SEED = 2026  # of the random numbers

PRIMITIVES = {
    "reach_human": ("taker", "similarity", False, "Reach to a person's hand, to take an object"),
    "reach_human_high": ("taker", "upright", False, "Reach to an object held high"),
    "reach_human_left": ("taker", "upright", False, "Reach to the robot's right, the person's left"),
    "reach_human_right": ("taker", "upright", True, "Reach to the robot's left, the person's right"),
    "give_human": ("giver", "similarity", False, "Reach to a person's hand, to give an object"),
}
"""role that was recorded, mapping of the shape, whether left and right are exchanged, and words for people"""


def learn_primitives(handovers: Sequence[Handover], others: cc.Library | None = None, basis: int = 20) -> cc.Library:
    """A library with those primitives above whose role was recorded, and those of `others` that have other names."""
    library = cc.Library()
    if others is not None:
        for name in others.ids():
            library.add(others[name])
    for name in learnable(handovers):
        role, mapping, mirrored, words = PRIMITIVES[name]
        reaches = [h.reach(role) for h in handovers if role in h.hands]
        reaches = [_mirrored(r) if mirrored else r for r in reaches]
        source = f"{words}; learnt from {len(reaches)} recorded {role}{'s' if len(reaches) > 1 else ''}"
        where = sorted({h.source for h in handovers})
        description = f"{source}{', left and right exchanged' if mirrored else ''}: {'; '.join(where)}"
        library.add(train(name, reaches, basis, mapping, description[:500]).primitive)
    return library


def learnable(handovers: Sequence[Handover]) -> list[str]:
    """Names of the primitives above whose role was recorded."""
    return [name for name, (role, *_) in PRIMITIVES.items() if any(role in h.hands for h in handovers)]


def _mirrored(reach: Demonstration) -> Demonstration:
    """The reach with the sides of its way exchanged: reflected in the upright plane through start and end."""
    line = reach.positions[-1] - reach.positions[0]
    side = np.array([-line[1], line[0], 0.0])
    side /= max(1e-9, float(np.linalg.norm(side)))
    away = (reach.positions - reach.positions[0]) @ side
    return Demonstration(reach.name, reach.times, reach.positions - 2.0 * np.outer(away, side), notes=reach.notes)


def mapped_reach(reach: Demonstration, start: Array, end: Array, stretch: float) -> tuple[Array, Array]:
    """Times (n,) s and positions (n, 3) m of a recorded reach from another start to another end (3,) m.

    The path is rotated about the vertical and stretched horizontally and vertically; deviations from the straight line
    are scaled with its length. `stretch`: factor on the duration.
    """
    share = reach.times / reach.duration
    was = reach.positions[-1] - reach.positions[0]
    relative = reach.positions - reach.positions[0]
    forward, upward = _progress(relative[:, :2] @ was[:2], was[:2] @ was[:2], share), _rise(relative[:, 2], was[2])
    now = end - start
    side_was = np.array([-was[1], was[0]]) / max(1e-9, float(np.linalg.norm(was[:2])))
    side_now = np.array([-now[1], now[0]]) / max(1e-9, float(np.linalg.norm(now[:2])))
    aside = (relative[:, :2] @ side_was) * np.linalg.norm(now) / np.linalg.norm(was)
    flat = np.outer(forward, now[:2]) + np.outer(aside, side_now)
    return stretch * reach.times, start + np.column_stack([flat, upward * now[2]])


def _progress(along: Array, length: float, share: Array) -> Array:
    return along / length if length > 1e-4 else share


def _rise(height: Array, whole: float) -> Array:
    """Share of the vertical way; of a level reach, as large as it deviates from its line."""
    return height / whole if abs(whole) > 0.02 else height / 0.2


def sightings(reach: Demonstration, place: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """Stamps (n,) and positions (n, 3) of one reach of a pattern, as a tracker sees it, at rest before and after."""
    start = REST + rng.normal(0.0, REST_SCATTER, 3)
    end = np.array(PLACES[place]) + rng.normal(0.0, 1.0, 3) * PLACE_SCATTER
    times, path = mapped_reach(reach, start, end, float(np.exp(rng.normal(0.0, TIME_SCATTER))))
    stamps = np.arange(0.0, BEFORE + times[-1] + HOLD, 1.0 / RATE)
    seen = np.column_stack([np.interp(stamps - BEFORE, times, column) for column in path.T])
    return stamps, seen + rng.normal(0.0, NOISE, seen.shape)


def recorded_demonstrations(
    reaches: Sequence[Demonstration], count: int = PER_PATTERN, seed: int = SEED
) -> dict[str, list[tuple[Array, Array]]]:
    """`count` sightings of each pattern, taking the recorded reaches in turn."""
    rng = np.random.default_rng(seed)
    return {name: [sightings(reaches[i % len(reaches)], name, rng) for i in range(count)] for name in PLACES}


def learn_patterns(handovers: Sequence[Handover], path: Path) -> dict[str, int]:
    """Train patterns of the recorded givers' and takers' reaches and write them. Returns recordings by pattern.

    The file names its sources.
    """
    reaches = [h.reach(role) for h in handovers for role in h.hands]
    demonstrations = recorded_demonstrations(reaches)
    source = (
        f"{len(reaches)} recorded reaches of people ({'; '.join(sorted({h.source for h in handovers}))}), mapped to "
        f"{PER_PATTERN} drawn ends per pattern, seed {SEED}, {1000 * NOISE:.0f} mm noise at {RATE:.0f} Hz"
    )
    try:
        patterns = train_patterns(demonstrations)
    except ValueError as error:
        raise CheckFailed(str(error)) from None
    half = path.with_name(f".{path.name}.part")
    try:
        save_patterns(str(half), patterns, RecogniserSettings(), source)
        write_whole(path, json.dumps(json.loads(half.read_text(encoding="utf-8")), indent=1) + "\n")
    except OSError as error:
        raise CheckFailed(f"{path} cannot be written: {error.strerror}; the earlier file is kept") from None
    finally:
        with suppress(OSError):
            half.unlink(missing_ok=True)
    return {name: len(each) for name, each in demonstrations.items()}


def base_library() -> cc.Library:
    """The shipped drawn primitives."""
    from coglab_py.packages import package_path

    return load_library(package_path("coglab_controllers", "config", "primitives.xml"))
