"""Hand motions that are neither offer nor request, for tests and bench: scratching, pointing, reaching aside.

Kinematics: minimum jerk (Flash and Hogan 1985) with durations that grow with the way to the power 0.3 and scatter by a
fifth between motions, as reaches of people do (1.09-1.33 s over 0.43 m in a recorded handover); scratching at 2-5 Hz.
Where the places lie is a plausible choice, drawn widely: about a person who sits or stands at the hand's side of the
robot and looks toward it, 0.15 m behind the hand at rest and with the shoulder 0.40 m above it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from synthetic_reaches import START, share

KINDS = ("scratching", "pointing", "reaching aside")
SHOULDER = np.array([0.15, 0.0, 0.40])
"""m, from the hand at rest; the person looks along -x"""


@dataclass
class Segment:
    """From place to place (m) in a time (s), beginning at ``begin``; ``swing`` (m) to and fro at ``rate`` Hz
    instead."""

    begin: float
    duration: float
    start: np.ndarray
    end: np.ndarray
    swing: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rate: float = 0.0


@dataclass
class Motion:
    """``at`` gives the hand's position (m) at a time (s); ``onset`` and ``over`` are its limits (s)."""

    kind: str
    segments: list[Segment]

    @property
    def onset(self) -> float:
        """s"""
        return self.segments[0].begin

    @property
    def over(self) -> float:
        """s"""
        return self.segments[-1].begin + self.segments[-1].duration

    def at(self, t: float) -> np.ndarray:
        """Position (m)."""
        place = self.segments[0].start
        for part in self.segments:
            if t < part.begin:
                break
            x = min(1.0, (t - part.begin) / part.duration)
            place = part.start + (part.end - part.start) * share(x)
            if part.rate > 0.0 and x < 1.0:
                place = place + part.swing * np.sin(2 * np.pi * part.rate * (t - part.begin))
        return place


def duration_of(way: float, rng: np.random.Generator) -> float:
    """s, of a motion over ``way`` m."""
    return 1.1 * max(0.3, (way / 0.45) ** 0.3) * float(np.exp(rng.normal(0.0, 0.2)))


def place_of(kind: str, rest: np.ndarray, side: float, rng: np.random.Generator) -> np.ndarray:
    """m, where a motion of this kind goes; ``side`` is 1 for a hand on the side of positive y."""
    shoulder = rest + SHOULDER
    if kind == "scratching":
        # Head and neck, the other forearm, chest, thigh.
        middles = ([0.0, -0.15, 0.25], [-0.20, -0.30, -0.25], [0.0, -0.15, -0.10], [-0.10, -0.05, -0.50])
        middle = np.array(middles[int(rng.integers(len(middles)))]) * [1.0, side, 1.0]
        return shoulder + middle + rng.normal(0.0, 0.06, 3)
    if kind == "pointing":
        # Anywhere before the person, the arm bent or straight.
        azimuth, elevation = rng.uniform(-1.5, 1.5), rng.uniform(-0.6, 0.6)
        level = np.cos(elevation)
        direction = np.array([-level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        return shoulder + rng.uniform(0.35, 0.65) * direction
    # Onto the table beside, and to the sides, low or high, within reach; nothing between person and robot.
    while True:
        place = rest + rng.uniform([-0.45, -0.70, -0.15], [0.25, 0.70, 0.35])
        way = place - rest
        if abs(way[1]) > 0.8 * abs(min(way[0], 0.0)) + 0.1 and 0.2 < float(np.linalg.norm(way)) < 0.75:
            return place


def other_motion(kind: str, rng: np.random.Generator, begin: float = 1.5) -> Motion:
    """A motion of a kind by a newly drawn person, beginning at ``begin`` s, there and back."""
    side = -1.0 if rng.random() < 0.1 else 1.0
    rest = START * [1.0, side, 1.0] + rng.normal(0.0, 0.02, 3)
    place = place_of(kind, rest, side, rng)
    there = duration_of(float(np.linalg.norm(place - rest)), rng)
    segments = [Segment(begin, there, rest, place)]
    t = begin + there
    stay = float(rng.uniform(0.3, 1.5))
    if kind == "scratching":
        direction = rng.normal(size=3)
        swing = float(rng.uniform(0.005, 0.02)) * direction / np.linalg.norm(direction)
        segments.append(Segment(t, stay, place, place, swing, float(rng.uniform(2.0, 5.0))))
    back = duration_of(float(np.linalg.norm(place - rest)), rng)
    segments.append(Segment(t + stay, back, place, rest))
    return Motion(kind, segments)
