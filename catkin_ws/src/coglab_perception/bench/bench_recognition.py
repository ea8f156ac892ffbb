#!/usr/bin/python3
"""Recognition of reaches by the shipped patterns, on people that they were not trained on.

The people are drawn with the commit's hash as seed, so that nobody has tried them; the shipped patterns come from seed
2026 (test/make_sample_patterns.py). Each person has habits of their own (where the hand rests, where each reach ends,
tempo, arc), drawn anew for each; the tracker's error wanders instead of being white; one motion in five is no reach of
these patterns. Every motion counts, and reaches and other motions are counted apart as well. The peer is the nearest
direction seen so far.
"""

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from coglab_perception.recogniser import UNKNOWN, Recogniser, load_patterns
from coglab_py.packages import package_path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
sys.path.insert(0, str(package_path("coglab_smach", "bench")))
from synthetic_reaches import ENDS, START, path, share
from trial_file import commit_of_sources, whole_hash

PATTERNS = Path(__file__).resolve().parent.parent / "config" / "patterns.json"
PEOPLE, EACH, OTHERS = 60, 2, 2
"""people; reaches of each pattern and motions of no pattern by each: 20 % of all are of none"""
RATE, NOISE, CORRELATION = 30.0, 0.004, 0.3
"""Hz; m per axis; s over which the tracker's error wanders"""
REST, HOLD = 0.6, 0.4
SHARES = (0.2, 0.3, 0.4, 0.5, 0.7, 1.0)


@dataclass
class Person:
    """Habits: place where the hand rests and where each pattern ends (m), tempo, vertical share and arc (m)."""

    start: np.ndarray
    ends: dict[str, np.ndarray]
    tempo: float
    vertical_share: float
    bow: float


@dataclass
class Motion:
    """One recording: the pattern or UNKNOWN, stamps (s), positions (T, 3), onset and duration (s)."""

    pattern: str
    stamps: np.ndarray
    positions: np.ndarray
    onset: float
    duration: float


def seed() -> int:
    """Of the people: the hash of the commit of the sources; 1 outside of a checkout."""
    return int(whole_hash(commit_of_sources()) or "1", 16)


def person(rng: np.random.Generator) -> Person:
    """Somebody new."""
    return Person(
        start=START + rng.normal(0.0, 0.03, 3),
        ends={name: np.array(end) + rng.normal(0.0, 1.0, 3) * [0.03, 0.03, 0.03] for name, end in ENDS.items()},
        tempo=float(np.exp(rng.normal(0.0, 0.15))),
        vertical_share=float(rng.uniform(0.8, 0.95)),
        bow=float(rng.normal(0.0, 0.015)),
    )


def wandering(count: int, rng: np.random.Generator) -> np.ndarray:
    """The tracker's error (count, 3), m: a first-order process of standard deviation NOISE."""
    keep = np.exp(-1.0 / RATE / CORRELATION)
    errors = [rng.normal(0.0, NOISE, 3)]
    for _ in range(count - 1):
        errors.append(keep * errors[-1] + np.sqrt(1.0 - keep**2) * rng.normal(0.0, NOISE, 3))
    return np.array(errors)


def recording(pattern: str, who: Person, end: np.ndarray, rng: np.random.Generator, back: float = 0.0) -> Motion:
    """A motion of somebody to a place; `back`: share of the way that they return at once."""
    start = who.start + rng.normal(0.0, 0.01, 3)
    distance = float(np.linalg.norm(end - start))
    duration = 1.1 * max(0.3, (distance / 0.45) ** 0.3) * who.tempo * float(np.exp(rng.normal(0.0, 0.07)))
    stamps = np.arange(0.0, REST + duration + HOLD, 1.0 / RATE)
    positions = path(stamps, start, end, REST, duration, who.vertical_share, who.bow + rng.normal(0.0, 0.005))
    if back:
        positions -= back * np.outer(share((stamps - REST - 0.4 * duration) / duration), end - start)
    return Motion(pattern, stamps, positions + wandering(len(stamps), rng), REST, duration)


def other_motion(number: int, who: Person, rng: np.random.Generator) -> Motion:
    """Something that is no reach of these patterns: put down, aside, back, to the own face, half a reach and back."""
    ways = ([-0.10, 0.05, -0.35], [0.05, 0.55, 0.02], [0.35, 0.10, 0.05], [0.20, 0.0, 0.45], None)
    way = ways[number % len(ways)]
    if way is None:
        name = list(ENDS)[int(rng.integers(len(ENDS)))]
        return recording(UNKNOWN, who, who.start + 0.35 * (who.ends[name] - who.start), rng, back=1.0)
    return recording(UNKNOWN, who, who.start + np.array(way) + rng.normal(0.0, 0.04, 3), rng)


