"""Left-right hidden Markov model with Gaussian emissions (diagonal covariance): training and on-line filtering.

Scaled forward-backward algorithm, Rabiner (1989). The chain can stay in a state or go to the next one. Plain numpy is
sufficient for models of five states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

VARIANCE_FLOOR = 1e-5


@dataclass
class LeftRightHmm:
    """``stay`` (n): probability to stay in each state; ``mean``, ``variance`` (n, d): emissions. Starts in state 0."""

    stay: np.ndarray
    mean: np.ndarray
    variance: np.ndarray

    def __post_init__(self) -> None:
        self.stay = np.asarray(self.stay, dtype=float)
        self.mean = np.atleast_2d(np.asarray(self.mean, dtype=float))
        self.variance = np.atleast_2d(np.asarray(self.variance, dtype=float))
        n = len(self.stay)
        if self.mean.shape != self.variance.shape or len(self.mean) != n or n < 1:
            raise ValueError(
                f"stay has {n} states, mean {self.mean.shape}, variance {self.variance.shape}: sizes differ"
            )
        if not (
            np.all(np.isfinite(self.mean)) and np.all(self.variance > 0) and np.all((self.stay >= 0) & (self.stay <= 1))
        ):
            raise ValueError("means must be finite, variances positive, probabilities to stay within 0..1")

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self.stay)

    def log_emission(self, x: np.ndarray) -> np.ndarray:
        """log N(x | mean, variance) per state; x is (d,) or (T, d), the result (n,) or (T, n)."""
        x = np.asarray(x, dtype=float)
        delta = x[..., None, :] - self.mean
        return -0.5 * np.sum(delta**2 / self.variance + np.log(2 * np.pi * self.variance), axis=-1)

    def transition(self) -> np.ndarray:
        """Transition matrix (n, n). The last state is never left."""
        a = np.diag(self.stay) + np.diag(1.0 - self.stay[:-1], 1)
        a[-1, -1] = 1.0
        return a

    def log_likelihood(self, x: np.ndarray) -> float:
        """log p(x) of a sequence (T, d)."""
        alpha = HmmFilter(self)
        for frame in np.asarray(x, dtype=float):
            alpha.update(frame)
        return alpha.log_likelihood

    @staticmethod
    def train(
        sequences: Sequence[np.ndarray], states: int = 5, iterations: int = 40, tolerance: float = 1e-4
    ) -> LeftRightHmm:
        """Baum-Welch on several sequences (T_i, d). Initially each sequence is divided equally among the states.

        Raises ValueError if a sequence is shorter than the number of states or not finite.
        """
        data = [np.asarray(s, dtype=float) for s in sequences]
        for i, s in enumerate(data):
            if s.ndim != 2 or len(s) < states or not np.all(np.isfinite(s)):
                raise ValueError(f"sequence {i} has shape {s.shape}; expected at least {states} finite frames")
        parts = [
            np.concatenate([s[len(s) * k // states : len(s) * (k + 1) // states] for s in data]) for k in range(states)
        ]
        length = float(np.mean([len(s) for s in data])) / states
        model = LeftRightHmm(
            np.full(states, 1.0 - 1.0 / max(length, 1.5)),
            np.array([p.mean(axis=0) for p in parts]),
            np.array([p.var(axis=0) + VARIANCE_FLOOR for p in parts]),
        )
        last = -np.inf
        for _ in range(iterations):
            model, score = model._reestimate(data)
            if score - last < tolerance * abs(score):
                break
            last = score
        return model

    def _reestimate(self, data: Sequence[np.ndarray]) -> tuple[LeftRightHmm, float]:
        """One Baum-Welch step. Returns the new model and the log-likelihood with the old one."""
        a = self.transition()
        n, d = self.mean.shape
        weight, first, second = np.zeros(n), np.zeros((n, d)), np.zeros((n, d))
        stayed, left = np.zeros(n), np.zeros(n)
        score = 0.0
        for x in data:
            log_b = self.log_emission(x)
            shift = log_b.max(axis=1)
            b = np.exp(log_b - shift[:, None])
            alpha, beta, scale = np.zeros_like(b), np.ones_like(b), np.zeros(len(x))
            alpha[0, 0] = b[0, 0]
            for t in range(len(x)):
                if t > 0:
                    alpha[t] = (alpha[t - 1] @ a) * b[t]
                scale[t] = max(alpha[t].sum(), 1e-300)
                alpha[t] /= scale[t]
            for t in range(len(x) - 2, -1, -1):
                beta[t] = a @ (b[t + 1] * beta[t + 1]) / scale[t + 1]
            gamma = alpha * beta
            gamma /= gamma.sum(axis=1, keepdims=True)
            score += float(np.sum(np.log(scale) + shift))
            for i in range(n - 1):
                stayed[i] += np.sum(alpha[:-1, i] * a[i, i] * b[1:, i] * beta[1:, i] / scale[1:])
                left[i] += np.sum(alpha[:-1, i] * a[i, i + 1] * b[1:, i + 1] * beta[1:, i + 1] / scale[1:])
            weight += gamma.sum(axis=0)
            first += gamma.T @ x
            second += gamma.T @ x**2
        weight = np.maximum(weight, 1e-9)
        mean = first / weight[:, None]
        variance = np.maximum(second / weight[:, None] - mean**2, 0.0) + VARIANCE_FLOOR
        stay = np.append((stayed / np.maximum(stayed + left, 1e-12))[:-1], 1.0)
        return LeftRightHmm(stay, mean, variance), score

    def to_dict(self) -> dict[str, Any]:
        """The model as plain types for a file."""
        return {"stay": self.stay.tolist(), "mean": self.mean.tolist(), "variance": self.variance.tolist()}

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> LeftRightHmm:
        """Inverse of to_dict. Raises ValueError for an invalid model."""
        missing = [k for k in ("stay", "mean", "variance") if k not in data]
        if missing:
            raise ValueError(f"a model needs stay, mean and variance; missing: {', '.join(missing)}")
        return LeftRightHmm(np.array(data["stay"]), np.array(data["mean"]), np.array(data["variance"]))


class HmmFilter:
    """Forward filter: processes one frame at a time with constant effort."""

    def __init__(self, model: LeftRightHmm) -> None:
        self.model = model
        self.log_likelihood = 0.0
        self.frames = 0
        self._belief = np.zeros(model.states)
        self._belief[0] = 1.0

    def update(self, frame: np.ndarray) -> float:
        """Process one frame (d,). Returns log p(frame | frames before)."""
        model = self.model
        predicted = self._belief
        if self.frames > 0:
            moved = self._belief * (1.0 - model.stay)
            moved[-1] = 0.0
            predicted = self._belief - moved
            predicted[1:] += moved[:-1]
        with np.errstate(divide="ignore"):
            log_joint = np.log(predicted) + model.log_emission(frame)
        top = float(log_joint.max())
        total = np.exp(log_joint - top)
        increment = top + float(np.log(total.sum()))
        self._belief = total / total.sum()
        self.log_likelihood += increment
        self.frames += 1
        return increment

    def progress(self) -> float:
        """Expected completed share of the pattern, 0..1."""
        n = self.model.states
        return float(self._belief @ np.arange(n)) / (n - 1) if n > 1 else 1.0
