"""Objective fluency of a handover, after G. Hoffman, "Evaluating Fluency in Human-Robot Collaboration", IEEE
Transactions on Human-Machine Systems 49(3), 2019.

With T the duration of the task, H and R the times in which the person and the robot are active:

- human idle time      1 - |H| / T
- robot idle time      1 - |R| / T
- concurrent activity  |H and R| / T
- functional delay     sum over the turns of (start of one agent's activity - end of the other's before it) / T;
  negative where the next agent begins before the other has ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Interval = tuple[float, float]
GAP = 0.15  # s; a shorter pause does not interrupt an activity
BLIP = 0.10  # s; a shorter activity does not count
PERSON_SPEED = 0.05  # m/s, from which the person's hand counts as active
PALM_SPEED = 0.05  # m/s, from which the robot's palm counts as active
TOUCH = 0.05  # N, from which the person counts as touching the object
FINGER_SPEED = 20.0  # counts of 254 per s, from which the robot's fingers count as active


@dataclass(frozen=True)
class Fluency:
    """Shares of the duration of the task."""

    duration: float
    """T, s"""
    human_idle: float
    """share of the time in which the person is not active: 1 - |H| / T"""
    robot_idle: float
    """share of the time in which the robot is not active: 1 - |R| / T"""
    concurrent_activity: float
    """share of the time in which both are active: |H and R| / T"""
    functional_delay: float
    """sum over the turns of (start of one agent's activity - end of the other's before it) / T; negative if they
    overlap more than they wait"""
    turns: int
    """changes from one agent to the other"""


def speed_of(times: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Mean speed (m/s) over the 60 ms around each time of a path, times [n] s and points [n, 3] m. Shape (n,). Single
    late stamps have little effect."""
    if len(times) < 3:
        return np.zeros(len(times))
    first, last = np.maximum(times - 0.03, times[0]), np.minimum(times + 0.03, times[-1])
    move = [np.interp(last, times, axis) - np.interp(first, times, axis) for axis in points.T]
    return np.linalg.norm(move, axis=0) / (last - first)


def active_intervals(times: np.ndarray, active: np.ndarray) -> list[Interval]:
    """Intervals (s) in which ``active`` ([n] bool, at ``times`` [n] s) is true. Pauses below 0.15 s are bridged, then
    activities below 0.1 s are left out."""
    if len(times) != len(active):
        raise ValueError(f"times and active have the same length, got {len(times)} and {len(active)}")
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(active, dtype=int), [0]])))
    merged: list[list[float]] = []
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        start, end = float(times[first]), float(times[min(after, len(times) - 1)])
        if merged and start - merged[-1][1] < GAP:
            merged[-1][1] = end
        else:
            merged.append([start, end])
    return [(start, end) for start, end in merged if end - start >= BLIP]


def fluency_of(human: Sequence[Interval], robot: Sequence[Interval], start: float, end: float) -> Fluency:
    """Fluency between ``start`` and ``end`` (s). ``human``, ``robot``: intervals (s) of activity of each agent, which
    do not overlap one another. ValueError: ``end`` is not after ``start``."""
    total = end - start
    if not total > 0.0:
        raise ValueError(f"end must be after start, got {start:g} s and {end:g} s")
    h, r = (_clipped(each, start, end) for each in (human, robot))
    both = sum(max(0.0, min(a[1], b[1]) - max(a[0], b[0])) for a in h for b in r)
    order = sorted([(*interval, "human") for interval in h] + [(*interval, "robot") for interval in r])
    turns = [(a, b) for a, b in zip(order, order[1:], strict=False) if a[2] != b[2]]
    return Fluency(
        total,
        1.0 - _length(h) / total,
        1.0 - _length(r) / total,
        both / total,
        sum(b[0] - a[1] for a, b in turns) / total,
        len(turns),
    )


def _clipped(intervals: Sequence[Interval], start: float, end: float) -> list[Interval]:
    inside = [(max(start, a), min(end, b)) for a, b in intervals]
    return [(a, b) for a, b in inside if b > a]


def _length(intervals: Sequence[Interval]) -> float:
    return sum(b - a for a, b in intervals)
