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

SMOOTH = 0.015
"""s, time constant of the low-pass of each force"""
USUAL = 0.5
"""s, time constant of the load that is felt while nobody takes it"""
NOISE = 3.0
"""deviations of one component up to which a low-passed force is none"""
OLDEST = 0.1
"""s after which touch tells nothing any more; after such a gap it begins anew"""
COVERED = 0.3
"""share of the weight by which the usual load may differ from it; where it is more, contacts miss the sensors"""
EXACT = 0.1
"""N, deviation of the felt load of sensors without noise: their place and scale"""
APART = 2.0
"""deviations of the torques' load by which touch may differ from it while both are believed"""


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
        self._forces: np.ndarray | None = None
        """n x 3, N on each phalanx and the palm, ih2_palm, low-passed"""
        self._stamp = 0.0
        self._noise = 0.0
        """N, deviation of one component as measured"""
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
