"""Estimates whether a hand moves to a handover and where it will rest: a bank of motion hypotheses over observations.

Bayesian on-line change-point detection (Adams and MacKay 2007) with minimum-jerk motions. At each observation new
motions may have begun, with each duration of a grid, toward a handover or toward any other place. Each hypothesis is a
Kalman filter per axis. Its state is position, velocity, acceleration, end of the motion and the slowly varying error of
the tracker. Its weight is the likelihood of all observations. A completed motion is rest, at a handover or elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from coglab_py.pose import length
from numpy.typing import ArrayLike

from .minimum_jerk import ACCELERATION, END, POSITION, VELOCITY, transition

ERROR = 4  # index of the tracker's error in the state
STATES = 5
NEVER = -math.inf  # arrival time of a hand at rest
SPAWN_STEP = 0.035  # s between the onsets of new motions, if observations are farther apart
UNLIKELY = 13.0  # a hypothesis is dropped when it is less likely than the best one by this factor, as logarithm
WANDER = (
    ((VELOCITY, ACCELERATION, 2.0),),
    ((POSITION, ACCELERATION, 6.0), (VELOCITY, VELOCITY, 3.0)),
    ((POSITION, VELOCITY, 8.0),),
    ((POSITION, POSITION, 20.0),),
)
"""divisors of the covariances that a random walk of the acceleration adds, by the power of the time beyond the first"""


@dataclass(frozen=True)
class ReachSettings:
    """Prior knowledge about the hand. Lengths in m, times in s, rates in 1/s."""

    place: tuple[float, float, float] = (0.86, 0.0, 0.44)
    """mean place of a person's hand at a handover, world axes"""
    place_deviation: tuple[float, float, float] = (0.06, 0.08, 0.08)
    handover_rate: float = 0.2
    """rate of motions from rest toward a handover"""
    other_rate: float = 0.7
    """rate of all other motions"""
    reach_time: float = 1.2
    """median duration of a motion toward a handover"""
    reach_time_deviation: float = 0.25
    """standard deviation of its logarithm"""
    reach_times: tuple[float, ...] = (0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.1, 2.6)
    """s, grid of durations"""
    small_times: tuple[float, ...] = (0.25, 0.4, 0.6, 0.9)
    wide_times: tuple[float, ...] = (0.5, 0.7, 0.9, 1.2, 1.6)
    small_way: float = 0.06
    """standard deviation per axis of the displacements of small other motions, which are as likely as wide ones"""
    wide_way: float = 0.30
    return_rate: float = 1.0
    """rate of motions back to the usual rest, from a place more than 2 return_way away from it"""
    return_way: float = 0.06
    """standard deviation per axis of their ends"""
    home_time: float = 4.0
    """averaging time of the place of the hand's usual rest"""
    correction_rate: float = 0.1
    """rate of changes of a motion's end during the motion, and of displacements of a hand at a handover"""
    correction_times: tuple[float, ...] = (0.45, 0.7, 1.1)
    correction_way: float = 0.10
    """standard deviation per axis of these changes"""
    vertical_shares: tuple[float, ...] = (0.82, 0.95)
    """shares of a reach's duration after which its vertical part is complete (decoupled minimum jerk, Huber et al.
    2009). Both are equally likely; other motions have the last one"""
    noise: float = 0.004
    """standard deviation of the tracker's error per axis"""
    noise_time: float = 0.5
    """correlation time of this error"""
    rest_wander: float = 0.004
    """random walk of a hand at rest, m per square root of s"""
    acceleration_wander: float = 0.8
    """random walk of the acceleration about minimum jerk, m/s^2 per square root of s"""
    end_wander: float = 0.02
    """random walk of the end of a motion, m per square root of s"""
    clutter_density: float = 10.0
    """1/m^3, probability density of an observation of something else. An observation with a lower density is ignored"""
    clutter_again: float = 1e4
    """the same density after such an observation: a tracker that confuses the hand with something else repeats it"""
    hypotheses: int = 150
    """largest number of hypotheses"""


