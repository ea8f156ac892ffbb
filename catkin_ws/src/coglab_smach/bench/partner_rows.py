"""Which trials bench_partner runs, with which seeds, and the rows that come of them; bench_partner.py defines them."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import campaign
import numpy as np
from campaign import EXCHANGES, NOT_BEGUN, STUCK, Job
from coglab_msgs.msg import ReasonCode
from coglab_sim.conditions import HARDSHIPS, Conditions, hardship
from partner_trials import fall, handover, other, withdrawal
from trial_file import whole_hash
from world_rows import OBJECTS

LONG = os.environ.get("COGLAB_LONG") == "1"
ASKED = {"people": 100, "hardships": 100, "withdrawals": 200, "falls": 200, "others": 200, "pulls": 100}
"""trials of each group, the people of each object, that a row needs in order to meet its goal"""
COUNTS = ASKED if LONG else {"people": 1, "hardships": 1, "withdrawals": 2, "falls": 2, "others": 3, "pulls": 2}
RECEIVE, GIVE = EXCHANGES
HOLDER = {RECEIVE: "robot", GIVE: "human"}
"""who truly holds the object at the end of each direction that has succeeded"""
TRUSTS = 0.2
"""s; who trusts sooner places while the arm moves"""
ALL_TOGETHER = "all together"
PULLING = ("pull_back", "tug")
NEVER = 999.0
"""shown for what never happened, which counts as infinitely late in every percentile"""
WITHDRAWN = {ReasonCode.GOAL_WITHDRAWN, ReasonCode.GOAL_LEFT_REGION, ReasonCode.GOAL_AHEAD_OUTSIDE}
FELL = {ReasonCode.GOAL_FELL}
NOT_OFFERED = {ReasonCode.OBJECT_NOT_SEEN, ReasonCode.GOAL_UNREACHABLE}
"""outcomes of an offer that was taken back before the arm had moved"""
CLAIMED = "claimed"
UNDOCUMENTED = {"NONE", "UNEXPECTED", STUCK, CLAIMED}
Row = Callable[..., dict]


def seeds_of(commit: str, name: str, number: int) -> list[int]:
    """Seeds that nobody has chosen: of the commit's hash, a name and a number each."""
    words = [f"{whole_hash(commit)} {name} {i}" for i in range(number)]
    return [int.from_bytes(hashlib.sha256(word.encode()).digest()[:4], "big") >> 1 for word in words]


