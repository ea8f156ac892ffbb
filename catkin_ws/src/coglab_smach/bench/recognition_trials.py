"""The trials of recognition: what is recognised and believed in whole handovers, beside what the hand truly did."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import motion_figures
import numpy as np
from campaign import Job, one_trial
from coglab_perception.recogniser import UNKNOWN
from coglab_py.packages import package_path
from partner_trials import OtherWatch, other, recognised
from true_trace import RATE, TrueTrace

sys.path.insert(0, str(package_path("coglab_perception", "test")))
from synthetic_reaches import pattern_of

LATE = 0.3
"""s after a motion in which its last sights still arrive"""
SHARES = (0.4, 1.0)
"""of a reach's time, after which it is asked for the pattern"""
REACH, BACK, OTHER, REST = "reach", "back", "other", "rest"
MOTIONS = (REACH, BACK, OTHER)
EXECUTE, SWITCH = "execute_dmp", "switch_dmp"
Order = tuple[float, str, str]
"""s, EXECUTE or SWITCH, primitive: what the machine has asked the arm for"""
PHASES = {"reaching": REACH, "hesitating": REACH, "retreating": BACK, "idle": REST, "reacting": REST}
"""what the person's hand is about by the person's phase; in the others it waits for the robot, places, holds"""


@dataclass
class Seen:
    """A row of each for every FRI period."""

    time: list[float] = field(default_factory=list)
    """s, of the world"""
    about: list[str] = field(default_factory=list)
    place: list[np.ndarray] = field(default_factory=list)
    """m, of the person's hand in truth"""
    speed: list[float] = field(default_factory=list)
    """m/s, its own"""
    grip: list[float] = field(default_factory=list)
    best: list[str] = field(default_factory=list)
    """the most likely pattern, decided or not"""
    decided: list[str] = field(default_factory=list)
    """the pattern that is decided; empty: none"""
    offer: list[float] = field(default_factory=list)
    request: list[float] = field(default_factory=list)


class Recognised(TrueTrace):
    """Watches a VirtualTrial that has a recogniser."""

    def __init__(self, trial: Any, *more: Any) -> None:
        super().__init__(trial, *more)
        self.seen = Seen()
        self.orders: list[Order] = []
        for name in (EXECUTE, SWITCH):
            self._listen(name)

    def _listen(self, name: str) -> None:
        asked = getattr(self.trial.ctx.arm, name)

        def order(request: Any) -> Any:
            self.orders.append((self.rig.t, name, request.primitive_id))
            return asked(request)

        setattr(self.trial.ctx.arm, name, order)

    def look(self, trial: Any) -> None:
        super().look(trial)
        if self.sample is None:
            return
        seen, estimate = self.seen, trial.recogniser.estimate
        belief = trial.ctx.perception.belief.belief
        seen.time.append(self.rig.t)
        seen.about.append(self.about())
        seen.place.append(np.array(self.rig.cell.truth()["human_hand"]["position"]))
        seen.speed.append(float(np.linalg.norm(self.sample.velocity)))
        seen.grip.append(float(self.sample.grip))
        seen.best.append(estimate.pattern)
        seen.decided.append(estimate.pattern if estimate.decided else "")
        seen.offer.append(belief.offer)
        seen.request.append(belief.request)

    def about(self) -> str:
        """What the hand is about now."""
        return PHASES.get(self.sample.phase, "")

    def figures(self) -> dict[str, Any]:
        """``motions``: see ``motions_of``; ``rests``: see ``rests_of``."""
        seen = {name: np.array(values) for name, values in vars(self.seen).items()}
        level = self.trial.ctx.perception.belief.settings.decision
        family = self.trial.ctx.config.get("monitor.primitives")
        motions = motions_of(seen, self.orders, family, level)
        return {"motions": motions, "rests": rests_of(seen, level)}


class RecognisedOther(Recognised, OtherWatch):
    """The same of a hand that is about something else."""

    def about(self) -> str:
        if self.rig.human is not getattr(self, "hand", None):
            return super().about()
        begun = self.hand.begun
        moves = begun is not None and self.motion.onset <= self.rig.t - begun <= self.motion.over
        return OTHER if moves else REST


def parts_of(about: np.ndarray) -> list[tuple[str, int, int]]:
    """(what, first index, index after the last) of all parts in which the hand is about the same."""
    edges = [0, *(np.flatnonzero(about[1:] != about[:-1]) + 1), len(about)]
    return [(str(about[a]), int(a), int(b)) for a, b in zip(edges, edges[1:], strict=False) if b > a]


