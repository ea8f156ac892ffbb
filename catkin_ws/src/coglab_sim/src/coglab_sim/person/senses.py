"""Perception of the simulated person: sight with delay and noise, touch with delay and threshold.

The person has no other inputs except the robot's speech.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
from coglab_py.pose import Pose, length
from coglab_py.rotation import Rotation

from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import WorldView

NOISE_TIME = 0.3  # s, correlation time of the visual error
SPEED_TIME = 0.05  # s, time over which a speed is seen
SLOWEST = 0.005  # m/s, constant part of the standard deviation of a seen speed
FINGERTIP_WAY = 0.19
"""m, path of a fingertip from open to closed (middle finger of coglab_sim/config/hand_model.yaml). People see the
closure by the fingertips."""
FINGERS = 4  # number of fingertips that are seen independently; their mean is more exact than one
OF_NOISE = np.array([*range(12), 13])  # which of the fresh random numbers of a step are for the visual error

Value = TypeVar("Value")


class Delayed(Generic[Value]):
    """Delays values by a fixed time (s). Until then it returns the first value."""

    def __init__(self, delay: float) -> None:
        self.delay = delay
        self._values: deque[tuple[float, Value]] = deque()

    def step(self, t: float, value: Value) -> Value:
        """Stores the value of time t (s, increasing). Returns the newest value that is old enough."""
        self._values.append((t, value))
        while len(self._values) > 1 and self._values[1][0] <= t - self.delay + 1e-9:
            self._values.popleft()
        return self._values[0][1]


class SlowNoise:
    """Correlated Gaussian noise with the given standard deviations."""

    def __init__(self, rng: np.random.Generator, sigma: np.ndarray) -> None:
        self._sigma = sigma
        self._value = sigma * rng.normal(size=len(sigma))

    def step(self, dt: float, fresh: np.ndarray) -> np.ndarray:
        """Returns the noise ``dt`` s later. ``fresh``: standard normal numbers, one for each."""
        keep = math.exp(-dt / NOISE_TIME)
        self._value = keep * self._value + math.sqrt(1.0 - keep**2) * self._sigma * fresh
        return self._value


@dataclass(frozen=True)
class Percept:
    """State of the cell as the person perceives it."""

    true_hand: Pose
    hand_error: np.ndarray
    """visual error, m (3) and rad (3)"""
    robot_speed: float
    """m/s"""
    hand_closure: float
    closing_speed: float
    """1/s, closing speed of the robot's fingers"""
    true_object: Pose
    object_error: np.ndarray
    load: np.ndarray
    """N, of the object on the person's hand, world axes"""

    # Computed on demand: most phases use one of the two frames or none.
    @cached_property
    def robot_hand(self) -> Pose:
        """Seen pose of the robot's hand."""
        return _moved(self.true_hand, self.hand_error)

    @cached_property
    def object(self) -> Pose:
        """Seen pose of the object."""
        return _moved(self.true_object, self.object_error)


class Senses:
    """Eyes and touch of one person. Input of step(): time and true state of the world."""

    def __init__(self, person: Participant, rng: np.random.Generator) -> None:
        self.person, self._rng = person, rng
        turn = np.radians(person.seen_turn)
        self._of_tips = 1.0 / (FINGERTIP_WAY * math.sqrt(FINGERS))
        pose = [person.seen_noise] * 3 + [turn] * 3
        # Of the robot's hand (6), of the object (6), of the closure of the robot's fingers (1).
        self._noise = SlowNoise(rng, np.array([*pose, *pose, person.seen_noise * self._of_tips]))
        self._eyes: Delayed[tuple[WorldView, float, float]] = Delayed(person.seeing_delay)
        self._touch: Delayed[np.ndarray] = Delayed(person.feeling_delay)
        self._before: deque[tuple[float, np.ndarray, float]] = deque()
        self._felt = np.zeros(3)
        self._misjudged = 1.0 + person.seen_speed * float(rng.normal())
        self._last: float | None = None

    def step(self, t: float, view: WorldView) -> Percept:
        """Returns the percept at time t (s, increasing)."""
        dt = 0.0 if self._last is None else max(0.0, t - self._last)
        self._last = t
        seen, speed, closing = self._eyes.step(t, (view, *self._speeds(t, view)))
        fresh = self._rng.normal(size=15)  # at once: a step has little time
        noise = self._noise.step(dt, fresh[OF_NOISE])
        return Percept(
            seen.robot_hand,
            noise[:6],
            max(0.0, speed * self._misjudged + SLOWEST * float(fresh[12])),
            seen.hand_closure + float(noise[12]),
            closing * self._misjudged + SLOWEST * self._of_tips * float(fresh[14]),
            seen.object,
            noise[6:12],
            self._feel(self._touch.step(t, np.asarray(view.load, dtype=float))),
        )

    def _speeds(self, t: float, view: WorldView) -> tuple[float, float]:
        """Speeds of the robot's palm (m/s) and fingers (1/s) over SPEED_TIME. A robot that was just seen for the first
        time counts as moving."""
        before = self._before
        before.append((t, view.robot_hand.position, view.hand_closure))
        while len(before) > 2 and before[1][0] <= t - SPEED_TIME:
            before.popleft()
        then, place, closure = before[0]
        since = t - then
        if since < 0.5 * SPEED_TIME:
            return 1.0, 0.0
        return length(view.robot_hand.position - place) / since, (view.hand_closure - closure) / since

    def _feel(self, load: np.ndarray) -> np.ndarray:
        """Returns the felt force (N). It keeps its value until the change is noticeable."""
        noticeable = max(self.person.felt_threshold, self.person.felt_share * length(self._felt))
        if length(load - self._felt) > noticeable:
            self._felt = load.copy()
        return self._felt


def _moved(frame: Pose, noise: np.ndarray) -> Pose:
    turned = Rotation.from_rotvec(noise[3:]) * frame.rotation
    return Pose(frame.position + noise[:3], turned.as_quat())