def groups(commit: str) -> dict[str, list[Job]]:
    """All trials by group, of the sources of this commit."""

    def jobs(
        name: str, count: int, arguments: Callable[[int, int], dict], runner: Any, both: bool = False
    ) -> list[Job]:
        """``arguments``: of the number of a trial and its seed."""
        seeds = seeds_of(commit, name.partition(",")[0], count)
        actions = EXCHANGES if both else (RECEIVE,)
        return [Job(name, actions, seed, arguments(i, seed), runner) for i, seed in enumerate(seeds)]

    found = {}
    for name in OBJECTS:
        key, conditions = f"people, {name}", {"conditions": Conditions(object_id=name)}
        found[key] = jobs(key, COUNTS["people"], lambda i, seed, c=conditions: c, handover, both=True)
    for name in (*HARDSHIPS, ALL_TOGETHER):
        hard = lambda i, seed, name=name: {"conditions": hardened(name, seed, object_of(i))}  # noqa: E731
        found[name] = jobs(f"hardships, {name}", COUNTS["hardships"], hard, handover, both=True)
    for name, runner in (("withdrawals", withdrawal), ("falls", fall)):
        given = lambda i, seed: {"conditions": Conditions(object_id=object_of(i))}  # noqa: E731
        found[name] = jobs(name, COUNTS[name], given, runner)
    pulling = lambda i, seed: {"conditions": Conditions(PULLING[i % 2], object_id=object_of(i // 2))}  # noqa: E731
    found["pulls"] = jobs("pulls", COUNTS["pulls"], pulling, handover)
    for name, hub in (("others", False), ("others, hub", True)):
        number = lambda i, seed, hub=hub: {"conditions": Conditions(), "number": i, "hub": hub}  # noqa: E731
        found[name] = jobs(name, COUNTS["others"], number, other, both=True)
    return found


def asked_of(name: str) -> int:
    """Trials that the goals ask for of a group of ``groups``; those that have no count of their own are hardships."""
    return ASKED.get(name.partition(",")[0], ASKED["hardships"])


def object_of(number: int) -> str:
    """The objects in turn."""
    return OBJECTS[number % len(OBJECTS)]


def hardened(name: str, seed: int, object_id: str) -> Conditions:
    """The default world with one hardship, or with all."""
    conditions = Conditions(object_id=object_id)
    for each in HARDSHIPS if name == ALL_TOGETHER else (name,):
        conditions = hardship(each, seed, conditions)
    return conditions


@dataclass(frozen=True)
class Direction:
    """One direction of one trial: how it ended, ``claimed`` where the machine says success and the truth does not; what
    truly happened, empty where it had not begun."""

    action: str
    object_id: str
    end: str
    sentence: str
    truth: dict[str, Any]
    eager: bool
    """the person places while the arm moves"""

    @property
    def good(self) -> bool:
        """Succeeded in truth."""
        return self.end == "succeeded"


def directions(job: Job, trial: dict[str, Any]) -> list[Direction]:
    """Those of a trial, exactly one for each action."""
    person = job.arguments["conditions"].participant(job.seed)
    eager = person.places_while_moving or person.trust < TRUSTS
    found = []
    for k, (action, outcome, sentence, code) in enumerate(campaign.ends_of(job.actions, trial)):
        truth = trial["truth"][k] if k < len(trial["truth"]) else {}
        end = code if outcome != "succeeded" else "succeeded"
        if end == "succeeded" and truth.get("held_by") != HOLDER[action]:
            end, sentence = CLAIMED, f"held by {truth.get('held_by')}"
        found.append(Direction(action, job.arguments["conditions"].object_id, end, sentence, truth, eager))
    return found


def run(jobs: Sequence[Job]) -> dict[str, dict[str, Any]]:
    """The trials by their keys, of as many jobs as are run, on all cores; see campaign.RUN_MISSING."""
    there = [job for job in jobs if campaign.RUN_MISSING or (campaign.FILE and job.key in campaign.FILE.known)]
    return {job.key: trial for job, trial in zip(there, campaign.results_of(jobs), strict=True)}


class Group:
    """The ``trials`` of some jobs, as far as they were run, and rows about them: missed where some are missing, and
    where they are a sample, because the jobs themselves are fewer than ``asked`` (None: as many as there are jobs)."""

    def __init__(
        self, row: Row, jobs: Sequence[Job], trials: Mapping[str, dict[str, Any]], asked: int | None = None
    ) -> None:
        self._row, self.asked, self.planned = row, len(jobs) if asked is None else asked, len(jobs)
        self.jobs = [job for job in jobs if job.key in trials]
        self.trials = [trials[job.key] for job in self.jobs]

    @property
    def directions(self) -> list[Direction]:
        """Of all trials."""
        return [each for job, trial in zip(self.jobs, self.trials, strict=True) for each in directions(job, trial)]

    def row(self, figure: str, value: float, unit: str, goal: str = "") -> dict:
        """A row; ``goal`` is "<= x" or ">= x" or nothing."""
        enough = len(self.trials) >= self.asked
        figure += "" if enough else too_few(len(self.trials), self.planned, self.asked)
        ok = meets(value, goal) and (enough or not goal)
        return self._row(figure, value if np.isfinite(value) else NEVER, unit, goal, ok)


def too_few(done: int, planned: int, asked: int) -> str:
    """What a row says of fewer trials than were asked: of a sample, or of a run that is not over."""
    if planned < asked:
        return f" [sample of {done} of {asked} asked: missed]"
    return f" [incomplete: missed; {done} of {asked} trials]"


def meets(value: float, goal: str) -> bool:
    """Whether a value is within "<= x" or ">= x"; anything is within no goal."""
    if not goal:
        return True
    limit = float(goal.split()[1])
    return bool(value <= limit if goal.startswith("<=") else value >= limit)


def late(values: Sequence[float | None], percentile: float) -> float:
    """A percentile of times, forces, ways: None is infinite, and no value stands between two that were measured."""
    found = [np.inf if v is None else v for v in values]
    return float(np.percentile(found, percentile, method="higher")) if found else np.inf


def share(good: Sequence[bool]) -> float:
    """Of those that are true; 0 of none."""
    return float(np.mean(good)) if len(good) else 0.0


def failures(found: Sequence[Direction]) -> str:
    """By reason, in words."""
    counted = Counter(each.end for each in found if not each.good).most_common()
    return ", ".join(f"{name.lower()} {n}" for name, n in counted) or "none"


def success_rows(group: Group) -> list[dict]:
    """The default world: who succeeds, what falls, how failures are called."""
    found = group.directions
    good = share([each.good for each in found])
    rows = [group.row(f"succeeded in truth, {len(found)} directions ({failures(found)})", good, "share", ">= 0.95")]
    for name in OBJECTS:
        part = [each for each in found if each.object_id == name]
        good = share([each.good for each in part])
        rows.append(group.row(f"succeeded, {name}, {len(part)} ({failures(part)})", good, "share", ">= 0.9"))
    eager = [each for each in found if each.eager]
    what = f"succeeded, people who place while the arm moves, {len(eager)} ({failures(eager)})"
    rows.append(group.row(what, share([each.good for each in eager]), "share", ">= 0.9"))
    for action, what in ((RECEIVE, "receiving"), (GIVE, "giving")):
        part = [each for each in found if each.action == action]
        begun = [each for each in part if each.end != NOT_BEGUN]
        rows.append(group.row(f"succeeded, {what}, {len(part)}", share([each.good for each in part]), "share"))
        what = f"succeeded, {what}, of {len(begun)} begun ({failures(begun)})"
        rows.append(group.row(what, share([each.good for each in begun]), "share"))
    fell, stuck = (sum(bool(trial[name]) for trial in group.trials) for name in ("fell", "stuck"))
    claimed = sum(each.end == CLAIMED for each in found)
    vague = sum(each.end in UNDOCUMENTED for each in found)
    return [
        *rows,
        group.row("the object fell", fell / max(1, len(group.trials)), "share of trials", "<= 0.01"),
        group.row("success claimed that was none", claimed, "directions"),
        group.row("failures without one documented outcome", vague, "directions", "<= 0"),
        group.row("the machine is stuck", stuck, "trials", "<= 0"),
    ]


def hardship_rows(group: Group, name: str) -> list[dict]:
    """One hardship alone, or all."""
    found = group.directions
    goal = ">= 0.75" if name == ALL_TOGETHER else ">= 0.9"
    what = f"hardship {name}: succeeded in truth, {len(found)} directions ({failures(found)})"
    return [group.row(what, share([each.good for each in found]), "share", goal)]


def interrupted_rows(group: Group, what: str, documented: set[int]) -> list[dict]:
    """Withdrawals or falls: outcomes and the palm's speed afterwards."""
    found = group.directions
    names = {number: campaign.REASONS[number] for number in documented | NOT_OFFERED}

    def as_documented(each: Direction) -> bool:
        moved = each.truth.get("moved_before", True)
        allowed = documented if moved else documented | NOT_OFFERED
        return "event" in each.truth and each.end in {names[number] for number in allowed}

    happened = [each for each in found if "event" in each.truth]
    other_ends = Counter("succeeded" if each.good else each.end.lower() for each in found if not as_documented(each))
    named = ", ".join(f"{name} {n}" for name, n in other_ends.most_common()) or "none"
    chase, at_once = (max((each.truth[k] for each in happened), default=np.inf) for k in ("chase", "chase_at_once"))
    good = share([as_documented(each) for each in found])
    return [
        group.row(f"{what}: end in their outcome, of {len(found)} (others: {named})", good, "share", ">= 1"),
        group.row(f"{what} that came about", len(happened), f"of {len(found)}"),
        group.row(f"{what}: palm toward hand or object from 0.2 s after on, largest", chase, "m/s", "<= 0.25"),
        group.row(f"{what}: palm toward hand or object from 0.2 s after its first moment on, largest", at_once, "m/s"),
    ]
