"""Size of the momentum observer's residual without contact, learnt from the robot's own reaches.

The detector uses the change of the residual against its own recent mean, so that sensor offsets, a wrong payload and
other slow errors of the model cancel. The mean is long, because its noise is part of the change. The fast errors are
learnt. Torques that lag behind positions look like a push when the acceleration changes. An object that is heavier than
in its file looks like a push when the hand turns or accelerates. The variance of the change, per joint, is a sum of
shares that grow with speed, acceleration and the torque of the set payload. The shares are learnt by non-negative least
squares, after the lag. Then the change is explained by a force on the palm (generalised least squares). The length of
that force in standard deviations is compared with a limit that reaches without contact exceed with a chosen probability
(Gumbel's law for the largest value of each reach).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from coglab_py.yaml_file import read
from scipy.optimize import nnls

from coglab_contact.momentum_observer import Residual

FEATURES = (
    "constant",
    "speed",
    "speed squared",
    "speed squared a moment ago",
    "acceleration squared",
    "torque of the load squared",
)
"""Terms of the variance (Nm^2): 1; v (rad/s, fastest joint, averaged over the memory of the residual); v^2; v^2 in the
time of the reference mean; a^2 (rad/s^2, joint with the largest acceleration); and, for each joint, the square of the
change (Nm) of the torque that carries and accelerates the set payload"""
FLOOR = 1e-4  # Nm^2, lower limit of the variance: in a noise-free simulation, rounding must not trigger
RECENT = 0.10  # s, age of the newest sample of the reference mean
OLD = 0.60  # s, age of its oldest sample
LATELY = 0.25  # s, age of the oldest sample of the mean for an offset
MEMORY = 0.025  # s, averaging time of speeds and payload torque; about the time constant of the residual
LEAST = 20  # smallest number of samples of the reference mean
CONFIRM = 2  # consecutive samples over the limit
ALARM_SHARE = 2e-3  # probability with which a reach without contact may exceed the limit
EULER = 0.5772156649015329
AXES = np.eye(3)
WEIGHT = np.array([0.0, 0.0, 9.81])  # m/s^2, acceleration for carrying, base frame
LONGEST_LAG = 0.01  # s, largest plausible lag


class ThresholdError(ValueError):
    """Thresholds cannot be used or learnt. The sentence gives the reason."""


@dataclass(frozen=True)
class Offset:
    """Residual at rest after a motion minus that before it, Nm, with the palm's 3 x 7 Jacobian there."""

    torque: np.ndarray
    jacobian: np.ndarray


@dataclass(frozen=True)
class Change:
    """Change of the residual at one sample, Nm; the terms of its variance; the joint positions, rad."""

    stamp: float
    torque: np.ndarray
    features: np.ndarray
    """7 x FEATURES"""
    rate: np.ndarray
    """Nm/s, derivative of this change with respect to the lag: the torque's rate"""
    position: np.ndarray
    jacobian_at: Callable[[np.ndarray], np.ndarray]

    @cached_property
    def jacobian(self) -> np.ndarray:
        """The palm's 3 x 7 Jacobian at this position. Computed on demand, which is rare."""
        return self.jacobian_at(self.position)


