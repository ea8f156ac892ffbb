"""Many trials in virtual time on all cores, and what came of them; shared by bench_trials.py and bench_contact.py."""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import smach
from coglab_msgs.msg import ReasonCode

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from coglab_sim.conditions import Conditions
from reach_figures import figures
from virtual_trial import VirtualTrial

EXCHANGES = ("exchange_human_to_robot", "exchange_robot_to_human")
REASONS = {value: name for name, value in vars(ReasonCode).items() if name.isupper() and isinstance(value, int)}


def one_trial(job: tuple[Sequence[str], int, dict[str, Any]]) -> dict[str, Any]:
    """Run one trial in a worker process; plain data only."""
    actions, seed, kw = job
    smach.set_loggers(*[lambda *a: None] * 4)
    started = time.process_time()
    trial = VirtualTrial(seed=seed, **kw)
    stuck, results = "", []
    try:
        results = trial.run(*actions)
    except AssertionError as error:  # the script's own limit: the machine hangs
        stuck = str(error)
    except RuntimeError as error:  # the physics has ended
        stuck = str(error)
    if not stuck and trial.last_hub not in ("wait_without_object", "wait_with_object"):
        stuck = f"the machine waits in '{trial.last_hub}': {trial.ctx.journal.why()}"
    return {
        "seed": seed,
        "stuck": stuck,
        "outcomes": [(r.kind, r.outcome, r.reason, REASONS.get(r.code, str(r.code))) for r in results],
        "fell": bool(trial.rig.cell.truth()["dropped"]),
        "outside": trial.rig.robot.limit_violations,
        "moving": trial.ctx.contact.watched_while_moving,
        "virtual": trial.clock.now(),
        "processor": time.process_time() - started,
        "reaches": [(action, figures(reach)) for action, reach in zip(actions, trial.reaches, strict=False)],
        "touches": [(touch.touched, touch.found, touch.moving, touch.false_alarm) for touch in trial.touches],
    }


class Campaign:
    """Trials, on all cores; keeps counts, reasons, reach figures and touches of the first action."""

    def __init__(self) -> None:
        self.outcomes: Counter = Counter()
        self.reasons: dict[str, Counter] = {action: Counter() for action in EXCHANGES}
        self.reaches: dict[str, list[dict[str, float]]] = {action: [] for action in EXCHANGES}
        self.touches: list[tuple[float | None, float | None, bool, bool]] = []
        self.outside = self.moving = self.stuck = self.trials = self.fell = 0
        self.virtual = self.processor = 0.0

    def run(self, actions: Sequence[str], seeds: Iterable[int], **kw: Any) -> Campaign:
        """One trial per seed, all alike; returns self."""
        name = kw.get("behaviour") or kw.get("later_behaviour", "normal")
        return self.run_each(actions, [(seed, kw) for seed in seeds], name)

    def run_under(
        self,
        actions: Sequence[str],
        seeds: Iterable[int],
        name: str,
        conditions: Callable[[int], Conditions],
        **kw: Any,
    ) -> Campaign:
        """One trial per seed, each under its own conditions; returns self."""
        return self.run_each(actions, [(seed, {"conditions": conditions(seed), **kw}) for seed in seeds], name)

    def run_each(self, actions: Sequence[str], trials: list[tuple[int, dict[str, Any]]], name: str) -> Campaign:
        """One trial per seed and its arguments; returns self."""
        jobs = [(actions, seed, kw) for seed, kw in trials]
        with multiprocessing.get_context("fork").Pool(min(len(jobs), os.cpu_count() or 1)) as pool:
            for trial in pool.imap(one_trial, jobs):
                self._count(actions, trial, name)
        return self

    def _count(self, actions: Sequence[str], trial: dict[str, Any], name: str) -> None:
        self.trials += 1
        for field in ("outside", "moving", "virtual", "processor", "fell"):
            setattr(self, field, getattr(self, field) + trial[field])
        self.stuck += bool(trial["stuck"])
        if trial["stuck"]:
            print(f"{name}, seed {trial['seed']}: stuck: {trial['stuck']}", file=sys.stderr)
        for action in actions[len(trial["outcomes"]) :]:
            self.outcomes[(action, "not started")] += 1
        for kind, outcome, reason, code in trial["outcomes"]:
            self.outcomes[(kind, outcome)] += 1
            if outcome != "succeeded":
                self.reasons.setdefault(kind, Counter())[code] += 1
                print(f"{name}, {kind}, seed {trial['seed']}: {outcome}: {reason}", file=sys.stderr)
        for action, found in trial["reaches"]:
            if action in self.reaches and found is not None:
                self.reaches[action].append(found)
        self.touches += trial["touches"][:1]

    def share(self, action: str, good: Sequence[str] = ("succeeded",)) -> float:
        """Share of the trials whose action ended so."""
        return sum(self.outcomes[(action, outcome)] for outcome in good) / max(1, self.trials)

    def begun(self, action: str) -> int:
        """Trials that came to this action."""
        return self.trials - self.outcomes[(action, "not started")]

    def share_of_begun(self, action: str) -> float:
        """Share of those that came to the action in which it succeeded."""
        return self.outcomes[(action, "succeeded")] / max(1, self.begun(action))

    def failures(self, action: str) -> str:
        """Failures of an action by reason, in words."""
        found = self.reasons.get(action, Counter()).most_common()
        return ", ".join(f"{name.lower()} {n}" for name, n in found) or "none"

    def safety_rows(self, row: Callable[..., dict], what: str) -> list[dict]:
        """Nothing stuck, no limit violated, never armed while moving."""
        return [
            row(f"{what}: stuck", self.stuck, "trials", "<= 0", self.stuck == 0),
            row(f"{what}: periods outside a joint limit", self.outside, "periods", "<= 0", self.outside == 0),
            row(
                f"{what}: contact detector watching while the arm moves",
                self.moving,
                "periods",
                "<= 0",
                self.moving == 0,
            ),
        ]
