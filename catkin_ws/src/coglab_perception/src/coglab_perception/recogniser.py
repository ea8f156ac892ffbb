"""Recognises which reaching pattern the partner performs, from the position of the hand, frame by frame.

Features: displacement from the place where the hand rested (m), and velocity over a short window (m/s). The forward
filters of the models give the posterior over the patterns. It is 'unknown' if even the best pattern explains the motion
poorly. A decision needs a confident posterior in several frames. It is kept until another pattern was confident for as
many frames, or until some time after the end of the reach.
"""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from .hmm import HmmFilter, LeftRightHmm

UNKNOWN = "unknown"
CLOCK_JUMP = 5.0
"""s; a frame that is older than the newest by more is not late: the clock was set back, e.g. in a replayed bag"""
FILE_VERSION = 1


@dataclass(frozen=True)
class RecogniserSettings:
    """Settings of the recogniser. Times in s, lengths in m."""

    confident: float = 0.9
    """posterior that counts as confident"""
    frames: int = 5
    """number of consecutive confident frames for a decision"""
    onset_distance: float = 0.03
    """distance of the hand from its rest at which a reach begins"""
    rest_speed: float = 0.08
    rest_time: float = 0.3
    """if the hand is slower than rest_speed (m/s) for this time, it rests, and the next motion is a new one"""
    velocity_window: float = 0.10
    """s, window of the velocity"""
    max_gap: float = 0.4
    """s without a frame, after which earlier frames are discarded"""
    memory: float = 1.0
    """s for which the estimate is kept after its reach, so that a late reader does not act on an old one"""
    temperature: float = 3.0
    """the log-likelihood is divided by this, because frames of a tracker are correlated"""


@dataclass
class Pattern:
    """One reaching pattern: its model, and the smallest log-likelihood per frame of a motion of this pattern."""

    name: str
    model: LeftRightHmm
    floor: float


@dataclass(frozen=True)
class Estimate:
    """Current result: best pattern (or unknown), its probability, whether it is decided, share of the reach seen."""

    pattern: str = UNKNOWN
    confidence: float = 0.0
    decided: bool = False
    progress: float = 0.0
    probabilities: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class PatternEnd:
    """End of the reach from the recognised pattern: its name, place of the hand (m) and variance (m^2) per axis."""

    pattern: str
    place: np.ndarray
    variance: np.ndarray


class FeatureStream:
    """Computes features from positions; detects rest and onset. ``rest`` is the last place of rest (m), None before
    the first."""

    def __init__(self, settings: RecogniserSettings) -> None:
        self.settings = settings
        self._history: deque[tuple[float, np.ndarray]] = deque()
        self.rest: np.ndarray | None = None
        self._recent: deque[tuple[float, np.ndarray]] = deque()
        self.moving = False
        self.started = False

    def update(self, stamp: float, position: Sequence[float]) -> np.ndarray | None:
        """Process one frame. Returns features (6,) during a reach, otherwise None. ``started`` is True on the first
        frame of a reach."""
        s = self.settings
        p = np.asarray(position, dtype=float)
        self.started = False
        gap = stamp - self._history[-1][0] if self._history else 0.0
        if gap > s.max_gap or gap < -CLOCK_JUMP:
            self._history.clear()
            self._recent.clear()
            self.moving = False
        if self._history and stamp <= self._history[-1][0]:
            return None
        self._history.append((stamp, p))
        while len(self._history) > 2 and self._history[1][0] <= stamp - s.velocity_window:
            self._history.popleft()
        t0, p0 = self._history[0]
        velocity = (p - p0) / (stamp - t0) if stamp > t0 else np.zeros(3)
        self._follow_rest(stamp, p)
        if self.rest is None:
            return None
        if not self.moving:
            if np.linalg.norm(p - self.rest) <= s.onset_distance:
                return None
            self.moving = self.started = True
        return np.concatenate([p - self.rest, velocity])

    def _follow_rest(self, stamp: float, p: np.ndarray) -> None:
        """Detect rest: the two halves of the last ``rest_time`` agree. Noise averages out, motion does not."""
        s = self.settings
        self._recent.append((stamp, p))
        while self._recent[-1][0] - self._recent[0][0] > s.rest_time:
            self._recent.popleft()
        if len(self._recent) < 6 or stamp - self._recent[0][0] < 0.8 * s.rest_time:
            return
        half = len(self._recent) // 2
        places = [place for _, place in self._recent]
        way = np.mean(places[half:], axis=0) - np.mean(places[:half], axis=0)
        if np.linalg.norm(way) > s.rest_speed * s.rest_time / 2:
            return
        if self.moving or self.rest is None:
            self.rest = np.mean(places, axis=0)
        # In the first frames of a reach the hand is still slow: follow only changes that are not yet a displacement.
        self.rest = self.rest + 0.1 * (p - self.rest)
        self.moving = False