@dataclass(frozen=True)
class _Motions:
    """A family of motions that may begin: durations (s) per axis (3, n), logarithms of their rates (1/s) (n,), variance
    (m^2) of their ends per axis (3, n), and whether each goes toward a handover (n,)."""

    times: np.ndarray
    log_rates: np.ndarray
    variance: np.ndarray
    toward: np.ndarray

    @staticmethod
    def of(
        times: Sequence[float], vertical: float, rates: ArrayLike, deviation: Sequence[float] | float, toward: bool
    ) -> _Motions:
        """``vertical``: factor of the vertical duration; ``rates`` (1/s): one for all durations together, or one for
        each; ``deviation`` in m."""
        n = len(times)
        each = np.asarray(rates, dtype=float)
        each = np.full(n, each / n) if each.ndim == 0 else each
        variance = np.repeat(np.square(np.broadcast_to(deviation, 3))[:, None], n, axis=1)
        return _Motions(np.outer([1.0, 1.0, vertical], times), np.log(each), variance, np.full(n, toward))

    @staticmethod
    def union(families: Sequence[_Motions]) -> _Motions:
        """All motions of some families, in their order."""
        return _Motions(
            np.concatenate([f.times for f in families], axis=1),
            np.concatenate([f.log_rates for f in families]),
            np.concatenate([f.variance for f in families], axis=1),
            np.concatenate([f.toward for f in families]),
        )

    def slower(self, factor: float) -> _Motions:
        """The same motions with their rates multiplied."""
        return replace(self, log_rates=self.log_rates + math.log(factor))


@dataclass(frozen=True)
class _Birth:
    """New motions of one family from one hypothesis: index of that hypothesis, their onset (s), mean of their ends (m),
    and the time (s) during which they could have begun."""

    source: int
    begin: float
    family: str
    end: np.ndarray
    during: float


@dataclass(frozen=True)
class Prediction:
    """Prediction from the motions toward a handover: place (m, mean and covariance) and stamp (s) at which the hand
    comes to rest, onset of the motion (s), and the place of rest before it."""

    end: np.ndarray
    covariance: np.ndarray
    arrival: float
    arrival_deviation: float
    onset: float


