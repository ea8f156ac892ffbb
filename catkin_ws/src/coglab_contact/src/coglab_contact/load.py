"""Grip and load of a hand with touch sensors: the weight that hangs on it, and the force with which it squeezes.

Load: vertical part of the sum of all contact forces on phalanges and palm. Forces between the fingers cancel, and so
does the weight of the hand itself: a moving arm measures only the object.

Grip: contact forces are divided into those that carry the load and those that balance each other, the internal or
grasping forces (Yoshikawa and Nagai 1991). The grip is half the sum of the magnitudes of the latter, so that two
fingers that press with F each grip with F. Each contact is assumed to carry load in proportion to its magnitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Joints = Sequence[float] | np.ndarray

SMOOTH = 0.015  # s, time constant of the low-pass of each force
USUAL = 0.5  # s, time constant of the average load before a person takes it
NOISE = 3.0  # standard deviations of one component; smaller low-passed forces count as zero
OLDEST = 0.1  # s, oldest touch data that is used; a longer gap restarts the filters
COVERED = 0.3  # largest difference of the average load from the weight (share); else some contacts miss the sensors
EXACT = 0.1  # N, standard deviation of the load of noise-free sensors, from their position and scale
APART = 2.0  # standard deviations of the load by torques; if touch differs by more, the lower share counts


GRAVITY = 9.81  # m/s^2
SETTLING = 0.10  # s after arming in which the weight, or the residual that it causes, is averaged
CONFIRMED = 0.05  # s for which the load must be gone
SAME = 0.5  # N, error of the model: apparent change of the weight between two postures
FAR = 0.2  # rad, joint rotation between two such postures
PART = 1.0 / 3.0  # of the weight, limit for such an apparent change: a larger one means that somebody takes the load


@dataclass(frozen=True)
class Felt:
    """Share of the weight that has gone, measured by touch, and its standard deviation."""

    share: float
    deviation: float


def together(torques: float | None, deviation: float, felt: Felt | None) -> float | None:
    """Combines the shares by the arm's torques (with ``deviation``) and by touch; None if both are missing.

    Each counts by its variance. If they differ by more than APART, the lower one counts: either contacts miss the
    sensors, or something leans on the arm. This is safe: a grip that loosens later drops nothing.
    """
    if torques is None or felt is None:
        return torques if felt is None else felt.share
    if abs(torques - felt.share) > APART * deviation:
        return min(torques, felt.share)
    of_torques, of_touch = deviation**-2, felt.deviation**-2
    return (of_torques * torques + of_touch * felt.share) / (of_torques + of_touch)


class GripAndLoad:
    """Processes the touch forces; returns grip and load. N, base frame with z up."""

    def __init__(self, turned: Callable[[Joints], np.ndarray]) -> None:
        """``turned``: converts joint positions (rad) to the rotation (3 x 3) from ih2_palm to the base frame."""
        self._turned = turned
        self._forces: np.ndarray | None = None  # n x 3, N on each phalanx and the palm, ih2_palm, low-passed
        self._stamp = 0.0
        self._noise = 0.0  # N, measured standard deviation of one component
        self._load = 0.0
        self._usual: float | None = None
        self._counted_from: float | None = None

    def feed(self, stamp: float, forces: Sequence[Sequence[float]], deviation: float, position: Joints) -> None:
        """Process the forces (n x 3, N, ih2_palm) on each phalanx and the palm, the standard deviation of one component
        (N) and the joints (rad). Samples that are not finite are ignored."""
        table = np.asarray(forces, dtype=float).reshape(-1, 3)
        if not (len(table) and np.all(np.isfinite(table)) and math.isfinite(stamp)):
            return
        step = stamp - self._stamp
        self._noise = deviation if math.isfinite(deviation) and deviation > 0.0 else 0.0
        if self._forces is None or self._forces.shape != table.shape or not 0.0 <= step <= OLDEST:
            self._forces, self._usual, step = table, None, 0.0
        smooth = self._forces = self._forces + (1.0 - math.exp(-step / SMOOTH)) * (table - self._forces)
        self._stamp = stamp
        self._load = -float((self._turned(position) @ smooth.sum(axis=0))[2])
        usual = self._load if self._usual is None else self._usual
        self._usual = usual + (1.0 - math.exp(-step / USUAL)) * (self._load - usual)

    def count_from_now(self) -> None:
        """Somebody may take the load from now on: count from the present average load."""
        self._counted_from = self._usual

    def count_on(self) -> None:
        """Keep the reference load; set it if there is none."""
        if self._counted_from is None:
            self.count_from_now()

    def anew(self) -> None:
        """The hand holds another object, or nothing: delete the reference load."""
        self._counted_from = None

    def load(self, now: float) -> float | None:
        """Returns the load (N) on the hand; None without recent touch data."""
        return self._load if self._forces is not None and abs(now - self._stamp) <= OLDEST else None

    def share_gone(self, now: float, weight: float) -> Felt | None:
        """Returns the gone share of ``weight`` (N). None without touch data, or if it did not match the weight
        before."""
        load, usual = self.load(now), self._counted_from
        if load is None or usual is None or abs(usual - weight) > COVERED * weight:
            return None
        assert self._forces is not None
        return Felt((usual - load) / weight, math.hypot(EXACT, self._noise * math.sqrt(len(self._forces))) / weight)

    def grip(self, now: float) -> float | None:
        """Returns the grip force (N); None without recent touch data."""
        if self._forces is None or self.load(now) is None:
            return None
        sizes = np.linalg.norm(self._forces, axis=1)
        pressed = sizes > NOISE * self._noise
        total = float(sizes[pressed].sum())
        if total <= 0.0:
            return 0.0
        forces = self._forces[pressed]
        internal = forces - np.outer(sizes[pressed] / total, forces.sum(axis=0))
        return 0.5 * float(np.linalg.norm(internal, axis=1).sum())


class LeavingLoad:
    """Computes the share of the weight that has gone, and the time from which it has been enough for long enough.

    The share is counted from the load before the last motion. When the arm stands, it is counted from the load on the
    palm then, unless the difference is larger than a change of posture explains: then somebody has already lifted or
    pulled. If an arm turns its joints by half of FAR meanwhile and stands, this decision is repeated. The torques alone
    cannot distinguish an object lighter than SAME from nothing: such an object is given with touch.
    """

    def __init__(self, mass: float, needed: float, until: float, carried: float | None = None) -> None:
        """``mass``: of the object, kg. ``needed``: share of its weight. ``until``: end of the watch, s. ``carried``:
        load (N) on the palm before the last motion, None if unknown. ValueError: invalid mass."""
        if not mass > 0.0:
            raise ValueError(f"release needs the mass of the object in kg, got {mass}")
        self.weight, self._asked, self.until = mass * GRAVITY, needed, until
        self.share: float | None = None
        """1: all of the weight; None until there is a reference load"""
        self.reported = False
        self._from = carried  # N, reference load of the share
        self._posture: Joints = ()  # rad, posture of the newest sample
        self._counted: Joints | None = None  # rad, posture of the reference load; None: another one
        self._looked: Joints | None = None  # rad, posture in which the load was averaged last
        self._doubt = SAME  # N, part of the lost load that the change of posture alone may explain
        self._sum, self._count = 0.0, 0
        self._begun = 0.0
        self._since: float | None = None

    @property
    def needed(self) -> float:
        """Share that must be gone: the requested one, and at least half of that without doubt."""
        return max(self._asked, 0.5 * self._asked + self._doubt / self.weight)

    @property
    def margin(self) -> float:
        """Share that is gone, over the needed one."""
        return (self.share or 0.0) / self.needed

    @property
    def sure(self) -> float | None:
        """The share without the part that another posture may explain; a grip must not follow that part, which is half
        of the weight of a light object. None like ``share``."""
        if self.share is None:
            return None
        return math.copysign(max(0.0, abs(self.share) - self._doubt / self.weight), self.share)

    def feed(
        self,
        stamp: float,
        weight: float | None,
        still: bool,
        fresh: bool,
        felt: Felt | None = None,
        posture: Joints = (),
    ) -> bool:
        """Process one sample. ``stamp``: s. ``weight``: N on the palm, None while the arm moves too fast. ``still``:
        the arm stands. ``fresh``: the estimate has restarted. ``felt``: share by touch, None without data. ``posture``:
        rad, all joints. Returns True once, when enough is gone. Without any data the share stays, except after a
        restart, and the confirmation starts again."""
        self._posture = posture
        if fresh:
            self.share, self._count, self._since = None, 0, None
        if weight is not None and (still or self._from is None) and self._turned(self._looked) > 0.5 * FAR:
            self._settle(stamp, weight)
        torques = None if weight is None or self._from is None else (self._from - weight) / self.weight
        share = together(torques, SAME / self.weight, felt)
        if share is None:
            self._since = None
            return False
        self.share = share
        self._doubt = 0.0 if felt is not None else SAME * min(1.0, self._turned(self._counted) / FAR)
        self._since = None if share < self.needed else stamp if self._since is None else self._since
        if self.reported or self._since is None or stamp - self._since < CONFIRMED:
            return False
        self.reported = True
        return True

    def clock_was_set(self, step: float) -> None:
        """The clock was set by ``step`` s: the watch keeps its remaining time, and the confirmation starts again."""
        self.until += step
        self._since, self._count = None, 0

    def _turned(self, since: Joints | None) -> float:
        """Returns the largest joint rotation (rad) since a posture; inf if the posture is unknown."""
        if since is None:
            return math.inf
        return float(np.max(np.abs(np.subtract(self._posture, since)), initial=0.0))

    def _settle(self, stamp: float, weight: float) -> None:
        """Average the load on the palm, then decide about the reference load."""
        if self._count == 0 or stamp < self._begun:
            self._begun, self._sum, self._count = stamp, 0.0, 0
        self._sum, self._count = self._sum + weight, self._count + 1
        if stamp - self._begun < SETTLING:
            return
        now, self._looked, self._count = self._sum / self._count, self._posture, 0
        if self._from is None or abs(now - self._from) < min(SAME, PART * self.weight):
            self._from, self._counted = now, self._posture
