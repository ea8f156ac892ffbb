"""Many trials in virtual time on all cores, and what came of them; shared by bench_trials.py and bench_contact.py."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import smach
from coglab_msgs.msg import ReasonCode

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from coglab_sim.conditions import Conditions
from reach_figures import figures
from trial_file import TrialFile
from virtual_trial import VirtualTrial

EXCHANGES = ("exchange_human_to_robot", "exchange_robot_to_human")
REASONS = {value: name for name, value in vars(ReasonCode).items() if name.isupper() and isinstance(value, int)}
FILE = TrialFile(Path(os.environ["COGLAB_TRIALS"])) if os.environ.get("COGLAB_TRIALS") else None
"""Trials that are in this file are not run again, those that are not are added to it."""
STUCK, NOT_BEGUN = "STUCK", "NOT_BEGUN"
"""Reasons of ours, beside those of ReasonCode: the machine came to no end; the action before had failed."""
RUN_MISSING = True
"""False: only what is in the file counts."""


@dataclass(frozen=True)
class Job:
    """One trial that is to be run; ``name`` and seed are its key in a file. ``runner`` runs it: one_trial, if none."""

    name: str
    actions: Sequence[str]
    seed: int
    arguments: dict[str, Any]
    runner: Callable[[Job], dict[str, Any]] | None = None

    @property
    def key(self) -> str:
        """Of this trial among all."""
        return f"{self.name} | {' '.join(self.actions)} | {self.seed}"


def run_job(job: Job) -> dict[str, Any]:
    """Run one trial in a worker process; plain data only."""
    return (job.runner or one_trial)(job)


def one_trial(job: Job, watch: Callable[[VirtualTrial], Any] | None = None, script: Any = None) -> dict[str, Any]:
    """The actions of a trial one after the other, or ``script`` instead. ``watch`` sees the trial before it begins; the
    ``figures()`` of what it returns, if anything, are the result's ``truth``."""
    actions, seed = job.actions, job.seed
    smach.set_loggers(*[lambda *a: None] * 4)
    started = time.process_time()
    trial = VirtualTrial(seed=seed, **job.arguments)
    watcher = watch(trial) if watch is not None else None
    stuck = ""
    try:
        trial.run(*actions, script=script)
    except Exception as error:  # the script's own limit, or the physics has ended
        stuck = f"{type(error).__name__}: {error}"
    if not stuck and trial.last_hub not in ("wait_without_object", "wait_with_object"):
        stuck = f"the machine waits in '{trial.last_hub}': {trial.ctx.journal.why()}"
    results = [r for r in trial.ctx.journal.results if r.kind in actions]
    truth = {} if watcher is None else {"truth": watcher.figures()}
    return {
        "seed": seed,
        "stuck": stuck,
        "begun": len(trial.begun),
        "outcomes": [(r.kind, r.outcome, r.reason, REASONS.get(r.code, str(r.code))) for r in results],
        "fell": bool(trial.rig.cell.truth()["dropped"]),
        "held_by": str(trial.rig.cell.truth()["held_by"]),
        "outside_commanded": trial.rig.robot.outside["commanded"],
        "outside_measured": trial.rig.robot.outside["measured"],
        "over_command": trial.rig.robot.outside["over_command"],
        "fastest": trial.rig.robot.measured_share,
        "moving": trial.ctx.contact.watched_while_moving,
        "virtual": trial.clock.now(),
        "processor": time.process_time() - started,
        "reaches": [(reach.action, figures(reach)) for reach in trial.reaches],
        "touches": [touch.figures() for touch in trial.touches],
        **truth,
    }


def ends_of(actions: Sequence[str], trial: dict[str, Any]) -> list[tuple[str, str, str, str]]:
    """(action, outcome, sentence, reason) of each action, exactly one each: that of the journal; "stuck" for the last
    that had begun when the trial got stuck, whatever it had come to; "not started" for those that never began."""
    at = max(0, trial["begun"] - 1) if trial["stuck"] else -1
    ends = []
    for k, action in enumerate(actions):
        if k == at:
            ends.append((action, "stuck", trial["stuck"], STUCK))
        elif k < len(trial["outcomes"]):
            ends.append((action, *trial["outcomes"][k][1:]))
        else:
            ends.append((action, "not started", "", NOT_BEGUN))
    return ends


