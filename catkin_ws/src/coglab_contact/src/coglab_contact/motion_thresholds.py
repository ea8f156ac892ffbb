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

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from coglab_py.yaml_file import read
from scipy.optimize import nnls

from coglab_contact._core import VARIANCE_FLOOR, Change, Offset, explained

__all__ = ["FEATURES", "Change", "Offset", "ThresholdError", "Thresholds", "explained", "learn"]

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
CONFIRM = 2  # consecutive samples over the limit
ALARM_SHARE = 2e-3  # probability with which a reach without contact may exceed the limit
EULER = 0.5772156649015329
LONGEST_LAG = 0.01  # s, largest plausible lag


class ThresholdError(ValueError):
    """Thresholds cannot be used or learnt. The sentence gives the reason."""


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
        return np.sqrt(np.maximum((self.variance * features).sum(axis=1), VARIANCE_FLOOR))

    def size(self, change: Change, lag: float = 0.0) -> float:
        """Returns the length, in deviations, of the force on the palm that explains a change best. ``lag``: s, of the
        torques, beyond the one with which the change was computed."""
        torque = change.torque - lag * change.rate
        return explained(torque, self.deviation(change.features), change.jacobian)[1]

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
            raise ThresholdError(f"{path}: a figure is missing or invalid: {error}") from error
        good = all(np.all(np.isfinite(each)) and np.all(each >= 0.0) for each in (variance, steady))
        if not good or variance.shape != (7, len(FEATURES)) or steady.shape != (7,):
            raise ThresholdError(f"{path}: expected 7 x {len(FEATURES)} variances and 7 deviations, all 0 or more")
        if not (0.0 < limit < 1e3 and 0.0 < steady_limit < 1e3):
            raise ThresholdError(f"{path}: expected positive limits, got {limit} and {steady_limit}")
        if not abs(lag) <= LONGEST_LAG:
            raise ThresholdError(f"{path}: expected a lag within {LONGEST_LAG} s, got {lag}")
        return Thresholds(variance, limit, steady, steady_limit, reaches, lag)


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
    weights = 1.0 / np.maximum(np.einsum("kji,ji->kj", features, shares_of(torques, features)), VARIANCE_FLOOR)
    moved = float(np.sum(weights * torques * rates) / max(1e-9, float(np.sum(weights * rates**2))))
    moved = min(max(moved, -LONGEST_LAG - lag), LONGEST_LAG - lag)
    variance = shares_of(torques - moved * rates, features)
    rests = np.array([offset.torque for offset in offsets]).reshape(-1, 7)
    # Without enough offsets, use a limit as large as the offset of D4.10's detector.
    steady = np.sqrt(np.mean(rests**2, axis=0)) if len(rests) >= 20 else np.full(7, 0.3)
    draft = Thresholds(variance, 1.0, steady, 1.0, len(runs))
    changed = [largest_confirmed([draft.size(change, moved) for change in run]) for run in runs]
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
            weight = 1.0 / np.maximum(seen @ variance[joint], VARIANCE_FLOOR)
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
