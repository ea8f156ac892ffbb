"""Estimates whether an object moves with the hand: a hidden Markov model over its displacements between observations.

There are three modes: carried (it moves with the hand), lying (it stays), free (it falls or moves elsewhere). At rest
the first two look the same, and their probabilities do not change. The first motion distinguishes them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from coglab_py.pose import length

CARRIED, LYING, FREE = range(3)
RATES = np.array([[0.0, 0.02, 0.1], [0.3, 0.0, 0.1], [0.3, 2.0, 0.0]])
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
        self._modes = np.array([0.6, 0.35, 0.05] if near else [0.0, 0.7, 0.3])

    @property
    def carried(self) -> float:
        """Probability, 0..1."""
        return float(self._modes[CARRIED])

    def step(
        self, stamp: float, position: np.ndarray, hand: np.ndarray, velocity: np.ndarray, hand_error: float
    ) -> None:
        """Process an observation of the object. ``hand`` (m) and ``velocity`` (m/s) are those of the hand at that
        stamp; ``hand_error`` (m) is the standard deviation of the hand's displacement beyond the tracker's error."""
        s = self.settings
        gap = stamp - self.stamp
        if gap <= 0.0:
            return
        way, believed = position - self._position, 0.5 * gap * (self._velocity + velocity)
        # James-Stein shrinkage by the expected displacement: one that may be mere jitter counts as zero. Otherwise
        # `lying` would become more likely at rest.
        moved = max(0.0, 1.0 - 3.0 * JITTER**2 / max(1e-12, float(believed @ believed)))
        hand_way = moved * (hand - self._hand)
        error = 2.0 * self._noise**2 * (1.0 - math.exp(-gap / self._noise_time)) + JITTER**2
        if gap < s.lost_time and not self._possible(way, hand_way, gap, 4.0 * math.sqrt(error) + 2.0 * hand_error):
            return
        variances = np.array(
            [
                error + moved * hand_error**2 + s.turning**2 * float(hand_way @ hand_way) / 3.0,
                error,
                error + (s.free_speed * gap) ** 2,
            ]
        )
        misses = np.array([way - hand_way, way, way])
        log = -0.5 * ((misses**2).sum(axis=1) / variances + 3.0 * np.log(variances))
        self.stamp, self._position, self._hand, self._velocity = stamp, position, hand, velocity
        changed = 1.0 - np.exp(-RATES * gap)
        likely = self._modes @ (changed + np.diag(1.0 - changed.sum(axis=1)))
        likely = np.maximum(likely, 1e-6) * np.exp(log - log.max())
        if self._near():
            # The less certain the position of the hand, the less the observation changes the offset.
            known = self._noise**2 / (self._noise**2 + hand_error**2)
            follow = known * (1.0 - math.exp(-gap / s.follow_time))
            self.offset = self.offset + follow * (position - hand - self.offset)
        else:
            likely[CARRIED] = 0.0
            self.offset = position - hand
        self._modes = likely / likely.sum()

    def _possible(self, way: np.ndarray, hand_way: np.ndarray, gap: float, error: float) -> bool:
        """True if an object can have moved by ``way`` (m) in ``gap`` (s), within ``error`` (m). Free: anywhere.

        Another object lies, moves with the hand, or has just left it and falls. Any other motion is a different object.
        """
        if length(way) > self.settings.fastest * gap + error:
            return False
        if self._modes[FREE] > 0.5:
            return True
        error += self.settings.turning * length(hand_way)
        for start in (np.zeros(3), hand_way):
            off = way - start
            off[2] -= min(0.0, max(-self.settings.fastest * gap, off[2]))
            if length(off) <= error:
                return True
        return False

    def _near(self) -> bool:
        return length(self._position - self._hand) < self.settings.reach