def motions(rng: np.random.Generator) -> list[Motion]:
    """All that all people do."""
    result = []
    for number in range(PEOPLE):
        who = person(rng)
        for name in ENDS:
            for _ in range(EACH):
                result.append(recording(name, who, who.ends[name] + rng.normal(0.0, 0.02, 3), rng))
        result += [other_motion(OTHERS * number + i, who, rng) for i in range(OTHERS)]
    return result


def nearest_direction(displacement: np.ndarray) -> str:
    """The peer: which end point lies nearest to the direction of the displacement so far."""
    d = displacement / max(1e-9, float(np.linalg.norm(displacement)))
    lines = {name: np.array(end) - START for name, end in ENDS.items()}
    return max(lines, key=lambda name: float(d @ lines[name] / np.linalg.norm(lines[name])))


@dataclass
class Judged:
    """What the recogniser made of one motion."""

    right: dict[float, bool]
    peer_right: dict[float, bool]
    wrong: bool
    decided: bool
    delay: float | None
    spent: float
    frames: int


def judge(motion: Motion, patterns: list, settings: object) -> Judged:
    """Runs a fresh recogniser over one motion."""
    recogniser = Recogniser(patterns, settings)
    judged = Judged({}, {}, False, False, None, 0.0, len(motion.stamps))
    pending = list(SHARES)
    for t, p in zip(motion.stamps, motion.positions, strict=True):
        begin = time.perf_counter()
        estimate = recogniser.update(float(t), p)
        judged.spent += time.perf_counter() - begin
        while pending and t >= motion.onset + pending[0] * motion.duration:
            at = pending.pop(0)
            judged.right[at] = estimate.pattern == motion.pattern
            judged.peer_right[at] = nearest_direction(p - motion.positions[0]) == motion.pattern
        if estimate.decided:
            judged.wrong |= estimate.pattern != motion.pattern
            judged.decided = True
            if judged.delay is None:
                judged.delay = (t - motion.onset) / motion.duration
    return judged


def row(figure, value, unit, goal="", ok=True, peer=None, peer_value=None):
    """One row of the bench table."""
    return {
        "bench": "recognition",
        "figure": figure,
        "value": round(float(value), 4),
        "unit": unit,
        "goal": goal or "reported",
        "peer": peer,
        "peer_value": peer_value if peer_value is None else round(float(peer_value), 4),
        "ok": bool(ok),
    }


def main() -> int:
    """Print the rows."""
    patterns, settings = load_patterns(str(PATTERNS))
    every = [(motion, judge(motion, patterns, settings)) for motion in motions(np.random.default_rng(seed()))]
    reaches = [judged for motion, judged in every if motion.pattern != UNKNOWN]
    others = [judged for motion, judged in every if motion.pattern == UNKNOWN]
    of = f"of {len(reaches)} reaches by {PEOPLE} new people"
    rows = []
    for at in SHARES:
        right = np.mean([j.right.get(at, False) for j in reaches])
        peer = np.mean([j.peer_right.get(at, False) for j in reaches])
        goal = ">= 0.95" if at == 0.4 else ""
        figure = f"pattern right after {at:.0%} of the way's time, {of}"
        rows.append(row(figure, right, "share", goal, not goal or right >= 0.95, "nearest direction", peer))
    wrong = np.mean([judged.wrong for _, judged in every])
    mixed = f"of {len(every)} motions, {len(others)} of them of no pattern"
    rows.append(row(f"a wrong pattern decided at any time, {mixed}", wrong, "share", "<= 0.01", wrong <= 0.01))
    rows.append(row(f"a wrong pattern decided at any time, {of}", np.mean([j.wrong for j in reaches]), "share"))
    rows.append(
        row(
            f"a wrong pattern decided at any time, of the {len(others)} motions of no pattern",
            np.mean([j.wrong for j in others]),
            "share",
        )
    )
    rows.append(row(f"a pattern decided, {of}", np.mean([j.decided for j in reaches]), "share"))
    delays = [np.inf if j.delay is None else j.delay for j in reaches]
    rows.append(row(f"decided after, median, {of}; undecided: never", np.median(delays), "share of the time"))
    per_frame = sum(j.spent for _, j in every) / sum(j.frames for _, j in every)
    rows.append(row(f"time per frame, four models, mean, {mixed}", per_frame * 1e6, "us", "<= 5000", per_frame <= 5e-3))
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
