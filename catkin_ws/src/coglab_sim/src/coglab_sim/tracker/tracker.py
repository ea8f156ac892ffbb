"""Simulated tracker: converts true poses of the cell into the frames that control receives.

It adds rate jitter, latency (stamp = capture time, delivered later), correlated noise, bursts of dropout (two-state
Gilbert model), occlusion while the robot's hand is near, identity swaps, and a constant calibration error. Each error
can be switched off; ``perfect`` delivers true poses at the same rate. docs/people.md gives the sources of the values.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from coglab_perception.sights import Sight
from coglab_py.pose import Pose, length
from coglab_py.rotation import Rotation

CALIBRATED_AT = np.array([0.75, 0.0, 0.40])  # m, world: place of the calibration; its angular error turns about it


@dataclass(frozen=True)
class PerceptionSettings:
    """Settings of the simulated tracker. Times in s, rate in Hz, lengths in m, angles in rad (`_deg`: degrees)."""

    perfect: bool = False
    rate: float = 30.0
    rate_jitter: float = 0.003
    latency: float = 0.060
    latency_sigma: float = 0.015
    position_noise: tuple[float, float, float] = (0.004, 0.004, 0.004)
    """standard deviation per world axis"""
    orientation_noise: float = 0.035
    correlation_time: float = 0.50
    """of the noise: an AR(1) process, as from a tracker with a filter"""
    dropout_start: float = 0.02
    """probability per frame that a burst of dropout begins; 0 switches dropouts off"""
    dropout_end: float = 0.3
    occlusion_distance: float = 0.15
    """a robot hand nearer than this can hide the frame; 0 switches occlusion off"""
    occlusion_start: float = 0.08
    """probability per frame, while the robot's hand is near, that it begins to hide the frame"""
    occlusion_end: float = 0.25
    swap_probability: float = 0.002
    """probability per frame that the tracker confuses it with the nearest other tracked thing; 0: never"""
    swap_jump: float = 0.08
    """length of the jump if no other thing is within swap_reach"""
    swap_reach: float = 0.25
    swap_frames: int = 4
    calibration_offset: float = 0.005
    """constant position error of all frames; the seed draws its direction; 0: none"""
    calibration_turn_deg: float = 1.0
    """constant angular error, about the middle of the handover region; the seed draws its axis"""

    def __post_init__(self) -> None:
        if not self.rate > 0.0 or self.latency < 0.0:
            raise ValueError(f"rate must be positive and latency not negative, got {self.rate} Hz, {self.latency} s")

    @staticmethod
    def from_mapping(data: Mapping[str, Any]) -> PerceptionSettings:
        """Reads a parameter mapping. ValueError for unknown fields."""
        known = {f.name for f in fields(PerceptionSettings)}
        unknown = sorted(set(data) - known)
        if unknown:
            raise ValueError(
                f"perception settings: unknown fields {', '.join(unknown)}; known: {', '.join(sorted(known))}"
            )
        return PerceptionSettings(**{k: tuple(v) if isinstance(v, list) else v for k, v in data.items()})

    def calibration(self, seed: int) -> Pose:
        """Constant error of the tracker with this seed. Seen frame = this pose * true frame."""
        if self.perfect:
            return Pose()
        rng = np.random.default_rng([seed, 37])
        aside, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        turn = Rotation.from_rotvec(np.radians(self.calibration_turn_deg) * axis)
        off = CALIBRATED_AT - turn.apply(CALIBRATED_AT) + self.calibration_offset * aside
        return Pose(off, turn.as_quat())


class Tracker:
    """Observes one frame. step() takes the true pose and returns the observations delivered so far."""

    def __init__(self, name: str, settings: PerceptionSettings, seed: int) -> None:
        self.name = name
        self.settings = settings
        self.rng = np.random.default_rng([seed, sum(name.encode()), 31])
        self.calibration = settings.calibration(seed)
        self._next = 0.0
        self._lost = self._hidden = False
        self._sigma = np.array([*settings.position_noise, *[settings.orientation_noise] * 3])
        self._noise = np.zeros(6)
        self._noise_stamp: float | None = None
        self._swap_left = 0
        self._swap: int | None = None
        self._jump = np.zeros(3)
        self._queue: list[tuple[float, int, Sight]] = []
        self._count = 0
        self.newest: Sight | None = None

    def step(self, now: float, truth: Pose, robot_hand: Pose | None = None, others: Sequence[Pose] = ()) -> list[Sight]:
        """Captures the frame at time ``now`` (s) if a capture is due, and returns the observations that arrived.

        ``others``: true poses of the other tracked things, always in the same order.
        """
        if now >= self._next:
            s = self.settings
            jitter = 0.0 if s.perfect else float(self.rng.normal(0, s.rate_jitter))
            self._next = now + max(0.001, 1.0 / s.rate + jitter)
            self._capture(now, truth, robot_hand, others)
        delivered = []
        while self._queue and self._queue[0][0] <= now:
            sight = heapq.heappop(self._queue)[2]
            # An observation older than a delivered one is dropped: tf would only warn about it.
            if self.newest is None or sight.captured > self.newest.captured:
                self.newest = sight
                delivered.append(sight)
        return delivered

    def _capture(self, now: float, truth: Pose, robot_hand: Pose | None, others: Sequence[Pose]) -> None:
        s = self.settings
        if s.perfect:
            self._push(now, Sight(self.name, now, truth))
            return
        self._lost = self._burst(self._lost, s.dropout_start, s.dropout_end)
        near = robot_hand is not None and length(robot_hand.position - truth.position) < s.occlusion_distance
        self._hidden = self._burst(self._hidden, s.occlusion_start, s.occlusion_end) if near else False
        noise = self._noise_step(now)
        taken = self.calibration * self._swapped(truth, others)
        turned = Rotation.from_rotvec(noise[3:]) * taken.rotation
        if not self._lost and not self._hidden:
            delay = max(0.0, s.latency + float(self.rng.normal(0, s.latency_sigma)))
            self._push(now + delay, Sight(self.name, now, Pose(taken.position + noise[:3], turned.as_quat())))

    def _burst(self, lost: bool, start: float, end: float) -> bool:
        """Next state of a two-state chain."""
        return bool(self.rng.random() >= end) if lost else bool(start > 0.0 and self.rng.random() < start)

    def _push(self, due: float, sight: Sight) -> None:
        self._count += 1
        heapq.heappush(self._queue, (due, self._count, sight))

    def _noise_step(self, now: float) -> np.ndarray:
        s = self.settings
        dt = now - self._noise_stamp if self._noise_stamp is not None else 1e9
        self._noise_stamp = now
        keep = math.exp(-dt / s.correlation_time) if s.correlation_time > 0.0 else 0.0
        self._noise = keep * self._noise + math.sqrt(1 - keep**2) * self._sigma * self.rng.normal(size=6)
        return self._noise

    def _swapped(self, truth: Pose, others: Sequence[Pose]) -> Pose:
        """Pose of the thing that the tracker takes for the frame."""
        s = self.settings
        if self._swap_left == 0 and s.swap_probability > 0.0 and self.rng.random() < s.swap_probability:
            self._swap_left = s.swap_frames
            away = [float(np.linalg.norm(other.position - truth.position)) for other in others]
            self._swap = int(np.argmin(away)) if away and min(away) < s.swap_reach else None
            direction = self.rng.normal(size=3)
            self._jump = s.swap_jump * direction / np.linalg.norm(direction)
        if self._swap_left == 0:
            return truth
        self._swap_left -= 1
        if self._swap is not None and self._swap < len(others):
            return others[self._swap]
        return Pose(truth.position + self._jump, truth.orientation)
