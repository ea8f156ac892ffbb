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
from functools import reduce

import numpy as np
from coglab_py.pose import length

from .minimum_jerk import ACCELERATION, END, POSITION, VELOCITY, transition

ERROR = 4  # index of the tracker's error in the state
STATES = 5
NEVER = -math.inf  # arrival time of a hand at rest
SPAWN_STEP = 0.035  # s between the onsets of new motions, if observations are farther apart


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
    """A family of motions that may begin: durations (s) per axis, rates (1/s), variance (m^2) of their ends per axis,
    and whether they go toward a handover."""

    times: np.ndarray
    rates: np.ndarray
    variance: np.ndarray
    toward: bool

    @staticmethod
    def of(
        times: Sequence[float], vertical: float, rate: float, deviation: Sequence[float] | float, toward: bool
    ) -> _Motions:
        """Motions with equally likely durations. ``vertical``: factor of the vertical duration; ``deviation`` in m."""
        n = len(times)
        variance = np.full((n, 3), np.square(deviation))
        return _Motions(np.outer(times, [1.0, 1.0, vertical]), np.full(n, rate / n), variance, toward)

    def and_(self, other: _Motions) -> _Motions:
        """The union of both families."""
        return _Motions(
            np.concatenate([self.times, other.times]),
            np.append(self.rates, other.rates),
            np.concatenate([self.variance, other.variance]),
            self.toward,
        )


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
    probability that the hand moves toward a handover or waits at one."""

    def __init__(self, stamp: float, position: np.ndarray, settings: ReachSettings) -> None:
        self.settings = s = settings
        self.stamp = stamp
        ratio = s.handover_rate / (s.handover_rate + s.other_rate)
        at_place = ratio * _density(position - np.array(s.place), np.array(s.place_deviation))
        elsewhere = (1.0 - ratio) * _density(position - np.array(s.place), np.full(3, 0.5))
        # The arrival of a hand that is observed for the first time was not observed. So rest at a handover gets half of
        # its probability.
        share = 0.5 * at_place / (at_place + elsewhere)
        mean: np.ndarray = np.zeros((2, 3, STATES))
        mean[..., POSITION] = mean[..., END] = position
        cov: np.ndarray = np.zeros((2, 3, STATES, STATES))
        for i in (POSITION, END):
            for j in (POSITION, END):
                cov[..., i, j] = s.noise**2
        cov[..., ERROR, ERROR] = s.noise**2
        cov[..., ERROR, POSITION] = cov[..., POSITION, ERROR] = -0.5 * s.noise**2
        cov[..., ERROR, END] = cov[..., END, ERROR] = -0.5 * s.noise**2
        self._mean, self._cov = mean, cov
        self._begin: np.ndarray = np.full(2, stamp)
        self._onset: np.ndarray = np.full(2, stamp)
        self._arrival: np.ndarray = np.full((2, 3), NEVER)
        self._toward: np.ndarray = np.array([True, False])
        self._log_weight = np.log(np.array([max(share, 1e-9), 1.0 - share]))
        self._place = np.array(s.place)
        scale = np.log(np.array(s.reach_times) / s.reach_time) / s.reach_time_deviation
        likely = np.exp(-0.5 * scale**2)
        vertical, rate, wide = s.vertical_shares[-1], s.correction_rate, s.wide_way
        by_share = [_Motions.of(s.reach_times, v, 1.0, s.place_deviation, True) for v in s.vertical_shares]
        self._reaches = replace(
            reduce(_Motions.and_, by_share),
            rates=np.tile(s.handover_rate * likely / likely.sum(), len(by_share)) / len(by_share),
        )
        self._corrected = _Motions.of(s.correction_times, vertical, rate, s.correction_way, True)
        self._joined = _Motions.of(s.correction_times, vertical, rate, s.place_deviation, True)
        self._others = _Motions.of(s.small_times, vertical, s.other_rate / 2, s.small_way, False).and_(
            _Motions.of(s.wide_times, vertical, s.other_rate / 2, wide, False)
        )
        self._turned = replace(self._others, rates=self._others.rates * rate / s.other_rate)
        self._withdrawn = _Motions.of(s.wide_times, vertical, rate, wide, False)
        self._left = _Motions.of(s.wide_times, vertical, rate / 2, wide, False)
        self._retreated = _Motions.of(s.wide_times, vertical, rate / 2, s.return_way, False)
        self._returned = _Motions.of(s.wide_times, vertical, s.return_rate, s.return_way, False)
        self._home = position
        self._seen = True

    # -- estimates -------------------------------------------------------------------------------------------------

    @property
    def handover(self) -> float:
        """Probability, 0..1."""
        return float(np.exp(self._log_weight[self._toward]).sum())

    def position(self) -> np.ndarray:
        """Expected current position (m), without the tracker's error."""
        position: np.ndarray = np.einsum("i,ij->j", np.exp(self._log_weight), self._mean[..., POSITION])
        return position

    def velocity(self) -> np.ndarray:
        """Expected current velocity (m/s)."""
        velocity: np.ndarray = np.einsum("i,ij->j", np.exp(self._log_weight), self._mean[..., VELOCITY])
        return velocity

    def prediction(self) -> Prediction | None:
        """Prediction of the handover; None if no hypothesis of a motion toward a handover is left."""
        if not self._toward.any():
            return None
        weight = np.exp(self._log_weight[self._toward] - self._log_weight[self._toward].max())
        weight /= weight.sum()
        ends = self._mean[self._toward][..., END]
        end = weight @ ends
        spread = ends - end
        covariance = np.einsum("i,ij,ik->jk", weight, spread, spread)
        covariance += np.diag(weight @ self._cov[self._toward][..., END, END])
        arrivals = np.maximum(self._arrival[self._toward].max(axis=1), self.stamp)
        arrival = float(weight @ arrivals)
        deviation = math.sqrt(float(weight @ (arrivals - arrival) ** 2))
        return Prediction(end, covariance, arrival, deviation, float(weight @ self._onset[self._toward]))

    # -- observations ----------------------------------------------------------------------------------------------

    def step(self, stamp: float, position: np.ndarray) -> bool:
        """Process an observation. False if it does not show this hand or is impossible for a hand; then only the
        prediction to the stamp is done."""
        gap = stamp - self.stamp
        self._spawn(stamp)
        self._predict(stamp)
        log_likelihood = self._log_likelihood(position)
        total = self._log_weight + log_likelihood
        top = float(total.max())
        evidence = top + math.log(float(np.exp(total - top).sum()))
        s = self.settings
        seen = evidence > math.log(s.clutter_density if self._seen else s.clutter_again)
        self._seen = seen
        if seen:
            self._update(position)
            self._log_weight = total
        self._merge_rest()
        self._prune()
        rests = (self._arrival[:, 0] == NEVER) & ~self._toward
        share = float(np.exp(self._log_weight[rests]).sum()) * (1.0 - math.exp(-gap / self.settings.home_time))
        self._home = self._home + share * (self.position() - self._home)
        return seen

    def forget(self) -> None:
        """Count every motion toward a handover as another motion from now on."""
        self._toward = np.zeros_like(self._toward)
        self._merge_rest()

    def _spawn(self, stamp: float) -> None:
        """Add motions that began since the last observation: from rest, and changes of motions in progress."""
        resting = self._arrival[:, 0] == NEVER
        gap = stamp - self.stamp
        begins = self.stamp + np.arange(0.0, gap, max(SPAWN_STEP, gap / 8.0))
        born: list[tuple[int, float, _Motions, np.ndarray, float]] = []
        for source in np.flatnonzero(resting):
            toward = bool(self._toward[source])
            here = self._mean[source][:, POSITION]
            for begin in begins:
                during = gap / len(begins)
                if toward:
                    born.append((source, begin, self._corrected, here, during))
                    born.append((source, begin, self._left, here, during))
                    born.append((source, begin, self._retreated, self._home, during))
                else:
                    born.append((source, begin, self._reaches, self._place, during))
                    born.append((source, begin, self._others, here, during))
                    if length(here - self._home) > 2.0 * self.settings.return_way:
                        born.append((source, begin, self._returned, self._home, during))
        for toward in (True, False):
            moving = np.flatnonzero(~resting & (self._toward == toward))
            if not len(moving):
                continue
            source = moving[np.argmax(self._log_weight[moving])]
            end = self._mean[source][:, END] if toward else self._place
            born.append((source, self.stamp, self._corrected if toward else self._joined, end, gap))
            here = self._mean[source][:, POSITION]
            born.append((source, self.stamp, self._withdrawn if toward else self._turned, here, gap))
        if born:
            self._add(born)

    def _add(self, born: list[tuple[int, float, _Motions, np.ndarray, float]]) -> None:
        """Add motions (source, onset in s, family, mean of their ends in m, s during which they could have begun)."""
        counts = [len(motions.times) for _, _, motions, _, _ in born]
        source = np.repeat([b[0] for b in born], counts)
        begin = np.repeat([b[1] for b in born], counts)
        mean, cov = self._mean[source], self._cov[source]
        mean[..., END] = np.repeat([b[3] for b in born], counts, axis=0)
        cov[..., END, :] = cov[..., :, END] = 0.0
        cov[..., END, END] = np.concatenate([b[2].variance for b in born])
        times = np.concatenate([b[2].times for b in born])
        share = np.concatenate([b[2].rates * b[4] for b in born])
        self._log_weight = np.append(self._log_weight, self._log_weight[source] + np.log(share))
        self._mean = np.concatenate([self._mean, mean])
        self._cov = np.concatenate([self._cov, cov])
        self._begin = np.append(self._begin, begin)
        # The onset of a changed reach is the onset of the original one.
        changed = self._toward[source] & np.repeat([b[2].toward for b in born], counts)
        self._onset = np.append(self._onset, np.where(changed, self._onset[source], begin))
        self._arrival = np.concatenate([self._arrival, begin[:, None] + times])
        self._toward = np.append(self._toward, np.repeat([b[2].toward for b in born], counts))

    def _predict(self, stamp: float) -> None:
        s = self.settings
        gap = stamp - self.stamp
        resting = self._arrival == NEVER
        # A motion that began after the last observation has only moved since its onset.
        since = np.where(resting, gap, stamp - np.maximum(self.stamp, self._begin)[:, None])
        remaining = np.where(resting, 0.0, self._arrival - (stamp - since))
        over = since >= remaining - 1e-9
        a = np.zeros((*since.shape, STATES, STATES))
        a[..., :ERROR, :ERROR] = transition(remaining, since)
        keep = math.exp(-gap / s.noise_time)
        a[..., ERROR, ERROR] = keep
        self._mean = np.matmul(a, self._mean[..., None])[..., 0]
        self._cov = np.matmul(np.matmul(a, self._cov), np.swapaxes(a, -1, -2))
        self._cov[..., ERROR, ERROR] += s.noise**2 * (1.0 - keep**2)
        # Equal for all hypotheses of rest: otherwise the one that fits a still hand better would win in time.
        wander = np.where(resting, s.rest_wander**2, s.end_wander**2) * since
        self._cov[..., END, END] += wander
        for i, j in ((POSITION, POSITION), (POSITION, END), (END, POSITION)):
            self._cov[..., i, j] += np.where(over, wander, 0.0)
        bent = np.where(over, 0.0, s.acceleration_wander**2) * since
        self._cov[..., ACCELERATION, ACCELERATION] += bent
        for i, j, power in ((VELOCITY, VELOCITY, 2), (POSITION, POSITION, 4)):
            self._cov[..., i, j] += bent * since**power / (3.0 if power == 2 else 20.0)
        for i, j, power, part in (
            (VELOCITY, ACCELERATION, 1, 2.0),
            (POSITION, ACCELERATION, 2, 6.0),
            (POSITION, VELOCITY, 3, 8.0),
        ):
            self._cov[..., i, j] += bent * since**power / part
            self._cov[..., j, i] = self._cov[..., i, j]
        self.stamp = stamp

    def _innovation(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        c = self._cov
        variance = c[..., POSITION, POSITION] + 2.0 * c[..., POSITION, ERROR] + c[..., ERROR, ERROR] + 1e-8
        return position - self._mean[..., POSITION] - self._mean[..., ERROR], variance

    def _log_likelihood(self, position: np.ndarray) -> np.ndarray:
        innovation, variance = self._innovation(position)
        result: np.ndarray = -0.5 * (innovation**2 / variance + np.log(2 * np.pi * variance)).sum(axis=1)
        return result

    def _update(self, position: np.ndarray) -> None:
        innovation, variance = self._innovation(position)
        seen = self._cov[..., POSITION] + self._cov[..., ERROR]
        gain = seen / variance[..., None]
        self._mean = self._mean + gain * innovation[..., None]
        self._cov = self._cov - gain[..., :, None] * seen[..., None, :]

    def _merge_rest(self) -> None:
        """Merge all completed motions of a kind into one rest of that kind, with their mean and covariance."""
        over = self._arrival.max(axis=1) <= self.stamp + 1e-9
        rest = []
        for toward in (True, False):
            these = np.flatnonzero(over & (self._toward == toward))
            if not len(these):
                continue
            log = self._log_weight[these]
            total = log.max() + math.log(float(np.exp(log - log.max()).sum()))
            weight = np.exp(log - total)
            mean = np.einsum("i,ijk->jk", weight, self._mean[these])
            spread = self._mean[these] - mean
            cov = np.einsum("i,ijkl->jkl", weight, self._cov[these])
            cov += np.einsum("i,ijk,ijl->jkl", weight, spread, spread)
            rest.append((mean, cov, float(weight @ self._onset[these]), toward, total))
        kept = ~over
        if rest:
            self._mean = np.concatenate([self._mean[kept], np.array([r[0] for r in rest])])
            self._cov = np.concatenate([self._cov[kept], np.array([r[1] for r in rest])])
            self._begin = np.append(self._begin[kept], np.full(len(rest), self.stamp))
            self._onset = np.append(self._onset[kept], [r[2] for r in rest])
            self._arrival = np.concatenate([self._arrival[kept], np.full((len(rest), 3), NEVER)])
            self._toward = np.append(self._toward[kept], [r[3] for r in rest])
            self._log_weight = np.append(self._log_weight[kept], [r[4] for r in rest])

    def _prune(self) -> None:
        """Drop unlikely hypotheses and normalise the weights."""
        top = float(self._log_weight.max())
        keep = np.flatnonzero(self._log_weight > top - 13.0)
        if len(keep) > self.settings.hypotheses:
            best = np.argpartition(-self._log_weight[keep], self.settings.hypotheses)[: self.settings.hypotheses]
            keep = keep[best]
        self._mean, self._cov = self._mean[keep], self._cov[keep]
        self._begin, self._onset = self._begin[keep], self._onset[keep]
        self._arrival, self._toward = self._arrival[keep], self._toward[keep]
        log = self._log_weight[keep]
        self._log_weight = log - (top + math.log(float(np.exp(log - top).sum())))


def _density(way: np.ndarray, deviation: np.ndarray) -> float:
    """Density (1/m^3) of a normal distribution with independent axes."""
    return float(np.prod(np.exp(-0.5 * (way / deviation) ** 2) / (math.sqrt(2 * math.pi) * deviation)))