class ChangeOfResidual:
    """Change of the residual against its own recent mean."""

    def __init__(self, jacobian: Any) -> None:
        """``jacobian``: converts joint positions (rad) to the 3 x 7 matrix, m/rad, base frame."""
        self._jacobian = jacobian
        self._recent: deque[tuple[float, np.ndarray]] = deque()
        self._old: deque[tuple[float, np.ndarray]] = deque()
        self.reset()

    def reset(self) -> None:
        """Delete the past."""
        self._recent.clear()
        self._old.clear()
        self._speed: float | None = None
        self._stamp = 0.0
        self._sum = np.zeros(22)
        self._palm: np.ndarray | None = None
        self._carried = np.zeros(7)

    @property
    def past(self) -> np.ndarray:
        """Nm, mean of the samples between RECENT and LATELY; fewer samples than for the change."""
        return np.asarray(np.mean([all_of[:7] for at, all_of in self._old if at >= self._stamp - LATELY], axis=0))

    def _needed(self, residual: Residual, load: float, step: float, blend: float) -> np.ndarray:
        """Returns the low-passed torque (Nm) that carries and accelerates the payload."""
        if not load > 0.0:
            return self._carried
        jacobian = self._jacobian(residual.position)
        palm = jacobian @ residual.velocity
        hastened = WEIGHT if self._palm is None or step <= 0.0 else WEIGHT + (palm - self._palm) / step
        needed = load * (jacobian.T @ hastened)
        self._carried = needed if self._palm is None else self._carried + blend * (needed - self._carried)
        self._palm = palm
        return self._carried

    def feed(self, residual: Residual, load: float) -> Change | None:
        """Process one residual with the payload ``load`` (kg). None until there is a reference mean."""
        if residual.fresh:
            self.reset()
        speed = float(np.abs(residual.velocity).max()) ** 2
        step = residual.stamp - self._stamp
        blend = 1.0 if self._speed is None else 1.0 - float(np.exp(-step / MEMORY))
        # Residual, its rate, payload torque and squared speed share one running sum.
        now = np.empty(22)
        now[:7], now[7:14], now[21] = residual.torque, residual.rate, speed
        now[14:21] = self._needed(residual, load, step, blend)
        self._recent.append((residual.stamp, now))
        while self._recent and self._recent[0][0] <= residual.stamp - RECENT:
            self._old.append(self._recent.popleft())
            self._sum = self._sum + self._old[-1][1]
        while self._old and self._old[0][0] < residual.stamp - OLD:
            self._sum = self._sum - self._old.popleft()[1]
        self._speed = speed if self._speed is None else self._speed + blend * (speed - self._speed)
        self._stamp = residual.stamp
        if len(self._old) < LEAST:
            return None
        mean = self._sum / len(self._old)
        acceleration = float(np.abs(residual.acceleration).max())
        features = np.empty((7, len(FEATURES)))
        features[:, :5] = [1.0, math.sqrt(self._speed), self._speed, max(0.0, float(mean[21])), acceleration**2]
        change = now - mean
        features[:, 5] = change[14:21] ** 2
        return Change(residual.stamp, change[:7], features, change[7:14], residual.position, self._jacobian)


@dataclass(frozen=True)
class Thresholds:
    """Learnt values: shares of the variance of a change (7 joints x FEATURES), standard deviations of an offset (7,
    Nm), the limits of both forces in standard deviations, and the lag of the torques (s, see MomentumObserver)."""

    variance: np.ndarray
    limit: float
    steady: np.ndarray
    steady_limit: float
    reaches: int = 0
    lag: float = 0.0

    def deviation(self, features: np.ndarray) -> np.ndarray:
        """Returns the standard deviation of each joint's change without contact, Nm, shape (7,)."""
        return np.sqrt(np.maximum((self.variance * features).sum(axis=1), FLOOR))

    def force(self, change: Change) -> tuple[np.ndarray, float]:
        """Returns the force on the palm (N, base frame) that explains a change best, and its length in deviations."""
        return explained(change.torque, self.deviation(change.features), change.jacobian)

    def steady_force(self, offset: Offset, features: np.ndarray) -> tuple[np.ndarray, float]:
        """The same for an offset, seen while the arm moves with these ``features``."""
        deviation = np.sqrt(self.steady**2 + self.deviation(features) ** 2)
        return explained(offset.torque, deviation, offset.jacobian)

    def save(self, path: Path) -> None:
        """Write the file; OSError if that fails."""
        text = {
            "features": list(FEATURES),
            "variance": [[float(f"{v:.5g}") for v in row] for row in self.variance],
            "limit": round(float(self.limit), 3),
            "steady": [float(f"{v:.5g}") for v in self.steady],
            "steady_limit": round(float(self.steady_limit), 3),
            "reaches": int(self.reaches),
            "lag": float(f"{self.lag:.3g}"),
        }
        path.write_text(yaml.safe_dump(text, default_flow_style=None, sort_keys=False), encoding="utf-8")

    @staticmethod
    def load(path: Path) -> Thresholds:
        """Read a file. ThresholdError, or an error of coglab_py.yaml_file, gives the reason of a failure."""
        data = read(path).value
        if not isinstance(data, dict) or data.get("features") != list(FEATURES):
            raise ThresholdError(f"{path}: expected the features {', '.join(FEATURES)}; learn the thresholds anew")
        try:
            variance = np.array(data["variance"], dtype=float)
            limit, reaches = float(data["limit"]), int(data.get("reaches", 0))
            steady, steady_limit = np.array(data["steady"], dtype=float), float(data["steady_limit"])
            lag = float(data["lag"])
        except (KeyError, TypeError, ValueError) as error:
            raise ThresholdError(f"{path}: a figure is missing or is none: {error}") from error
        good = all(np.all(np.isfinite(each)) and np.all(each >= 0.0) for each in (variance, steady))
        if not good or variance.shape != (7, len(FEATURES)) or steady.shape != (7,):
            raise ThresholdError(f"{path}: expected 7 x {len(FEATURES)} variances and 7 deviations, all 0 or more")
        if not (0.0 < limit < 1e3 and 0.0 < steady_limit < 1e3):
            raise ThresholdError(f"{path}: expected positive limits, got {limit} and {steady_limit}")
        if not abs(lag) <= LONGEST_LAG:
            raise ThresholdError(f"{path}: expected a lag within {LONGEST_LAG} s, got {lag}")
        return Thresholds(variance, limit, steady, steady_limit, reaches, lag)