class ReachBank:
    """Hypotheses for one hand. Call ``step`` with each observation, in the order of stamps. ``handover`` is then the
    probability that the hand moves toward a handover or waits at one.

    All n hypotheses lie in the last axis of a few arrays, so that each line of the filter treats all of them."""

    def __init__(self, stamp: float, position: np.ndarray, settings: ReachSettings) -> None:
        self.settings = s = settings
        self.stamp = stamp
        ratio = s.handover_rate / (s.handover_rate + s.other_rate)
        at_place = ratio * _density(position - np.array(s.place), np.array(s.place_deviation))
        elsewhere = (1.0 - ratio) * _density(position - np.array(s.place), np.full(3, 0.5))
        # The arrival of a hand that is observed for the first time was not observed. So rest at a handover gets half of
        # its probability.
        share = 0.5 * at_place / (at_place + elsewhere)
        mean = np.zeros((STATES, 3, 2))
        mean[POSITION] = mean[END] = position[:, None]
        cov = np.zeros((STATES, STATES, 3, 2))
        for i in (POSITION, END):
            for j in (POSITION, END):
                cov[i, j] = s.noise**2
        cov[ERROR, ERROR] = s.noise**2
        cov[ERROR, POSITION] = cov[POSITION, ERROR] = -0.5 * s.noise**2
        cov[ERROR, END] = cov[END, ERROR] = -0.5 * s.noise**2
        self._mean, self._cov = mean, cov
        """state (5) per axis (3): mean (5, 3, n) and covariance (5, 5, 3, n), of position, velocity, ..."""
        self._begin = np.full(2, stamp)
        self._onset = np.full(2, stamp)
        self._arrival = np.full((3, 2), NEVER)
        """s (3, n), end of the motion per axis"""
        self._toward = np.array([True, False])
        self._log_weight = np.log(np.array([max(share, 1e-9), 1.0 - share]))
        self._weight = np.exp(self._log_weight)
        self._prediction: Prediction | None = None
        self._predicted = False
        self._place = np.array(s.place)
        self._families = _families(s)
        self._unions: dict[tuple[str, ...], tuple[_Motions, np.ndarray]] = {}
        self._home = position
        self._seen = True

    # -- estimates -------------------------------------------------------------------------------------------------

    @property
    def handover(self) -> float:
        """Probability, 0..1."""
        return float(self._weight @ self._toward)

    def position(self) -> np.ndarray:
        """Expected current position (m), without the tracker's error."""
        position: np.ndarray = self._mean[POSITION] @ self._weight
        return position

    def velocity(self) -> np.ndarray:
        """Expected current velocity (m/s)."""
        velocity: np.ndarray = self._mean[VELOCITY] @ self._weight
        return velocity

    def prediction(self) -> Prediction | None:
        """Prediction of the handover; None if no hypothesis of a motion toward a handover is left."""
        if not self._predicted:
            self._prediction, self._predicted = self._predict_end(), True
        return self._prediction

    def _predict_end(self) -> Prediction | None:
        which = self._toward.nonzero()[0]
        if not len(which):
            return None
        weight = self._weight[which]
        weight /= weight.sum()
        ends = self._mean[END].take(which, axis=1)
        end = ends @ weight
        spread = ends - end[:, None]
        covariance = (spread * weight) @ spread.T
        covariance.ravel()[::4] += self._cov[END, END].take(which, axis=1) @ weight
        arrivals = np.maximum(self._arrival.max(axis=0)[which], self.stamp)
        arrival = float(weight @ arrivals)
        deviation = math.sqrt(float(weight @ (arrivals - arrival) ** 2))
        return Prediction(end, covariance, arrival, deviation, float(weight @ self._onset[which]))

    # -- observations ----------------------------------------------------------------------------------------------

    def step(self, stamp: float, position: np.ndarray) -> bool:
        """Process an observation. False if it does not show this hand or is impossible for a hand; then only the
        prediction to the stamp is done."""
        gap = stamp - self.stamp
        self._add(self._births(stamp))
        self._predict(stamp)
        innovation, variance = self._innovation(position)
        total = self._log_weight - 0.5 * (innovation**2 / variance + np.log(2 * np.pi * variance)).sum(axis=0)
        top = float(total.max())
        evidence = top + math.log(float(np.exp(total - top).sum()))
        s = self.settings
        seen = evidence > math.log(s.clutter_density if self._seen else s.clutter_again)
        self._seen = seen
        if seen:
            self._update(innovation, variance)
            self._log_weight = total
        self._keep(self._likely(self._merge_rest()), normalise=True)
        rests = (self._arrival[0] == NEVER) & ~self._toward
        share = float(self._weight @ rests) * (1.0 - math.exp(-gap / s.home_time))
        self._home = self._home + share * (self.position() - self._home)
        return seen

    def forget(self) -> None:
        """Count every motion toward a handover as another motion from now on."""
        self._toward = np.zeros_like(self._toward)
        self._keep(self._merge_rest())

    def _births(self, stamp: float) -> list[_Birth]:
        """Motions that began since the last observation: from rest, and changes of motions in progress."""
        resting = self._arrival[0] == NEVER
        gap = stamp - self.stamp
        begins = (self.stamp + np.arange(0.0, gap, max(SPAWN_STEP, gap / 8.0))).tolist()
        born: list[_Birth] = []
        for source in resting.nonzero()[0].tolist():
            here = self._mean[POSITION, :, source]
            for begin in begins:
                during = gap / len(begins)
                if self._toward[source]:
                    born.append(_Birth(source, begin, "corrected", here, during))
                    born.append(_Birth(source, begin, "left", here, during))
                    born.append(_Birth(source, begin, "retreated", self._home, during))
                else:
                    born.append(_Birth(source, begin, "reaches", self._place, during))
                    born.append(_Birth(source, begin, "others", here, during))
                    if length(here - self._home) > 2.0 * self.settings.return_way:
                        born.append(_Birth(source, begin, "returned", self._home, during))
        for toward in (True, False):
            moving = (~resting & (self._toward == toward)).nonzero()[0]
            if not len(moving):
                continue
            source = int(moving[self._log_weight[moving].argmax()])
            here = self._mean[POSITION, :, source]
            end = self._mean[END, :, source] if toward else self._place
            born.append(_Birth(source, self.stamp, "corrected" if toward else "joined", end, gap))
            born.append(_Birth(source, self.stamp, "withdrawn" if toward else "turned", here, gap))
        return born

    def _add(self, born: Sequence[_Birth]) -> None:
        """Add motions as copies of the hypotheses that they begin from, with other ends."""
        if not born:
            return
        names = tuple(b.family for b in born)
        if names not in self._unions:
            families = [self._families[name] for name in names]
            which = np.repeat(np.arange(len(families)), [len(f.log_rates) for f in families])
            self._unions[names] = _Motions.union(families), which
        new, which = self._unions[names]
        source = np.array([b.source for b in born])[which]
        begin = np.array([b.begin for b in born])[which]
        n = len(self._log_weight)
        every = np.concatenate([np.arange(n), source])
        self._mean = self._mean.take(every, axis=-1)
        self._cov = self._cov.take(every, axis=-1)
        self._mean[END, :, n:] = np.array([b.end for b in born]).T[:, which]
        self._cov[END, :, :, n:] = self._cov[:, END, :, n:] = 0.0
        self._cov[END, END, :, n:] = new.variance
        share = new.log_rates + np.log([b.during for b in born])[which]
        self._log_weight = np.concatenate([self._log_weight, self._log_weight[source] + share])
        self._begin = np.concatenate([self._begin, begin])
        # The onset of a changed reach is the onset of the original one.
        changed = self._toward[source] & new.toward
        self._onset = np.concatenate([self._onset, np.where(changed, self._onset[source], begin)])
        self._arrival = np.concatenate([self._arrival, begin + new.times], axis=1)
        self._toward = np.concatenate([self._toward, new.toward])

    def _predict(self, stamp: float) -> None:
        s = self.settings
        gap = stamp - self.stamp
        resting = self._arrival == NEVER
        # A motion that began after the last observation has only moved since its onset.
        since = np.where(resting, gap, stamp - np.maximum(self.stamp, self._begin))
        remaining = np.where(resting, 0.0, self._arrival - (stamp - since))
        over = since >= remaining - 1e-9
        moves = transition(remaining, since)
        keep = math.exp(-gap / s.noise_time)
        mean, cov = self._mean, self._cov
        mean[:END] = np.einsum("ij...,j...->i...", moves, mean[:ERROR])
        mean[ERROR] *= keep
        half = np.einsum("ij...,jk...->ik...", moves, cov[:ERROR])
        half[:, ERROR] *= keep
        cov[:END, :END] = np.einsum("ij...,kj...->ik...", half[:, :ERROR], moves)
        cov[:END, END:] = half[:, END:]
        cov[END:, :END] = half[:, END:].swapaxes(0, 1)
        cov[END, ERROR] *= keep
        cov[ERROR, END] *= keep
        cov[ERROR, ERROR] *= keep**2
        cov[ERROR, ERROR] += s.noise**2 * (1.0 - keep**2)
        # Equal for all hypotheses of rest: otherwise the one that fits a still hand better would win in time.
        wander = np.where(resting, s.rest_wander**2, s.end_wander**2) * since
        cov[END, END] += wander
        wander[~over] = 0.0
        for i, j in ((POSITION, POSITION), (POSITION, END), (END, POSITION)):
            cov[i, j] += wander
        # A random walk of the acceleration, integrated.
        bent = np.where(over, 0.0, s.acceleration_wander**2) * since
        cov[ACCELERATION, ACCELERATION] += bent
        for terms in WANDER:
            bent = bent * since
            for i, j, part in terms:
                cov[i, j] += bent / part
        for i, j in ((VELOCITY, ACCELERATION), (POSITION, ACCELERATION), (POSITION, VELOCITY)):
            cov[j, i] = cov[i, j]
        self.stamp = stamp

    def _innovation(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Difference of an observation to each hypothesis (m), and its variance (m^2); both (3, n)."""
        mean, cov = self._mean, self._cov
        variance = cov[POSITION, POSITION] + 2.0 * cov[POSITION, ERROR] + cov[ERROR, ERROR] + 1e-8
        return position[:, None] - mean[POSITION] - mean[ERROR], variance

    def _update(self, innovation: np.ndarray, variance: np.ndarray) -> None:
        seen = self._cov[:, POSITION] + self._cov[:, ERROR]
        gain = seen / variance
        self._mean += gain * innovation
        self._cov -= gain[:, None] * seen

    def _merge_rest(self) -> np.ndarray:
        """Merge all completed motions of a kind into one rest of that kind, with their mean and covariance. Returns
        which hypotheses (n,) are left."""
        left = np.full(len(self._log_weight), True)
        over = self._arrival.max(axis=0) <= self.stamp + 1e-9
        for kind in (over & self._toward, over & ~self._toward):
            these = kind.nonzero()[0]
            if not len(these):
                continue
            first = these[0]
            if len(these) > 1:
                log = self._log_weight[these]
                top = log.max()
                total = top + math.log(float(np.exp(log - top).sum()))
                weight = np.exp(log - total)
                means = self._mean.take(these, axis=-1)
                mean = means @ weight
                spread = means - mean[..., None]
                cov = self._cov.take(these, axis=-1) @ weight
                cov += np.einsum("iak,jak->ija", spread * weight, spread)
                self._mean[..., first], self._cov[..., first] = mean, cov
                self._onset[first] = weight @ self._onset[these]
                self._log_weight[first] = total
                left[these[1:]] = False
            self._begin[first] = self.stamp
            self._arrival[:, first] = NEVER
        return left

    def _likely(self, left: np.ndarray) -> np.ndarray:
        """Which of the hypotheses ``left`` (n,) are likely enough to be kept, at most ``settings.hypotheses``."""
        log = np.where(left, self._log_weight, -math.inf)
        likely: np.ndarray = log > log.max() - UNLIKELY
        most = self.settings.hypotheses
        if np.count_nonzero(likely) > most:
            dropped = np.argpartition(-np.where(likely, log, -math.inf), most)[most:]
            likely[dropped] = False
        return likely

    def _keep(self, which: np.ndarray, normalise: bool = False) -> None:
        """Drop all hypotheses but these (n,)."""
        self._predicted = False
        if not which.all():
            index = which.nonzero()[0]
            self._mean, self._cov = self._mean.take(index, axis=-1), self._cov.take(index, axis=-1)
            self._begin, self._onset = self._begin[index], self._onset[index]
            self._arrival, self._toward = self._arrival.take(index, axis=1), self._toward[index]
            self._log_weight = self._log_weight[index]
        if normalise:
            top = float(self._log_weight.max())
            self._log_weight = self._log_weight - (top + math.log(float(np.exp(self._log_weight - top).sum())))
        self._weight = np.exp(self._log_weight)


def _families(s: ReachSettings) -> dict[str, _Motions]:
    """The families of motions that may begin, by name."""
    scale = np.log(np.array(s.reach_times) / s.reach_time) / s.reach_time_deviation
    likely = np.exp(-0.5 * scale**2)
    shares = s.vertical_shares
    rates = s.handover_rate * likely / likely.sum() / len(shares)
    vertical, rate, wide = shares[-1], s.correction_rate, s.wide_way
    others = _Motions.union(
        [
            _Motions.of(s.small_times, vertical, s.other_rate / 2, s.small_way, False),
            _Motions.of(s.wide_times, vertical, s.other_rate / 2, wide, False),
        ]
    )
    return {
        "reaches": _Motions.union([_Motions.of(s.reach_times, v, rates, s.place_deviation, True) for v in shares]),
        "corrected": _Motions.of(s.correction_times, vertical, rate, s.correction_way, True),
        "joined": _Motions.of(s.correction_times, vertical, rate, s.place_deviation, True),
        "others": others,
        "turned": others.slower(rate / s.other_rate),
        "withdrawn": _Motions.of(s.wide_times, vertical, rate, wide, False),
        "left": _Motions.of(s.wide_times, vertical, rate / 2, wide, False),
        "retreated": _Motions.of(s.wide_times, vertical, rate / 2, s.return_way, False),
        "returned": _Motions.of(s.wide_times, vertical, s.return_rate, s.return_way, False),
    }


def _density(way: np.ndarray, deviation: np.ndarray) -> float:
    """Density (1/m^3) of a normal distribution with independent axes."""
    return float(np.prod(np.exp(-0.5 * (way / deviation) ** 2) / (math.sqrt(2 * math.pi) * deviation)))