def motions_of(
    seen: dict[str, np.ndarray], orders: Sequence[Order], family: Mapping[str, str], level: float
) -> list[dict[str, Any]]:
    """Each motion of the person's hand, as plain data: ``about``; ``truth``: its pattern, empty for none and for what
    is no reach; ``duration`` (s) from its onset to its end; and what was made of it: see ``decisions_of``,
    ``beliefs_of`` and ``switches_of``."""
    found = []
    for what, begin, end in parts_of(seen["about"]):
        if what not in MOTIONS or end - begin < 2:
            continue
        first = begin + (motion_figures.onset(seen["speed"][begin:end], RATE) or 0)
        later = np.flatnonzero(np.isin(seen["about"][end:], MOTIONS))
        following = end + int(later[0]) if len(later) else len(seen["time"])
        until = min(following, int(np.searchsorted(seen["time"], seen["time"][end - 1] + LATE)))
        truth = pattern_of(seen["place"][end - 1] - seen["place"][begin]) if what == REACH else ""
        one = {"about": what, "truth": truth, "duration": float(seen["time"][end - 1] - seen["time"][first])}
        one |= decisions_of(seen, what, (first, end, until), truth) | beliefs_of(seen, (first, until), level)
        limits = np.append(seen["time"], np.inf)[[begin, following]]
        during = [(name, primitive) for at, name, primitive in orders if limits[0] <= at < limits[1]]
        found.append(one | switches_of(during, family, truth))
    return found


def decisions_of(seen: dict[str, np.ndarray], what: str, span: tuple[int, int, int], truth: str) -> dict[str, Any]:
    """Of the motion from ``span[0]`` to ``span[1]``, whose last sights come before ``span[2]`` (indices). ``decided``:
    patterns in the order in which they were; what is left of an earlier motion counts in a reach, and only there.
    ``after``: s from the onset to the first of them, None without one. ``right_at``: whether the most likely pattern
    was the true one after these shares of the time."""
    first, end, until = span
    names, times = seen["decided"][first:until], seen["time"]
    last = str(seen["decided"][first - 1]) if first > 0 and what != REACH else ""
    decided, after = [], None
    for k, name in enumerate(names):
        if name and name != last:
            after = float(times[first + k] - times[first]) if not decided else after
            decided.append(str(name))
        last = name
    right_at = {}
    for share in SHARES:
        at = int(np.searchsorted(times, times[first] + share * (times[end - 1] - times[first])))
        right_at[f"{share:.0%}"] = bool(seen["best"][min(at, until - 1)] == (truth or UNKNOWN))
    return {"decided": decided, "after": after, "right_at": right_at}


def beliefs_of(seen: dict[str, np.ndarray], span: tuple[int, int], level: float) -> dict[str, Any]:
    """Of the motion between two indices. A closed hand offers, an open one asks. ``holds``; ``believed``: s from the
    onset to the belief in just that, None without one; ``other_kind``: the other one was believed; ``crossed``: any."""
    first, until = span
    holds = bool(seen["grip"][first] > 0.5)
    names = ("offer", "request") if holds else ("request", "offer")
    right, wrong = (np.flatnonzero(seen[name][first:until] >= level) for name in names)
    either = seen["offer"][first:until] + seen["request"][first:until] >= level
    believed = float(seen["time"][first + right[0]] - seen["time"][first]) if len(right) else None
    return {"holds": holds, "believed": believed, "other_kind": bool(len(wrong)), "crossed": bool(np.any(either))}


def switches_of(during: Sequence[tuple[str, str]], family: Mapping[str, str], truth: str) -> dict[str, Any]:
    """Of what the arm was asked for from a motion to the next. ``switched``: times that it was to switch;
    ``switched_wrong``: to a primitive that is not the true pattern's; ``needed``: a motion began with another primitive
    than the true pattern's among those that may be substituted; ``missing``: and it was never switched to that."""
    switched = [primitive for name, primitive in during if name == SWITCH]
    started = [primitive for name, primitive in during if name == EXECUTE and primitive in family.values()]
    wanted = family.get(truth)
    needed = wanted is not None and any(primitive != wanted for primitive in started)
    wrong = sum(primitive != wanted for primitive in switched)
    missing = needed and wanted not in switched
    return {"switched": len(switched), "switched_wrong": wrong, "needed": needed, "missing": missing}


def rests_of(seen: dict[str, np.ndarray], level: float) -> list[bool]:
    """Of each rest of the hand before a reach or another motion: whether an offer or a request was believed in it; what
    is left of the motion before counts no longer than its last sights take."""
    either, parts, found = seen["offer"] + seen["request"], parts_of(seen["about"]), []
    for (what, begin, end), (later, _, _) in zip(parts, parts[1:], strict=False):
        if what == REST and later in (REACH, OTHER):
            since = int(np.searchsorted(seen["time"], seen["time"][begin] + LATE))
            found.append(bool(np.any(either[since:end] >= level)))
    return found


def people(job: Job) -> dict[str, Any]:
    """Both directions of one person, with everything as it ships."""
    return one_trial(recognised(job), Recognised)


def others(job: Job) -> dict[str, Any]:
    """A hand that is about something else."""
    return other(job, RecognisedOther)
