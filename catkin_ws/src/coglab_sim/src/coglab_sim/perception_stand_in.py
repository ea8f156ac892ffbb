"""Perception as a tracker would deliver it: between the truth of the cell and the frames that control sees.

Rate and its jitter, latency (stamp = capture time, delivered later), noise that is correlated like a tracker's, bursts
of dropout (two-state Gilbert model), occlusion by the robot's hand, identity swaps. Each can be switched off;
``perfect`` delivers the truth as it is at the same rate.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from coglab_py.pose import Pose
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class PerceptionSettings:
    """Of the stand-in. Times in s, lengths in m, angles in rad."""

    perfect: bool = False
    rate: float = 30.0
    rate_jitter: float = 0.003
    latency: float = 0.060
    latency_sigma: float = 0.015
    position_noise: tuple[float, float, float] = (0.004, 0.004, 0.004)
    """standard deviation per world axis"""
    orientation_noise: float = 0.035
    correlation_time: float = 0.50
    """of the noise: an AR(1) process, as a filtering tracker gives it"""
    dropout_start: float = 0.02
    """probability per frame that a burst of dropout begins; 0 switches dropouts off"""
    dropout_end: float = 0.3
    occlusion_distance: float = 0.0
    """a robot hand nearer to the object than this hides it half of the time; 0 switches occlusion off"""
    swap_probability: float = 0.0
    """per frame: the tracker takes something else for the object"""
    swap_jump: float = 0.08
    swap_frames: int = 4

    def __post_init__(self) -> None:
        if not self.rate > 0.0 or self.latency < 0.0:
            raise ValueError(f"rate must be positive and latency not negative, got {self.rate} Hz, {self.latency} s")

    @staticmethod
    def from_mapping(data: Mapping[str, Any]) -> PerceptionSettings:
        """Read a parameter mapping; ValueError names unknown fields."""
        known = {f.name for f in fields(PerceptionSettings)}
        unknown = sorted(set(data) - known)
        if unknown:
            raise ValueError(
                f"perception settings: unknown fields {', '.join(unknown)}; known: {', '.join(sorted(known))}"
            )
        return PerceptionSettings(**{k: tuple(v) if isinstance(v, list) else v for k, v in data.items()})


@dataclass(frozen=True)
class Sight:
    """One delivered observation of a frame: when it was captured and what was seen."""

    name: str
    captured: float
    frame: Pose


class Tracker:
    """Observations of one frame. Feed it the truth; it returns what has been delivered by now."""

    def __init__(self, name: str, settings: PerceptionSettings, seed: int) -> None:
        self.name = name
        self.settings = settings
        self.rng = np.random.default_rng([seed, sum(name.encode()), 31])
        self._next = 0.0
        self._lost = False
        self._noise = np.zeros(6)
        self._noise_stamp: float | None = None
        self._swap_left = 0
        self._swap = np.zeros(3)
        self._queue: list[tuple[float, int, Sight]] = []
        self._count = 0
        self.newest: Sight | None = None

    def step(self, now: float, truth: Pose, robot_hand: Pose | None = None) -> list[Sight]:
        """At time ``now`` (s): capture if it is time, deliver what has arrived."""
        if now >= self._next:
            s = self.settings
            jitter = 0.0 if s.perfect else float(self.rng.normal(0, s.rate_jitter))
            self._next = now + max(0.001, 1.0 / s.rate + jitter)
            self._capture(now, truth, robot_hand)
        delivered = []
        while self._queue and self._queue[0][0] <= now:
            sight = heapq.heappop(self._queue)[2]
            # A frame that was overtaken by a newer one is worthless: tf would only complain about it.
            if self.newest is None or sight.captured > self.newest.captured:
                self.newest = sight
                delivered.append(sight)
        return delivered

    def _capture(self, now: float, truth: Pose, robot_hand: Pose | None) -> None:
        s = self.settings
        if s.perfect:
            self._push(now, Sight(self.name, now, truth))
            return
        if self._lost:
            self._lost = self.rng.random() >= s.dropout_end
        elif s.dropout_start > 0.0:
            self._lost = self.rng.random() < s.dropout_start
        hidden = (
            s.occlusion_distance > 0.0
            and robot_hand is not None
            and self.rng.random() < 0.5
            and np.linalg.norm(robot_hand.position - truth.position) < s.occlusion_distance
        )
        noise = self._noise_step(now)
        turned = Rotation.from_rotvec(noise[3:]) * truth.rotation
        seen = Pose(truth.position + noise[:3] + self._swapped(), turned.as_quat())
        if not self._lost and not hidden:
            delay = max(0.0, s.latency + float(self.rng.normal(0, s.latency_sigma)))
            self._push(now + delay, Sight(self.name, now, seen))

    def _push(self, due: float, sight: Sight) -> None:
        self._count += 1
        heapq.heappush(self._queue, (due, self._count, sight))

    def _noise_step(self, now: float) -> np.ndarray:
        s = self.settings
        sigma = np.array([*s.position_noise, s.orientation_noise, s.orientation_noise, s.orientation_noise])
        dt = now - self._noise_stamp if self._noise_stamp is not None else 1e9
        self._noise_stamp = now
        keep = np.exp(-dt / s.correlation_time) if s.correlation_time > 0.0 else 0.0
        self._noise = keep * self._noise + np.sqrt(1 - keep**2) * sigma * self.rng.normal(size=6)
        return self._noise

    def _swapped(self) -> np.ndarray:
        s = self.settings
        if self._swap_left > 0:
            self._swap_left -= 1
            return self._swap
        if s.swap_probability > 0.0 and self.rng.random() < s.swap_probability:
            direction = self.rng.normal(size=3)
            self._swap = s.swap_jump * direction / np.linalg.norm(direction)
            self._swap_left = s.swap_frames
            return self._swap
        return np.zeros(3)


@dataclass(frozen=True)
class Board:
    """The storage board: its frame in world and the places on it (object positions in the board frame, m)."""

    frame: Pose
    slots: dict[str, np.ndarray]

    def free(self, occupied: list[np.ndarray], clearance: float = 0.10) -> list[str]:
        """Slots farther than ``clearance`` m from every object (world positions), best first."""
        return [
            name
            for name, place in self.slots.items()
            if all(np.linalg.norm(self.frame.apply(place) - o) > clearance for o in occupied)
        ]
