"""What a person perceives of the cell: everything seen late and noisy, everything felt late and above a threshold.

Nothing else reaches the simulated person but what is said to them.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
from coglab_py.pose import Pose, length
from scipy.spatial.transform import Rotation

from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import WorldView

NOISE_TIME = 0.3
"""s, correlation time of what is seen wrongly"""
SPEED_TIME = 0.05
"""s over which a speed is seen"""
SLOWEST = 0.005
"""m/s, standard deviation of a seen speed beside its share"""
FINGERTIP_WAY = 0.19
"""m that a fingertip goes from open to closed (middle finger of coglab_sim/config/hand_model.yaml): what is seen of the
fingers is seen of their tips"""
FINGERS = 4
"""whose tips are seen, each by itself: the mean of all is more exact than one"""

Value = TypeVar("Value")


class Delayed(Generic[Value]):
    """Gives back what was put in a fixed time ago (s); before that, the first value."""

    def __init__(self, delay: float) -> None:
        self.delay = delay
        self._values: deque[tuple[float, Value]] = deque()

    def step(self, t: float, value: Value) -> Value:
        """Put in the value of time t (s, increasing); returns the newest one that is old enough."""
        self._values.append((t, value))
        while len(self._values) > 1 and self._values[1][0] <= t - self.delay + 1e-9:
            self._values.popleft()
        return self._values[0][1]


class SlowNoise:
    """Correlated Gaussian noise of given standard deviations."""

    def __init__(self, rng: np.random.Generator, sigma: np.ndarray) -> None:
        self._rng, self._sigma = rng, sigma
        self._value = sigma * rng.normal(size=len(sigma))

    def step(self, dt: float) -> np.ndarray:
        """The noise ``dt`` s later."""
        keep = float(np.exp(-dt / NOISE_TIME))
        fresh = self._rng.normal(size=len(self._sigma))
        self._value = keep * self._value + np.sqrt(1.0 - keep**2) * self._sigma * fresh
        return self._value


@dataclass(frozen=True)
class Percept:
    """What the person takes for the state of the cell."""

    true_hand: Pose
    hand_error: np.ndarray
    """m and rad, by which it is seen elsewhere than it is"""
    robot_speed: float
    """m/s"""
    hand_closure: float
    closing_speed: float
    """1/s, of the robot's fingers"""
    true_object: Pose
    object_error: np.ndarray
    load: np.ndarray
    """N, of the object on the person's hand, world axes"""

    # Most phases look at one of the two frames or at none.
    @cached_property
    def robot_hand(self) -> Pose:
        """As it is seen."""
        return _moved(self.true_hand, self.hand_error)

    @cached_property
    def object(self) -> Pose:
        """As it is seen."""
        return _moved(self.true_object, self.object_error)


class Senses:
    """Eyes and touch of one person. Step it with the time and the world as it is."""

    def __init__(self, person: Participant, rng: np.random.Generator) -> None:
        self.person, self._rng = person, rng
        turn = np.radians(person.seen_turn)
        sigma = np.array([person.seen_noise] * 3 + [turn] * 3)
        self._noises = SlowNoise(rng, sigma), SlowNoise(rng, sigma)
        self._of_tips = 1.0 / (FINGERTIP_WAY * math.sqrt(FINGERS))
        self._bend_noise = SlowNoise(rng, np.array([person.seen_noise * self._of_tips]))
        self._eyes: Delayed[tuple[WorldView, float, float]] = Delayed(person.seeing_delay)
        self._touch: Delayed[np.ndarray] = Delayed(person.feeling_delay)
        self._before: deque[tuple[float, np.ndarray, float]] = deque()
        self._felt = np.zeros(3)
        self._misjudged = 1.0 + person.seen_speed * float(rng.normal())
        self._last: float | None = None

    def step(self, t: float, view: WorldView) -> Percept:
        """What is perceived at time t (s, increasing)."""
        dt = 0.0 if self._last is None else max(0.0, t - self._last)
        self._last = t
        seen, speed, closing = self._eyes.step(t, (view, *self._speeds(t, view)))
        hand, thing = (noise.step(dt) for noise in self._noises)
        return Percept(
            seen.robot_hand,
            hand,
            max(0.0, speed * self._misjudged + SLOWEST * float(self._rng.normal())),
            seen.hand_closure + float(self._bend_noise.step(dt)[0]),
            closing * self._misjudged + SLOWEST * self._of_tips * float(self._rng.normal()),
            seen.object,
            thing,
            self._feel(self._touch.step(t, np.asarray(view.load, dtype=float))),
        )

    def _speeds(self, t: float, view: WorldView) -> tuple[float, float]:
        """Of the robot's palm (m/s) and of its fingers (1/s), over the last moment; a robot that was never seen before
        is not at rest."""
        before = self._before
        before.append((t, view.robot_hand.position, view.hand_closure))
        while len(before) > 2 and before[1][0] <= t - SPEED_TIME:
            before.popleft()
        then, place, closure = before[0]
        if t - then < 0.5 * SPEED_TIME:
            return 1.0, 0.0
        return (
            length(view.robot_hand.position - place) / (t - then),
            (view.hand_closure - closure) / (t - then),
        )

    def _feel(self, load: np.ndarray) -> np.ndarray:
        """The force that is felt stays until the change is noticeable."""
        noticeable = max(self.person.felt_threshold, self.person.felt_share * length(self._felt))
        if length(load - self._felt) > noticeable:
            self._felt = load.copy()
        return self._felt


def _moved(frame: Pose, noise: np.ndarray) -> Pose:
    turned = Rotation.from_rotvec(noise[3:]) * frame.rotation
    return Pose(frame.position + noise[:3], turned.as_quat())
