"""Does this object move with the hand? A hidden Markov model over the object's ways between its sights.

Three modes: carried (it goes where the hand goes), lying (it stays), free (it falls, or goes elsewhere). At rest the
first two look alike, and their probability stays what it was; the first motion tells them apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from coglab_py.pose import length

CARRIED, LYING, FREE = range(3)
RATES = np.array([[0.0, 0.02, 0.1], [0.3, 0.0, 0.1], [0.3, 2.0, 0.0]])
"""1/s, from mode (row) to mode: people take things up more readily than they let go; what falls is soon at rest"""
JITTER = 0.003
"""m per axis, by which a hand at rest seems to go between two sights"""


@dataclass(frozen=True)
class CarriedSettings:
    """Lengths in m, times in s."""

    reach: float = 0.25
    """an object farther from the middle of the palm is in no hand"""
    turning: float = 0.3
    """share of the hand's way by which a carried object's way may differ, because the hand turns"""
    free_speed: float = 1.0
    """m/s, standard deviation per axis of the speed of what is free"""
    fastest: float = 2.0
    """m/s: a way at more than this is no way of this object, but of something that the tracker took for it"""
    follow_time: float = 0.12
    """over which the object's place in the hand is averaged"""
    lost_time: float = 0.25
    """after which a place that was not believed is believed"""
    memory: float = 1.0
    """for which an object that is not seen counts as seen"""


class CarriedObject:
    """One object. ``carried`` is the probability that it is in the hand, ``offset`` (m, world axes) its place from
    there."""

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
        """A sight of it, with the hand's position and velocity (m/s) at that stamp and the standard deviation of the
        hand's way beyond the tracker's error (m)."""
        s = self.settings
        gap = stamp - self.stamp
        if gap <= 0.0:
            return
        way, believed = position - self._position, 0.5 * gap * (self._velocity + velocity)
        # James and Stein, by the velocity that is believed: a way that may be nothing but jitter counts as none, or at
        # rest what lies would look likelier.
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
            # The less is known of where the hand is, the less it tells of the object's place in it.
            known = self._noise**2 / (self._noise**2 + hand_error**2)
            follow = known * (1.0 - math.exp(-gap / s.follow_time))
            self.offset = self.offset + follow * (position - hand - self.offset)
        else:
            likely[CARRIED] = 0.0
            self.offset = position - hand
        self._modes = likely / likely.sum()

    def _possible(self, way: np.ndarray, hand_way: np.ndarray, gap: float, error: float) -> bool:
        """Whether an object can have gone a way (m) in a gap (s), but for an error (m). What is free goes anywhere.

        What was not free lies, goes with the hand, or has just left it and falls; any other way is something else's.
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
