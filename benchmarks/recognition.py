#!/usr/bin/python3
"""Recognition of a person's motion by the shipped patterns, on people who are not in the training data.

Reaches alone: 60 newly drawn people with their own habits (rest, ends, tempo, arc); the tracker's error varies slowly;
one motion in five is not a reach of a pattern. The peer chooses the nearest direction so far. Whole trials: drawn
people and the default tracker; the true pattern of a reach follows from its displacement; reaches of no pattern are
left out. Right: the most likely pattern is the true one after 40 % of the reach's time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from coglab_perception.recogniser import UNKNOWN, Recogniser, load_patterns
from coglab_py.packages import package_path
from coglab_trials import Conditions
from common import Row, in_parallel, main, share, shared_module
from trial_watch import OBJECTS, Job, Watch, onset, run_trial

PATTERNS = str(package_path("coglab_perception", "config", "patterns.json"))
AT = 0.4  # share of the time
RATE = 30.0  # Hz, of the tracker
NOISE = 0.004  # m, standard deviation of the tracker on each axis
CORRELATION = 0.3  # s, correlation time of the tracker's error
REST = 0.6  # s at rest before a motion
HOLD = 0.4  # s at rest after a motion
FIRST_SEED = 200_000


class Person:
    """Habits: rest of the hand, end of each pattern, tempo, arc."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.shapes = shared_module("synthetic_reaches")
        self.rng = rng
        self.start = self.shapes.START + rng.normal(0.0, 0.03, 3)
        self.ends = {name: np.array(end) + rng.normal(0.0, 0.03, 3) for name, end in self.shapes.ENDS.items()}
        self.tempo = float(np.exp(rng.normal(0.0, 0.15)))
        self.vertical_share = float(rng.uniform(0.8, 0.95))
        self.bow = float(rng.normal(0.0, 0.015))

    def motion(self, pattern: str, end: np.ndarray, back: float = 0.0) -> tuple[str, np.ndarray, np.ndarray, float]:
        """Pattern, stamps (s), positions (T, 3), duration (s); `back`: share of the way that the hand returns."""
        rng, shapes = self.rng, self.shapes
        start = self.start + rng.normal(0.0, 0.01, 3)
        way = max(0.3, (float(np.linalg.norm(end - start)) / 0.45) ** 0.3)
        duration = 1.1 * way * self.tempo * float(np.exp(rng.normal(0.0, 0.07)))
        stamps = np.arange(0.0, REST + duration + HOLD, 1.0 / RATE)
        bow = self.bow + rng.normal(0.0, 0.005)
        positions = shapes.path(stamps, start, end, REST, duration, self.vertical_share, bow)
        if back:
            positions -= back * np.outer(shapes.share((stamps - REST - 0.4 * duration) / duration), end - start)
        keep, errors = np.exp(-1.0 / RATE / CORRELATION), [rng.normal(0.0, NOISE, 3)]
        for _ in stamps[1:]:
            errors.append(keep * errors[-1] + np.sqrt(1.0 - keep**2) * rng.normal(0.0, NOISE, 3))
        return pattern, stamps, positions + np.array(errors), duration

    def motions(self, number: int) -> Iterator[tuple[str, np.ndarray, np.ndarray, float]]:
        """Two reaches of each pattern, and two motions of none: down, aside, back, to the face, half a reach."""
        for name, end in self.ends.items():
            for _ in range(2):
                yield self.motion(name, end + self.rng.normal(0.0, 0.02, 3))
        ways = ([-0.10, 0.05, -0.35], [0.05, 0.55, 0.02], [0.35, 0.10, 0.05], [0.20, 0.0, 0.45], None)
        for i in range(2):
            way = ways[(2 * number + i) % len(ways)]
            if way is None:
                end = self.ends[list(self.ends)[int(self.rng.integers(len(self.ends)))]]
                yield self.motion(UNKNOWN, self.start + 0.35 * (end - self.start), back=1.0)
            else:
                yield self.motion(UNKNOWN, self.start + np.array(way) + self.rng.normal(0.0, 0.04, 3))


def nearest_direction(displacement: np.ndarray) -> str:
    """The peer: name of the pattern whose direction is nearest to a displacement (m)."""
    shapes = shared_module("synthetic_reaches")
    lines = {name: np.array(end) - shapes.START for name, end in shapes.ENDS.items()}
    return max(lines, key=lambda name: float(displacement @ lines[name] / np.linalg.norm(lines[name])))


def alone(quick: bool) -> Iterator[Row]:
    """Reaches without a robot."""
    patterns, rng = load_patterns(PATTERNS), np.random.default_rng(FIRST_SEED)
    right, peer, wrong = [], [], []
    for number in range(4 if quick else 60):
        for pattern, stamps, positions, duration in Person(rng).motions(number):
            recogniser, decided, asked = Recogniser(*patterns), set(), False
            for t, place in zip(stamps, positions, strict=True):
                estimate = recogniser.update(float(t), place)
                if estimate.decided:
                    decided.add(estimate.pattern)
                if not asked and t >= REST + AT * duration and pattern != UNKNOWN:
                    right.append(estimate.pattern == pattern)
                    peer.append(nearest_direction(place - positions[0]) == pattern)
                    asked = True
            wrong.append(bool(decided - {pattern}))
    against = f"> nearest-direction {100 * np.mean(peer):.3g}"
    yield share(f"right motion pattern after {AT:.0%} of the way", right, against)
    yield share("a wrong pattern at any time", wrong, "<= 1")


class Recognised(Watch):
    """Records the recognised patterns while the person reaches."""

    def __init__(self, trial: Any) -> None:
        super().__init__(trial)
        self.reaches: list[
            list[tuple[float, np.ndarray, str]]
        ] = []  # per reach: own speed, position, most likely pattern
        self._was_reaching = False

    def look(self, trial: Any) -> None:
        """After each period of the world."""
        super().look(trial)
        if self.sample is None:
            return
        reaching = self.sample.phase in ("reaching", "hesitating")
        if reaching and not self._was_reaching:
            self.reaches.append([])
        if reaching:
            place = np.array(self.world.cell.truth()["human_hand"]["position"])
            speed = float(np.linalg.norm(self.sample.velocity))
            self.reaches[-1].append((speed, place, trial.recogniser.estimate.pattern))
        self._was_reaching = reaching

    def figures(self) -> dict[str, Any]:
        """`right`: for each reach of a known pattern, True if this pattern was the most likely one."""
        right = []
        for reach in self.reaches:
            true = shared_module("synthetic_reaches").pattern_of(reach[-1][1] - reach[0][1])
            if true:
                first = onset(np.array([speed for speed, *_ in reach])) or 0
                right.append(reach[first + int(AT * (len(reach) - 1 - first))][2] == true)
        return {"right": right}


def recognised_trial(job: Job) -> dict[str, Any]:
    """Both directions of one person."""
    return run_trial(job, Recognised)


def in_trials(quick: bool) -> Iterator[Row]:
    """Whole handovers."""
    count = 4 if quick else 100
    jobs = [Job(FIRST_SEED + i, Conditions(object_id=OBJECTS[i % len(OBJECTS)])) for i in range(count)]
    right = [one for trial in in_parallel(recognised_trial, jobs) for one in trial["right"]]
    yield share(f"right motion pattern after {AT:.0%} of the way, in whole trials", right, ">= 95")


if __name__ == "__main__":
    main("recognition", alone, in_trials)
