"""Evidence of a contact from the torques of the moving arm, fingers, touch and sight, and their combination.

Each source converts its measurement to evidence: a margin (signal over threshold) and the probability of a contact. The
sources are treated as independent: the probability that at least one of them is right decides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from coglab_contact._core import DECIDED, ContactEvent, Evidence, probability

__all__ = ["DECIDED", "ContactEvent", "Evidence", "probability"]

MOMENTUM = "momentum"
TACTILE = "tactile"
FINGERS = "finger_motor"
SIGHT = "sight"
FUSED = "fused"
SLOW = 0.03  # m/s of the palm; below, an object seen in the palm stays there
SPEAKS_TOO = 0.5  # probability from which a source counts as a contributor to the event


def together(evidence: Iterable[Evidence]) -> float:
    """Returns the probability that at least one of the sources is right."""
    return 1.0 - math.prod(1.0 - each.probability for each in evidence)


def name_of(evidence: Iterable[Evidence]) -> str:
    """Returns the name of the source if only one contributes, else FUSED."""
    sure = [each for each in evidence if each.probability >= SPEAKS_TOO]
    return sure[0].source if len(sure) == 1 else FUSED


class Touch:
    """Tactile sensors of fingers and palm (FingertipForces). An object that was there before also counts as contact."""

    def __init__(self, threshold: float = 0.5, deviations: float = 6.0, confirm: int = 2, hold: float = 0.05) -> None:
        """``threshold``: N; raised to ``deviations`` times the noise of the sensors if that is larger. ``hold``: s."""
        self.threshold, self.deviations, self.confirm, self.hold = threshold, deviations, confirm, hold
        self._margins: list[float] = []

    def reset(self) -> None:
        """Delete the past samples."""
        self._margins.clear()

    def feed(self, stamp: float, forces: Sequence[Sequence[float]], deviation: float = 0.0) -> Evidence | None:
        """Forces (N) on each phalanx and on the palm, n x 3. ``deviation``: noise of a component, N. None if not
        finite."""
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
    """The tracked object is at its grasp in the palm of a resting arm: it is there, even if it is not felt."""

    def __init__(self, near: float = 0.015, turned: float = math.radians(20.0), confirm: float = 0.12) -> None:
        """``near`` (m), ``turned`` (rad): tolerance of the palm's pose at the grasp. ``confirm``: s."""
        self.near, self.turned, self.confirm = near, turned, confirm
        self._since: float | None = None

    def reset(self) -> None:
        """Delete the past sights."""
        self._since = None

    def feed(self, stamp: float, distance: float, angle: float, speed: float) -> Evidence | None:
        """Process one sight: distance of the palm from the grasp (m, rad), and the palm's speed (m/s)."""
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
    """One motor of the hand; fields of coglab_msgs/MotorStatus."""

    position: int
    current: int
    force: int
    moving: bool
    target_reached: bool
    over_current: bool


class Fingers:
    """Motors of the hand: a finger stops before its target, or a standing finger is moved, strained or needs current.
    The motor values are read one after the other. A command to close may come between the reading of `moving` and that
    of the current. Therefore, a current counts only if the next status also has it, without motion."""

    def __init__(self, counts: float = 8.0, current: float = 60.0, tension: float = 20.0, hold: float = 0.4) -> None:
        """Thresholds in the counts of MotorStatus: motion of a standing motor, current and tension above the values on
        arming. ``hold``: validity of one status, s; an idle hand is polled slowly."""
        self.thresholds = np.array([counts, current, tension])
        self.hold = hold
        self.reset()

    def reset(self) -> None:
        """Use the next status as the new reference."""
        self._reference: dict[int, np.ndarray] = {}
        self._moved: set[int] = set()
        self._loaded: set[int] = set()

    def feed(self, stamp: float, motors: Sequence[Motor]) -> Evidence | None:
        """Process one status of all motors. None if there are no motors."""
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
