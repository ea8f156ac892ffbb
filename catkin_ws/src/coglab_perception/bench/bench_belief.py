#!/usr/bin/python3
"""The belief about offers and requests on drawn people who were not used for anything else, seen by the default
tracker.

Definitions, fixed before anything was measured. People: coglab_sim's, SEED + 0..99, each gives once and takes once; the
robot's hand stands at home. Onset: the person's own speed (without sway and tremor) first above 0.02 m/s. Decision: the
probability of offer or request is at or above `decision` after a sight, at the time of that sight's delivery. Place:
of the object in the person's hand, else of the hand, at the end of the reach, in truth; half of the reach is half of
its time. Other motions: 200 of test/other_motions.py, half with the object in the moving hand, half with one in the
robot's; crossed: decision at any time of theirs. Withdrawal: the person takes the hand back 1 s after the reach;
fall: the object leaves the hand at a random time of the reach or of the second after it; gone: probability below 0.1.
Undecided is infinitely late.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from coglab_perception.belief import Belief, BeliefFilter, BeliefSettings
from coglab_perception.recogniser import Recogniser, load_patterns
from recorded_sights import HAND, KINDS, OBJECT, Recording, handover, neither

PATTERNS = Path(__file__).resolve().parent.parent / "config" / "patterns.json"
SEED = 910000
"""of the people and motions; the settings were chosen on seeds from 50000 on"""
PEOPLE, OTHERS, FALLS = 100, 200, 100
SHARES = {"half": 0.5, "3/4": 0.75, "the end": 1.0}


@dataclass
class Run:
    """One recording with what was believed: time of delivery (s) and belief; time spent (s of this process)."""

    recording: Recording
    beliefs: list[tuple[float, Belief]] = field(default_factory=list)
    spent: float = 0.0

    def first(self, level: float, after: float) -> int | None:
        """Index of the first belief at or above a level, delivered after a time."""
        return next((i for i, (t, b) in enumerate(self.beliefs) if t >= after and b.either >= level), None)

    def gone_after(self, stamp: float, name: str) -> float:
        """s from the delivery of the first sight of this frame with this stamp or a later one until there is no
        belief."""
        sight = next((t for t, s in self.recording.sights if s.name == name and s.captured >= stamp), np.inf)
        return next((t - sight for t, b in self.beliefs if t >= sight and b.either < 0.1), np.inf)


def believe(recording: Recording, settings: BeliefSettings, patterns: tuple) -> Run:
    """A fresh filter, and a fresh recogniser beside it, over one recording."""
    run, belief, recogniser = Run(recording), BeliefFilter(settings), Recogniser(*patterns)
    for t, sight in recording.sights:
        place = sight.frame.position
        if sight.name == HAND:
            recogniser.update(sight.captured, place)
        begin = time.process_time()
        if sight.name == OBJECT:
            belief.see_object(sight.captured, "mug", place, t)
        else:
            end = recogniser.pattern_end()
            run.beliefs.append((t, belief.see_hand(sight.captured, place, t, recording.robot_holds, end)))
        run.spent += time.process_time() - begin
    return run


def row(figure: str, value: float, unit: str, goal: str = "", ok: bool = True) -> dict:
    """One row of the bench table."""
    shown = round(float(value), 4) if np.isfinite(value) else None
    columns = {"bench": "belief", "figure": figure, "value": shown, "unit": unit, "goal": goal or "reported"}
    return columns | {"peer": None, "peer_value": None, "ok": bool(ok)}


def at_most(figure: str, value: float, unit: str, goal: float) -> dict:
    """A row with a goal."""
    return row(figure, value, unit, f"<= {goal:g}", value <= goal)


def quantile(values: list[float], share: float) -> float:
    """The smallest value that at least this share of them does not exceed; infinite ones are values."""
    ordered = sorted(values)
    return ordered[max(0, int(np.ceil(share * len(ordered))) - 1)]


def onset_rows(runs: list[Run], level: float) -> list[dict]:
    """How early."""
    rows = []
    groups = {"offers": False, "requests": True}
    of = f"{len(runs)} reaches of {PEOPLE} people"
    found = {id(r): r.first(level, r.recording.onset) for r in runs}
    ends = {id(r): r.recording.end for r in runs}
    delays = {
        id(r): r.beliefs[found[id(r)]][0] - r.recording.onset
        if found[id(r)] is not None and r.beliefs[found[id(r)]][0] <= ends[id(r)] + 1.0
        else np.inf
        for r in runs
    }
    every = list(delays.values())
    rows.append(at_most(f"onset of the reach to the decision, median, {of}", quantile(every, 0.5), "s", 0.25))
    rows.append(row(f"onset of the reach to the decision, 95th percentile, {of}", quantile(every, 0.95), "s"))
    for name, holds in groups.items():
        part = [delays[id(r)] for r in runs if r.recording.robot_holds == holds]
        figure = f"onset of the reach to the decision, {len(part)} {name}"
        rows.append(row(f"{figure}, median", quantile(part, 0.5), "s"))
        rows.append(row(f"{figure}, 95th percentile", quantile(part, 0.95), "s"))
    early = np.mean([any(b.either >= level for t, b in r.beliefs if t < r.recording.onset) for r in runs])
    rows.append(row(f"decided before the onset, {of}", early, "share"))
    rows.append(row(f"never decided, {of}", np.mean(np.isinf(every)), "share"))
    return rows


def place_errors(run: Run, level: float) -> dict[str, float]:
    """m, by when; infinite without a prediction."""
    r = run.recording
    times = [t for t, _ in run.beliefs]
    at = {name: int(np.searchsorted(times, r.begin + s * (r.end - r.begin))) - 1 for name, s in SHARES.items()}
    first = run.first(level, r.onset)
    beliefs = {"the decision": None if first is None else run.beliefs[first][1]}
    beliefs |= {name: run.beliefs[i][1] for name, i in at.items()}
    return {
        name: np.inf if b is None or b.place is None else float(np.linalg.norm(b.place - r.place()))
        for name, b in beliefs.items()
    }


def place_rows(runs: list[Run], level: float) -> list[dict]:
    """How right, and how steady."""
    rows = []
    errors = [place_errors(run, level) for run in runs]
    for name in errors[0]:
        values = [e[name] for e in errors]
        figure, of = f"error of the predicted place at {name}", f"{len(runs)} reaches"
        rows.append(row(f"{figure}, median, {of}", quantile(values, 0.5), "m"))
        rows.append(row(f"{figure}, 95th percentile, {of}", quantile(values, 0.95), "m"))
    steps, lapses = [], []
    for run in runs:
        first = run.first(level, run.recording.onset)
        kept = [b for t, b in run.beliefs[first or 0 :] if t < min(run.recording.end + 1.0, run.recording.back - 0.2)]
        lapses.append(first is None or any(b.either < 0.5 for b in kept))
        steps += [
            float(np.linalg.norm(b.place - a.place))
            for a, b in zip(kept, kept[1:], strict=False)
            if a.place is not None and b.place is not None
        ]
    rows.append(
        row(
            f"step of the place between {len(steps)} sights from the decision on, 99th percentile",
            quantile(steps, 0.99),
            "m",
        )
    )
    rows.append(
        row(
            f"belief below 0.5 again before the hand goes back, or no decision, {len(runs)} reaches",
            np.mean(lapses),
            "share",
        )
    )
    return rows


def calibration_rows(runs: list[Run]) -> list[dict]:
    """How often what is believed is true, over all sights but those of falls."""
    pairs = [
        (
            b.either,
            r.recording.toward[min(int(np.searchsorted(r.recording.times, b.stamp)), len(r.recording.toward) - 1)],
        )
        for r in runs
        for _, b in r.beliefs
    ]
    rows = []
    for low, high in ((0.1, 0.5), (0.5, 0.8), (0.8, 0.9), (0.9, 1.01)):
        true = [t for p, t in pairs if low <= p < high]
        share = float(np.mean(true)) if true else np.inf
        rows.append(row(f"true among {len(true)} sights with a probability of {low}-{min(high, 1.0)}", share, "share"))
    return rows


def main() -> int:
    """Print the rows."""
    settings, patterns = BeliefSettings(), load_patterns(str(PATTERNS))
    level = settings.decision
    runs = [believe(handover(SEED + i, gives), settings, patterns) for i in range(PEOPLE) for gives in (True, False)]
    others = [believe(neither(KINDS[i % 3], i, SEED, (i // 3) % 2 == 0), settings, patterns) for i in range(OTHERS)]
    when = np.random.default_rng(SEED).uniform(0.3, 2.0, FALLS)
    falls = [believe(handover(SEED + i, True, float(s)), settings, patterns) for i, s in enumerate(when)]
    rows = onset_rows(runs, level) + place_rows(runs, level)
    crossed = {id(r): r.first(level, 0.0) is not None for r in others}
    share = float(np.mean(list(crossed.values())))
    neither_of = "motions that are neither offer nor request"
    rows.append(at_most(f"decided in one of {OTHERS} {neither_of}", share, "share", 0.05))
    for kind in KINDS:
        part = [crossed[id(r)] for r in others if r.recording.kind == kind]
        rows.append(row(f"decided in one of {len(part)} {neither_of}: {kind}", np.mean(part), "share"))
    long = np.mean([sum(b.either >= level for _, b in r.beliefs) >= 6 for r in others])
    rows.append(row(f"decided for 6 sights (0.2 s) and more in one of {OTHERS} {neither_of}", long, "share"))
    rows += calibration_rows(runs + others)
    back = [r.gone_after(r.recording.back, HAND) for r in runs]
    rows.append(
        at_most(f"hand seen 0.10 m back to no belief, 95th percentile of {len(back)}", quantile(back, 0.95), "s", 0.2)
    )
    gone = [r.gone_after(r.recording.fall, OBJECT) for r in falls]
    rows.append(
        at_most(f"fall of the object seen to no belief, 95th percentile of {FALLS}", quantile(gone, 0.95), "s", 0.2)
    )
    every = runs + others + falls
    per_sight = sum(r.spent for r in every) / sum(len(r.recording.sights) for r in every)
    rows.append(at_most("time per sight of hand or object, mean", per_sight * 1e3, "ms", 5.0))
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