def _begin_worker() -> None:
    """A worker ends with its campaign, not with the terminal's Ctrl-C."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def pool_of(processes: int) -> Any:
    """Processes that trials run in."""
    return multiprocessing.get_context("fork").Pool(processes, _begin_worker)


def results_of(jobs: Sequence[Job]) -> Iterator[dict[str, Any]]:
    """The trials in the order of the jobs, on all cores; those of the file are taken from there."""
    known = FILE.known if FILE is not None else {}
    missing = [job for job in jobs if job.key not in known] if RUN_MISSING else []
    if missing:
        with pool_of(min(len(missing), os.cpu_count() or 1)) as pool:
            fresh = pool.imap(run_job, missing)
            for job in jobs:
                if job.key in known:
                    yield known[job.key]
                else:
                    yield next(fresh) if FILE is None else FILE.add(job.key, next(fresh))
    else:
        yield from (known[job.key] for job in jobs if job.key in known)


def in_turn(rows: Sequence[Sequence[Job]]) -> list[Job]:
    """The jobs so that all rows have the same share of theirs done at any time; of equal ones the first row first."""
    marks = [(k / len(row), i, job) for i, row in enumerate(rows) for k, job in enumerate(row)]
    return [job for _, _, job in sorted(marks, key=lambda mark: mark[:2])]


def fill(jobs: Sequence[Job], processes: int, seconds: float) -> int:
    """Run what the file has not, for at most so long (s); returns how many of the jobs it has then."""
    assert FILE is not None, "fill() needs a file of trials"
    end = time.monotonic() + seconds
    missing = [job for job in jobs if job.key not in FILE.known]
    with pool_of(processes) as pool:
        for job, trial in zip(missing, pool.imap(run_job, missing), strict=True):
            FILE.add(job.key, trial)
            if time.monotonic() > end:
                break
    return sum(job.key in FILE.known for job in jobs)


def of_asked(rows: list[dict], done: int, asked: int) -> list[dict]:
    """Rows of so many trials, or people, where ``asked`` were asked for: with fewer no goal can be met."""
    return [row | {"done": done, "asked": asked} for row in rows]


class Campaign:
    """Trials, on all cores; keeps counts, reasons, figures of every reach, and touches of the first action."""

    def __init__(self) -> None:
        self.outcomes: Counter = Counter()
        self.ends: dict[str, list[tuple[str, str]]] = {}
        """of each action: outcome, and who held the object in truth when the trial was over"""
        self.reasons: dict[str, Counter] = {action: Counter() for action in EXCHANGES}
        self.reaches: dict[str, list[dict[str, float]]] = {action: [] for action in EXCHANGES}
        self.without_reach: Counter = Counter()
        """trials in which no reach of this action began"""
        self.touches: list[dict[str, Any]] = []
        self.outside_commanded = self.outside_measured = self.over_command = self.moving = self.stuck = self.trials = (
            self.fell
        ) = 0
        self.asked = 0
        self.palms: list[tuple[dict[str, float], dict[str, Any]]] = []
        """of the first action: figures of a reach, and the touch in it"""
        self.virtual = self.processor = self.fastest = 0.0

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
        jobs = [Job(name, tuple(actions), seed, kw) for seed, kw in trials]
        self.asked += len(jobs)
        for trial in results_of(jobs):
            self._count(actions, trial, name)
        return self

    def marked(self, row: Callable[..., dict]) -> Callable[..., dict]:
        """The same rows, but incomplete and missed where fewer trials were run than asked."""
        if self.trials == self.asked:
            return row

        def incomplete(figure: str, value: float, unit: str, goal: str = "", ok: bool = False) -> dict:
            return row(f"{figure} [incomplete: missed; {self.trials} of {self.asked} trials]", value, unit, goal, False)

        return incomplete

    def _count(self, actions: Sequence[str], trial: dict[str, Any], name: str) -> None:
        self.trials += 1
        self.fastest = max(self.fastest, trial["fastest"])
        for field in (
            "outside_commanded",
            "outside_measured",
            "over_command",
            "moving",
            "virtual",
            "processor",
            "fell",
        ):
            setattr(self, field, getattr(self, field) + trial[field])
        self.stuck += bool(trial["stuck"])
        if trial["stuck"]:
            print(f"{name}, seed {trial['seed']}: stuck: {trial['stuck']}", file=sys.stderr)
        for kind, outcome, reason, code in ends_of(actions, trial):
            self.outcomes[(kind, outcome)] += 1
            self.ends.setdefault(kind, []).append((outcome, trial.get("held_by", "")))
            if outcome != "succeeded":
                self.reasons.setdefault(kind, Counter())[code] += 1
                if code not in (STUCK, NOT_BEGUN):
                    print(f"{name}, {kind}, seed {trial['seed']}: {outcome}: {reason}", file=sys.stderr)
        reached = {action for action, _ in trial["reaches"]}
        self.without_reach.update(action for action in actions if action in self.reaches and action not in reached)
        for (action, found), touch in zip(trial["reaches"], trial["touches"], strict=True):
            if action in self.reaches:
                self.reaches[action].append(found)
            if action == actions[0]:
                self.touches.append(touch)
                self.palms.append((found, touch))

    def share(self, action: str, good: Sequence[str] = ("succeeded",)) -> float:
        """Share of the trials whose action ended so."""
        return sum(self.outcomes[(action, outcome)] for outcome in good) / max(1, self.trials)

    def stood(self, action: str) -> list[dict[str, float]]:
        """Figures of the reaches after which the arm stood still."""
        return [each for each in self.reaches[action] if each["stood"]]

    def never_stood(self, action: str) -> list[dict[str, float]]:
        """Figures of the other ones, at their end."""
        return [each for each in self.reaches[action] if not each["stood"]]

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

    def limit_rows(self, row: Callable[..., dict], what: str, goal: str = "") -> list[dict]:
        """Periods outside a joint limit: as the arm was told, and as it moved; with a goal (<= 0) or only printed.
        Beside them how fast it was, and how often faster than it may be told."""
        return [
            *(
                row(f"{what}: periods outside a joint limit as {how}", n, "periods", goal, not goal or n == 0)
                for how, n in (("commanded", self.outside_commanded), ("measured", self.outside_measured))
            ),
            row(f"{what}: fastest joint as measured over its limit", self.fastest, "share", "", True),
            row(f"{what}: measured faster than the largest speed to command", self.over_command, "periods", "", True),
        ]

    def safety_rows(self, row: Callable[..., dict], what: str) -> list[dict]:
        """Nothing stuck, no limit violated, never armed while moving."""
        return [
            row(f"{what}: stuck", self.stuck, "trials", "<= 0", self.stuck == 0),
            *self.limit_rows(row, what, "<= 0"),
            row(
                f"{what}: contact detector watching while the arm moves",
                self.moving,
                "periods",
                "<= 0",
                self.moving == 0,
            ),
        ]
