"""Estimates whether an object moves with the hand: a hidden Markov model over its displacements between observations.

There are three modes: carried (it moves with the hand), lying (it stays), free (it falls or moves elsewhere). At rest
the first two look the same, and their probabilities do not change. The first motion distinguishes them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from coglab_py.pose import length

CARRIED, LYING, FREE = range(3)
RATES = ((0.0, 0.02, 0.1), (0.3, 0.0, 0.1), (0.3, 2.0, 0.0))
"""1/s, rates from mode (row) to mode. People pick up more readily than they let go; a falling object soon rests"""
JITTER = 0.003  # m per axis, apparent displacement of a resting hand between two observations


@dataclass(frozen=True)
class CarriedSettings:
    """Settings for carried objects. Lengths in m, times in s."""

    reach: float = 0.25
    """an object farther from the middle of the palm is not in the hand"""
    turning: float = 0.3
    """share of the hand's displacement by which that of a carried object may differ, because the hand turns"""
    free_speed: float = 1.0
    """m/s, standard deviation per axis of the velocity of a free object"""
    fastest: float = 2.0
    """m/s; a faster displacement is not this object but another one that the tracker confused with it"""
    follow_time: float = 0.12
    """averaging time of the object's offset from the hand"""
    lost_time: float = 0.25
    """time after which a rejected place is accepted"""
    memory: float = 1.0
    """time for which an object counts as observed after its last observation"""


class CarriedObject:
    """One object. ``carried`` is the probability that it is in the hand, ``offset`` (m, world axes) its position
    relative to the hand."""

    def __init__(
        self,
        stamp: float,
        position: np.ndarray,
        hand: np.ndarray,
        noise: tuple[float, float],
        settings: CarriedSettings,
    ) -> None:
        self.settings = settings
        self.stamp = stamp
        self.offset = position - hand
        self._noise, self._noise_time = noise
        self._position, self._hand, self._velocity = position, hand, np.zeros(3)
        near = self._near()
        self._modes = [0.6, 0.35, 0.05] if near else [0.0, 0.7, 0.3]

    @property
    def carried(self) -> float:
        """Probability, 0..1."""
        return self._modes[CARRIED]

    def step(
        self, stamp: float, position: np.ndarray, hand: np.ndarray, velocity: np.ndarray, hand_error: float
    ) -> None:
        """Process an observation of the object. ``hand`` (m) and ``velocity`` (m/s) are those of the hand at that
        stamp; ``hand_error`` (m) is the standard deviation of the hand's displacement beyond the tracker's error."""
        s = self.settings
        gap = stamp - self.stamp
        if gap <= 0.0:
            return
        # Three numbers at a time: plain floats are several times faster than arrays.
        way = (position - self._position).tolist()
        believed = (0.5 * gap * (self._velocity + velocity)).tolist()
        # James-Stein shrinkage by the expected displacement: one that may be mere jitter counts as zero. Otherwise
        # `lying` would become more likely at rest.
        moved = max(0.0, 1.0 - 3.0 * JITTER**2 / max(1e-12, _square(believed)))
        hand_way = (moved * (hand - self._hand)).tolist()
        error = 2.0 * self._noise**2 * (1.0 - math.exp(-gap / self._noise_time)) + JITTER**2
        if gap < s.lost_time and not self._possible(way, hand_way, gap, 4.0 * math.sqrt(error) + 2.0 * hand_error):
            return
        variances = (
            error + moved * hand_error**2 + s.turning**2 * _square(hand_way) / 3.0,
            error,
            error + (s.free_speed * gap) ** 2,
        )
        still = _square(way)
        misses = (_square([a - b for a, b in zip(way, hand_way, strict=True)]), still, still)
        log = [-0.5 * (miss / v + 3.0 * math.log(v)) for miss, v in zip(misses, variances, strict=True)]
        self.stamp, self._position, self._hand, self._velocity = stamp, position, hand, velocity
        top = max(log)
        likely = [
            max(share, 1e-6) * math.exp(one - top) for share, one in zip(_later(self._modes, gap), log, strict=True)
        ]
        if self._near():
            # The less certain the position of the hand, the less the observation changes the offset.
            known = self._noise**2 / (self._noise**2 + hand_error**2)
            follow = known * (1.0 - math.exp(-gap / s.follow_time))
            self.offset = self.offset + follow * (position - hand - self.offset)
        else:
            likely[CARRIED] = 0.0
            self.offset = position - hand
        total = sum(likely)
        self._modes = [share / total for share in likely]

    def _possible(self, way: Sequence[float], hand_way: Sequence[float], gap: float, error: float) -> bool:
        """True if an object can have moved by ``way`` (m) in ``gap`` (s), within ``error`` (m). Free: anywhere.

        Another object lies, moves with the hand, or has just left it and falls. Any other motion is a different object.
        """
        if math.sqrt(_square(way)) > self.settings.fastest * gap + error:
            return False
        if self._modes[FREE] > 0.5:
            return True
        error += self.settings.turning * math.sqrt(_square(hand_way))
        for start in ((0.0, 0.0, 0.0), hand_way):
            x, y, z = (a - b for a, b in zip(way, start, strict=True))
            z -= min(0.0, max(-self.settings.fastest * gap, z))
            if math.sqrt(_square((x, y, z))) <= error:
                return True
        return False

    def _near(self) -> bool:
        return length(self._position - self._hand) < self.settings.reach


def _square(vector: Sequence[float]) -> float:
    """Squared length of three numbers."""
    x, y, z = vector
    return x * x + y * y + z * z


def _later(modes: Sequence[float], gap: float) -> list[float]:
    """Probabilities of the modes ``gap`` s later, before the observation."""
    later = list(modes)
    for mode in (CARRIED, LYING, FREE):
        for other in (CARRIED, LYING, FREE):
            if other != mode:
                changed = modes[mode] * (1.0 - math.exp(-RATES[mode][other] * gap))
                later[mode] -= changed
                later[other] += changed
    return later
