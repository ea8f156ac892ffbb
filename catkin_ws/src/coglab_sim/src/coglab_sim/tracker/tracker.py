"""Perception as a tracker delivers it: between the truth of the cell and the frames that control sees.

Rate and its jitter, latency (stamp = capture time, delivered later), noise that is correlated like a tracker's, bursts
of dropout (two-state Gilbert model), occlusion while the robot's hand is near, identity swaps, and the constant error
of its calibration to the robot. Each can be switched off; ``perfect`` delivers the truth as it is at the same rate.
docs/people.md says where the figures come from.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from coglab_py.pose import Pose
from scipy.spatial.transform import Rotation

CALIBRATED_AT = np.array([0.75, 0.0, 0.40])
"""m, world: where the calibration was made; an angle off turns everything about this point"""


@dataclass(frozen=True)
class PerceptionSettings:
    """Of the stand-in. Times in s, lengths in m, angles in rad unless their names say degrees."""

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
    occlusion_distance: float = 0.15
    """a robot hand nearer than this hides the frame now and then; 0 switches occlusion off"""
    occlusion_start: float = 0.08
    """probability per frame, while the robot's hand is near, that it begins to hide the frame"""
    occlusion_end: float = 0.25
    swap_probability: float = 0.002
    """per frame: the tracker takes something else for it, the nearest other thing that it tracks; 0: never"""
    swap_jump: float = 0.08
    """from the thing where there is no other one within swap_reach"""
    swap_reach: float = 0.25
    swap_frames: int = 4
    calibration_offset: float = 0.005
    """length of the constant error of all frames, its direction drawn by the seed; 0: none"""
    calibration_turn_deg: float = 1.0
    """and of its angle, about the middle of the handover region"""

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

    def calibration(self, seed: int) -> Pose:
        """The constant error of the tracker with this seed: every true frame is seen at this pose times itself."""
        if self.perfect:
            return Pose()
        rng = np.random.default_rng([seed, 37])
        aside, axis = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        turn = Rotation.from_rotvec(np.radians(self.calibration_turn_deg) * axis)
        off = CALIBRATED_AT - turn.apply(CALIBRATED_AT) + self.calibration_offset * aside
        return Pose(off, turn.as_quat())


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
        self.calibration = settings.calibration(seed)
        self._next = 0.0
        self._lost = self._hidden = False
        self._noise = np.zeros(6)
        self._noise_stamp: float | None = None
        self._swap_left = 0
        self._swap: int | None = None
        self._jump = np.zeros(3)
        self._queue: list[tuple[float, int, Sight]] = []
        self._count = 0
        self.newest: Sight | None = None

    def step(self, now: float, truth: Pose, robot_hand: Pose | None = None, others: Sequence[Pose] = ()) -> list[Sight]:
        """At time ``now`` (s): capture if it is time, deliver what has arrived.

        ``others``: true poses of the other things that are tracked, always in the same order.
        """
        if now >= self._next:
            s = self.settings
            jitter = 0.0 if s.perfect else float(self.rng.normal(0, s.rate_jitter))
            self._next = now + max(0.001, 1.0 / s.rate + jitter)
            self._capture(now, truth, robot_hand, others)
        delivered = []
        while self._queue and self._queue[0][0] <= now:
            sight = heapq.heappop(self._queue)[2]
            # A frame that was overtaken by a newer one is worthless: tf would only complain about it.
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
        near = robot_hand is not None and np.linalg.norm(robot_hand.position - truth.position) < s.occlusion_distance
        self._hidden = self._burst(self._hidden, s.occlusion_start, s.occlusion_end) if near else False
        noise = self._noise_step(now)
        taken = self.calibration * self._swapped(truth, others)
        turned = Rotation.from_rotvec(noise[3:]) * taken.rotation
        if not self._lost and not self._hidden:
            delay = max(0.0, s.latency + float(self.rng.normal(0, s.latency_sigma)))
            self._push(now + delay, Sight(self.name, now, Pose(taken.position + noise[:3], turned.as_quat())))

    def _burst(self, lost: bool, start: float, end: float) -> bool:
        """One frame of a two-state chain."""
        return bool(self.rng.random() >= end) if lost else bool(start > 0.0 and self.rng.random() < start)

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

    def _swapped(self, truth: Pose, others: Sequence[Pose]) -> Pose:
        """The pose of what the tracker takes for the frame now."""
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