class Recogniser:
    """Processes stamped hand positions (m, robot base frame) and keeps an Estimate."""

    def __init__(self, patterns: Sequence[Pattern], settings: RecogniserSettings = RecogniserSettings()) -> None:
        if not patterns:
            raise ValueError("a recogniser needs at least one pattern")
        self.patterns = list(patterns)
        self.settings = settings
        self.stream = FeatureStream(settings)
        self.estimate = Estimate()
        self._filters: list[HmmFilter] = []
        self._streak: tuple[str, int] = (UNKNOWN, 0)
        self._decision = UNKNOWN
        self._over_since: float | None = None
        self._newest = -math.inf

    def update(self, stamp: float, position: Sequence[float]) -> Estimate:
        """Process one frame of the partner's hand."""
        if not np.all(np.isfinite(position)):
            return self.estimate
        features = self.stream.update(stamp, position)
        if features is None:
            self._forget(stamp)
            return self.estimate
        self._over_since, self._newest = None, stamp
        if self.stream.started:
            self._filters = [HmmFilter(p.model) for p in self.patterns]
            self._streak, self._decision = (UNKNOWN, 0), UNKNOWN
        for f in self._filters:
            f.update(features)
        self.estimate = self._judge()
        return self.estimate

    def pattern_end(self) -> PatternEnd | None:
        """End of the current reach from the decided pattern: rest plus displacement and variance of the model's last
        state. None without a decision."""
        if not (self.estimate.decided and self.stream.moving) or self.stream.rest is None:
            return None
        model = next(p.model for p in self.patterns if p.name == self.estimate.pattern)
        return PatternEnd(self.estimate.pattern, self.stream.rest + model.mean[-1, :3], model.variance[-1, :3])

    def _forget(self, stamp: float) -> None:
        """Reset the estimate `memory` s after the end of a reach."""
        if self.stream.moving or not self.estimate.probabilities:
            return
        if stamp < self._newest - CLOCK_JUMP:
            self._newest, self._over_since = stamp, None
        self._newest = max(self._newest, stamp)
        if self._over_since is None:
            self._over_since = self._newest
        elif stamp - self._over_since > self.settings.memory:
            self.estimate = Estimate()

    def _judge(self) -> Estimate:
        scores = np.array([f.log_likelihood for f in self._filters])
        floors = np.array([p.floor * f.frames for p, f in zip(self.patterns, self._filters, strict=False)])
        # 'unknown' competes with the likelihood of the worst genuine reach of the best pattern.
        best = int(np.argmax(scores))
        scores = np.append(scores, floors[best]) / self.settings.temperature
        weights = np.exp(scores - scores.max())
        weights /= weights.sum()
        names = [p.name for p in self.patterns] + [UNKNOWN]
        winner = int(np.argmax(weights))
        name, confidence = names[winner], float(weights[winner])
        if confidence >= self.settings.confident:
            self._streak = (name, self._streak[1] + 1 if self._streak[0] == name else 1)
        else:
            self._streak = (UNKNOWN, 0)
        if self._streak[1] >= self.settings.frames and self._streak[0] != UNKNOWN:
            self._decision = self._streak[0]
        decided = self._decision != UNKNOWN
        shown = self._decision if decided else name
        probabilities = dict(zip(names, (float(w) for w in weights), strict=False))
        return Estimate(shown, probabilities[shown], decided, self._filters[best].progress(), probabilities)


def train_patterns(
    demonstrations: Mapping[str, Sequence[tuple[np.ndarray, np.ndarray]]],
    settings: RecogniserSettings = RecogniserSettings(),
    states: int = 5,
) -> list[Pattern]:
    """Train one pattern per name from demonstrations [(stamps (T,), positions (T, 3)), ...].

    The floor is the mean minus five standard deviations of the demonstrations' log-likelihood per frame.
    """
    patterns = []
    for name, recordings in demonstrations.items():
        sequences = [
            f for stamps, positions in recordings if len(f := reach_features(stamps, positions, settings)) > states
        ]
        if len(sequences) < 2:
            raise ValueError(
                f"pattern '{name}': {len(sequences)} usable demonstrations; at least 2 are needed, "
                f"each with a rest before the reach and more than {states} frames of motion"
            )
        model = LeftRightHmm.train(sequences, states)
        per_frame = np.array([model.log_likelihood(s) / len(s) for s in sequences])
        patterns.append(Pattern(name, model, float(per_frame.mean() - 5.0 * per_frame.std() - 1.0)))
    return patterns


def reach_features(stamps: np.ndarray, positions: np.ndarray, settings: RecogniserSettings) -> np.ndarray:
    """Features of the first reach in a recording, (T, 6); empty if there is none."""
    stream = FeatureStream(settings)
    frames: list[np.ndarray] = []
    for t, p in zip(stamps, positions, strict=False):
        f = stream.update(float(t), p)
        if f is not None:
            frames.append(f)
        elif frames:
            break
    return np.array(frames).reshape(-1, 6)


def save_patterns(path: str, patterns: Sequence[Pattern], settings: RecogniserSettings, source: str) -> None:
    """Write the patterns to a file (JSON)."""
    data = {
        "version": FILE_VERSION,
        "source": source,
        "settings": asdict(settings),
        "patterns": [{"name": p.name, "floor": p.floor, **p.model.to_dict()} for p in patterns],
    }
    Path(path).write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def load_patterns(path: str) -> tuple[list[Pattern], RecogniserSettings]:
    """Read a pattern file. A ValueError names file and field."""
    try:
        data: Any = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from error
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}:{error.lineno}: not JSON: {error.msg}") from error
    if not isinstance(data, dict) or data.get("version") != FILE_VERSION:
        raise ValueError(f"{path}: expected a pattern file of version {FILE_VERSION}")
    known = {f.name for f in fields(RecogniserSettings)}
    settings = RecogniserSettings(**{k: v for k, v in data.get("settings", {}).items() if k in known})
    patterns = []
    for i, entry in enumerate(data.get("patterns", [])):
        try:
            model = LeftRightHmm.from_dict(entry)
            floor = float(entry["floor"])
            if model.mean.shape[1] != 6 or not math.isfinite(floor):
                raise ValueError(f"features have {model.mean.shape[1]} numbers, expected 6, floor finite")
            patterns.append(Pattern(str(entry["name"]), model, floor))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: patterns[{i}]: {error}") from error
    if not patterns:
        raise ValueError(f"{path}: no patterns in it")
    return patterns, settings
