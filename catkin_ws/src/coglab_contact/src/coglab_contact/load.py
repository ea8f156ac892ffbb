"""Grip and load as the fingers feel them: what hangs on a hand with touch sensors, and how hard it squeezes it.

Load: the part along the vertical of the sum of all contact forces on phalanges and palm. What one finger presses
against another cancels in it, and so does the weight of the hand itself: an arm that moves feels the object alone.

Grip: contact forces are divided into those that carry the load and those that balance one another, the internal or
grasping forces (Yoshikawa and Nagai 1991); the grip is half the sum of the magnitudes of the latter, so that two
fingers that press with F each grip with F. Each contact is taken to carry its part of the load by its magnitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Joints = Sequence[float] | np.ndarray

SMOOTH = 0.015  # s, time constant of the low-pass of each force
USUAL = 0.5  # s, time constant of the load that is felt while nobody takes it
NOISE = 3.0  # deviations of one component up to which a low-passed force is none
OLDEST = 0.1  # s after which touch tells nothing any more; after such a gap it begins anew
COVERED = 0.3
"""share of the weight by which the usual load may differ from it; where it is more, contacts miss the sensors"""
EXACT = 0.1  # N, deviation of the felt load of sensors without noise: their place and scale
APART = 2.0  # deviations of the torques' load by which touch may differ from it while both are believed


GRAVITY = 9.81
SETTLING = 0.10  # s after arming over which the weight is averaged
CONFIRMED = 0.05  # s for which the load has to be gone
SAME = 0.5  # N by which the weight may seem to differ between two postures: the error of the model
FAR = 0.2  # rad that a joint has turned between two such postures
PART = 1.0 / 3.0
"""of the weight that may seem to have gone or come by that, at most: who takes more has begun to take it"""


@dataclass(frozen=True)
class Felt:
    """Share of the weight that has gone, by touch, and its standard deviation."""

    share: float
    deviation: float


def together(torques: float | None, deviation: float, felt: Felt | None) -> float | None:
    """One share of the weight from that of the arm's torques, with its standard deviation, and that of touch; None
    where neither tells.

    Each counts by its variance. Where they are APART the lower one does: either contacts miss the sensors, or something
    leans on the arm, and nothing falls from a grip that waits.
    """
    if torques is None or felt is None:
        return torques if felt is None else felt.share
    if abs(torques - felt.share) > APART * deviation:
        return min(torques, felt.share)
    of_torques, of_touch = deviation**-2, felt.deviation**-2
    return (of_torques * torques + of_touch * felt.share) / (of_torques + of_touch)


class GripAndLoad:
    """Feed it the forces; ask it for grip and load. N, base frame with z up."""

    def __init__(self, turned: Callable[[Joints], np.ndarray]) -> None:
        """``turned``: position of the joints (rad) to the rotation (3 x 3) from ih2_palm to the base frame."""
        self._turned = turned
        self._forces: np.ndarray | None = None  # n x 3, N on each phalanx and the palm, ih2_palm, low-passed
        self._stamp = 0.0
        self._noise = 0.0  # N, deviation of one component as measured
        self._load = 0.0
        self._usual: float | None = None
        self._counted_from: float | None = None

    def feed(self, stamp: float, forces: Sequence[Sequence[float]], deviation: float, position: Joints) -> None:
        """Forces (N, ih2_palm) of the world on each phalanx and the palm, ``deviation`` of one component, joints (rad).
        What is no number is left out."""
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
        """Somebody may take the load from now on: it is counted from what has usually hung on the hand."""
        self._counted_from = self._usual

    def count_on(self) -> None:
        """As it was counted before, if it was."""
        if self._counted_from is None:
            self.count_from_now()

    def anew(self) -> None:
        """The hand holds something else, or nothing."""
        self._counted_from = None

    def load(self, now: float) -> float | None:
        """N that hang on the hand; None where touch does not tell (any more)."""
        return self._load if self._forces is not None and abs(now - self._stamp) <= OLDEST else None

    def share_gone(self, now: float, weight: float) -> Felt | None:
        """Of ``weight`` (N); None where touch does not tell, or did not feel the weight before it was taken."""
        load, usual = self.load(now), self._counted_from
        if load is None or usual is None or abs(usual - weight) > COVERED * weight:
            return None
        assert self._forces is not None
        return Felt((usual - load) / weight, math.hypot(EXACT, self._noise * math.sqrt(len(self._forces))) / weight)

    def grip(self, now: float) -> float | None:
        """N; None where touch does not tell (any more)."""
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
    """The share that is gone, and the moment from which it has been enough for long enough.

    It is counted from what was carried before the last motion, and once the arm stands, from what hangs on the palm
    then: unless that is more different than another posture explains, because somebody has been lifting or pulling
    already. An arm that turns its joints by half of FAR meanwhile, and stands, asks itself that again. What weighs less
    than SAME the torques alone do not tell from nothing: such an object is given with touch.
    """

    def __init__(self, mass: float, needed: float, until: float, carried: float | None = None) -> None:
        """``mass``: kg, of the object; ``needed``: share of its weight; ``until``: s, when the watch ends by itself;
        ``carried``: N on the palm before the last motion, None where that is not known. ValueError for what is no
        mass."""
        if not mass > 0.0:
            raise ValueError(f"release needs the mass of the object in kg, got {mass}")
        self.weight, self._asked, self.until = mass * GRAVITY, needed, until
        self.share: float | None = None
        """1: all of it; None until enough was seen to count from"""
        self.told = False
        self._from = carried  # N, that the share is counted from
        self._posture: Joints = ()  # rad, of the newest sample
        self._counted: Joints | None = None  # the posture in which that weight hung on the palm; None: another one
        self._looked: Joints | None = None  # the posture in which it was last asked what hangs there
        self._doubt = SAME  # N of what is gone that the posture alone may explain
        self._sum, self._count = 0.0, 0
        self._begun = 0.0
        self._since: float | None = None

    @property
    def needed(self) -> float:
        """Share that has to be gone: what was asked for, and half of that for sure."""
        return max(self._asked, 0.5 * self._asked + self._doubt / self.weight)

    @property
    def margin(self) -> float:
        """Share that is gone over the one that is needed."""
        return (self.share or 0.0) / self.needed

    @property
    def sure(self) -> float | None:
        """The share less what is told by another posture alone, which no grip may follow: half of what a light object
        weighs. None as above."""
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
        """One sample: s, and N on the palm, None while the arm moves too fast to tell; ``still``: the arm stands;
        ``fresh``: nothing is known of the time before; ``felt``: the share by touch, None where that does not tell;
        ``posture``: rad, of all joints. Whether enough is gone now, said once. Where nothing tells, the share stays as
        it was, but for a fresh one, and what seemed gone has to be so anew."""
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
        if self.told or self._since is None or stamp - self._since < CONFIRMED:
            return False
        self.told = True
        return True

    def clock_was_set(self, step: float) -> None:
        """By so many s: the watch keeps the time that it had, and what seemed gone has to be so anew."""
        self.until += step
        self._since, self._count = None, 0

    def _turned(self, since: Joints | None) -> float:
        """rad by which the joint that has turned most has turned since; inf where it is not known since when."""
        if since is None:
            return math.inf
        return float(np.max(np.abs(np.subtract(self._posture, since)), initial=0.0))

    def _settle(self, stamp: float, weight: float) -> None:
        """Average what hangs on the palm, and then decide what is counted from."""
        if self._count == 0 or stamp < self._begun:
            self._begun, self._sum, self._count = stamp, 0.0, 0
        self._sum, self._count = self._sum + weight, self._count + 1
        if stamp - self._begun < SETTLING:
            return
        now, self._looked, self._count = self._sum / self._count, self._posture, 0
        if self._from is None or abs(now - self._from) < min(SAME, PART * self.weight):
            self._from, self._counted = now, self._posture