def explained(torque: np.ndarray, deviation: np.ndarray, jacobian: np.ndarray) -> tuple[np.ndarray, float]:
    """Returns the force on the palm (N) that explains joint torques (Nm), and its length in standard deviations."""
    weighed = jacobian / deviation
    information = weighed @ weighed.T
    # A stretched arm cannot measure forces along itself: the small term keeps the solution finite there.
    steadied = information + 1e-9 * information.trace() * AXES
    force = np.linalg.solve(steadied, weighed @ (torque / deviation))
    return force, math.sqrt(max(0.0, force @ information @ force))


def learn(
    reaches: Iterable[Sequence[Change]],
    offsets: Sequence[Offset] = (),
    alarm_share: float = ALARM_SHARE,
    lag: float = 0.0,
) -> Thresholds:
    """Learn from the changes of at least 20 complete reaches without contact, and from the offsets of the empty hand.
    ``lag``: lag of the torques (s) that was used meanwhile. ThresholdError: data is missing."""
    runs = [list(reach) for reach in reaches if len(reach) >= CONFIRM]
    if len(runs) < 20:
        raise ThresholdError(f"expected at least 20 reaches without contact, got {len(runs)}")
    features = np.array([change.features for run in runs for change in run])
    torques = np.array([change.torque for run in runs for change in run])
    rates = np.array([change.rate for run in runs for change in run])
    weights = 1.0 / np.maximum(np.einsum("kji,ji->kj", features, shares_of(torques, features)), FLOOR)
    moved = float(np.sum(weights * torques * rates) / max(1e-9, float(np.sum(weights * rates**2))))
    moved = min(max(moved, -LONGEST_LAG - lag), LONGEST_LAG - lag)
    runs = [[replace(change, torque=change.torque - moved * change.rate) for change in run] for run in runs]
    variance = shares_of(torques - moved * rates, features)
    rests = np.array([offset.torque for offset in offsets]).reshape(-1, 7)
    # Without enough offsets, use a limit as large as the offset of D4.10's detector.
    steady = np.sqrt(np.mean(rests**2, axis=0)) if len(rests) >= 20 else np.full(7, 0.3)
    draft = Thresholds(variance, 1.0, steady, 1.0, len(runs))
    changed = [largest_confirmed([draft.force(change)[1] for change in run]) for run in runs]
    rested = [explained(each.torque, steady, each.jacobian)[1] for each in offsets] if len(rests) >= 20 else [4.0]
    limits = limit_of(changed, alarm_share), limit_of(rested, alarm_share)
    return Thresholds(variance, limits[0], steady, limits[1], len(runs), lag + moved)


def shares_of(torques: np.ndarray, features: np.ndarray) -> np.ndarray:
    """Returns the shares (7 x FEATURES) of the variance of n changes (n x 7, Nm) with features (n x 7 x FEATURES)."""
    variance = np.zeros(features.shape[1:])
    for joint in range(7):
        # The scatter of a squared change grows with its size: the weights keep the influence of the quiet samples.
        squares, seen, weight = torques[:, joint] ** 2, features[:, joint], np.ones(len(features))
        for _ in range(4):
            variance[joint] = nnls(seen * weight[:, None], squares * weight)[0]
            weight = 1.0 / np.maximum(seen @ variance[joint], FLOOR)
    return variance


def limit_of(largest: Sequence[float], alarm_share: float) -> float:
    """Returns the limit that the largest value of a reach exceeds with this probability (Gumbel's law), and at least
    1.05 times the largest seen value."""
    scale = float(np.std(largest)) * np.sqrt(6.0) / np.pi
    gumbel = float(np.mean(largest)) - EULER * scale - scale * float(np.log(-np.log1p(-alarm_share)))
    return max(gumbel, 1.05 * float(np.max(largest)))


def largest_confirmed(values: Sequence[float]) -> float:
    """Returns the largest value that CONFIRM consecutive samples have reached."""
    each = np.asarray(values, dtype=float)
    return float(np.max(np.minimum.reduce([each[k : len(each) - CONFIRM + 1 + k] for k in range(CONFIRM)])))
