"""Evidence of a contact: torques of the moving arm, fingers, touch and sight, and all of it together.

Each source turns what it measures into evidence: a margin (signal over its threshold) and the probability of a contact
that goes with it. Sources count as independent: the probability that at least one of them is right decides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

MOMENTUM = "momentum"
TACTILE = "tactile"
FINGERS = "finger_motor"
SIGHT = "sight"
FUSED = "fused"
DECIDED = 0.99  # probability from which it is a contact; a source at its threshold reaches it alone
STEEPNESS = 12.0  # logits per unit of margin: at 0.8 of its threshold a source says 0.9, at 0.6 even chances
SLOW = 0.03  # m/s of the palm below which what is seen in it stays there
SPEAKS_TOO = 0.5  # a source that is this sure is named beside the surest one


@dataclass(frozen=True)
class ContactEvent:
    """Contact found (contact=True) or load released (False), as coglab_msgs/Contact has it.

    ``margin`` is the signal over its threshold, ``confidence`` the probability that the signal is over its threshold
    given the noise of the sensor (0..1), ``code`` the ReasonCode of the message.
    """

    contact: bool
    source: str
    margin: float
    message: str = ""
    confidence: float = 1.0
    code: int = 0


@dataclass(frozen=True)
class Evidence:
    """What one source says at one time (s) and until when it counts."""

    source: str
    stamp: float
    until: float
    margin: float
    message: str = ""

    @property
    def probability(self) -> float:
        """Of a contact, by this source alone."""
        return probability(self.margin)


def probability(margin: float) -> float:
    """Of a contact, from a signal over its threshold: 0.99 at 1."""
    return 1.0 / (1.0 + math.exp(-min(60.0, math.log(DECIDED / (1.0 - DECIDED)) + STEEPNESS * (margin - 1.0))))


def together(evidence: Iterable[Evidence]) -> float:
    """Probability that at least one of the sources is right."""
    return 1.0 - math.prod(1.0 - each.probability for each in evidence)


def name_of(evidence: Iterable[Evidence]) -> str:
    """The source's name where one alone says so, else FUSED."""
    sure = [each for each in evidence if each.probability >= SPEAKS_TOO]
    return sure[0].source if len(sure) == 1 else FUSED


class Touch:
    """Tactile sensors of fingers and palm (FingertipForces). An object that is there already is contact as well."""

    def __init__(self, threshold: float = 0.5, deviations: float = 6.0, confirm: int = 2, hold: float = 0.05) -> None:
        """``threshold``: N, at least; more where the sensors' noise times ``deviations`` is more. ``hold``: s."""
        self.threshold, self.deviations, self.confirm, self.hold = threshold, deviations, confirm, hold
        self._margins: list[float] = []

    def reset(self) -> None:
        """Forget the past."""
        self._margins.clear()

    def feed(self, stamp: float, forces: Sequence[Sequence[float]], deviation: float = 0.0) -> Evidence | None:
        """Forces (N) on each phalanx and on the palm; ``deviation`` of one component, N. None for what is no number."""
        table = np.asarray(forces, dtype=float).reshape(-1, 3)
        if not (len(table) and np.all(np.isfinite(table)) and math.isfinite(stamp)):
            return None
        noise = deviation if math.isfinite(deviation) and deviation > 0.0 else 0.0
        needed = max(self.threshold, self.deviations * noise)
        largest = float(np.max(np.linalg.norm(table, axis=1)))
        self._margins = [*self._margins, largest / needed][-self.confirm :]
        margin = min(self._margins) if len(self._margins) == self.confirm else 0.0
        return Evidence(TACTILE, stamp, stamp + self.hold, margin, f"{largest:.1f} N on the hand's touch sensors")


class InPalm:
    """The tracked object at its grasp in the palm of an arm that has come to rest: it is there, felt or not."""

    def __init__(self, near: float = 0.015, turned: float = math.radians(20.0), confirm: float = 0.12) -> None:
        """``near`` (m) and ``turned`` (rad): of the palm from where it has to be for the grasp; ``confirm``: s."""
        self.near, self.turned, self.confirm = near, turned, confirm
        self._since: float | None = None

    def reset(self) -> None:
        """Forget the past."""
        self._since = None

    def feed(self, stamp: float, distance: float, angle: float, speed: float) -> Evidence | None:
        """One sight: how far (m, rad) the palm is from the grasp, and the palm's speed (m/s)."""
        if not all(map(math.isfinite, (stamp, distance, angle, speed))):
            return None
        if speed > SLOW or distance > self.near or angle > self.turned:
            self._since = None
        elif self._since is None or stamp < self._since:
            self._since = stamp
        there = self._since is not None and stamp - self._since >= self.confirm
        margin = 1.0 if there else 0.0
        message = f"the object is seen at its grasp, {1000 * distance:.0f} mm off the palm"
        return Evidence(SIGHT, stamp, stamp + self.confirm, margin, message)


class Motor(Protocol):
    """One motor of the hand, as coglab_msgs/MotorStatus."""

    position: int
    current: int
    force: int
    moving: bool
    target_reached: bool
    over_current: bool


class Fingers:
    """Motors of the hand: a finger that stops before its target, or one that stands and is moved, strained or needs
    current. The motors are read one value after the other, so that a command to close may fall between the reading of
    `moving` and that of the current: a current counts once the next status has it, too, and still no motion."""

    def __init__(self, counts: float = 8.0, current: float = 60.0, tension: float = 20.0, hold: float = 0.4) -> None:
        """Thresholds in the counts of MotorStatus: way of a standing motor, current above that on arming, tension above
        it. ``hold``: s for which one status counts; the hand is polled slowly while it does nothing."""
        self.thresholds = np.array([counts, current, tension])
        self.hold = hold
        self.reset()

    def reset(self) -> None:
        """Compare with the next status from now on."""
        self._reference: dict[int, np.ndarray] = {}
        self._moved: set[int] = set()
        self._loaded: set[int] = set()

    def feed(self, stamp: float, motors: Sequence[Motor]) -> Evidence | None:
        """One status of all motors; None while there is nothing to compare with."""
        margin, message = 0.0, ""
        for number, motor in enumerate(motors):
            now = np.array([motor.position, motor.current, max(0, motor.force)], dtype=float)
            stopped = number in self._moved and not motor.moving
            if motor.moving:
                self._moved.add(number)
            else:
                self._moved.discard(number)
            if stopped and not motor.target_reached and motor.over_current:
                margin, message = 1.2, f"motor {number} of the hand stopped before its target"
            if motor.moving or stopped or number not in self._reference:
                self._reference[number] = now
                self._loaded.discard(number)
                continue
            change = np.abs(now - self._reference[number]) / self.thresholds
            loaded = change[1] >= 1.0
            change[1] *= number in self._loaded
            (self._loaded.add if loaded else self._loaded.discard)(number)
            if float(np.max(change)) > margin:
                margin = float(np.max(change))
                what = ("moved", "needs current", "is strained")[int(np.argmax(change))]
                message = f"motor {number} of the hand stands and {what}"
        return Evidence(FINGERS, stamp, stamp + self.hold, margin, message) if motors else None
