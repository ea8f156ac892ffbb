#!/usr/bin/python3
"""Tracking of 300 random reaches at 200 Hz, none left out.

First the whole robot as it ships, in lockstep with the simulated one: acceleration and jerk limits, the guard, and the
shipped list of feedback controllers, whose profile for reaches is empty: as shipped none of them runs, and a row says
how many did. A reach that is refused, aborted or does not end at its goal is a miss. The arm as measured is the true
joint state behind its servos at the end of every period of every reach that began, until 1.5 s after it was reached,
aborted or given up. Its range, speed and acceleration (change of speed over one period) are judged against the limits,
with no allowance for what the servos add. Then the same reaches and figures, reported, with a list in which the profile
has all of the shipped controllers. Then the rule of priority alone, on an ideal robot: ours
beside plain scaling of the whole vector and KDL's solvers, all slowed by the same clock and with the Jacobian of the
same time. Each row has the peer in the one of its settings that is best by that row's own figure, and names it: no
single setting is as good in all of them. These rows are over all reaches, and once more over those in which no method's
joint comes to its stop, a peer's in the setting with the fewest misses, of these with the smallest 95th percentile of
the distance: where one does, all are equally far off, and nothing is seen of the rule. A peer that is not installed
makes its rows missed.
"""

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import coglab_controllers as cc
import lockstep
import numpy as np
from core_bench import LIMITS, URDF, Row, minimum_jerk, row
from tracking import DURATION, REACHES, Outcome, PyKDL, Reach, Solver, draw_reaches, kdl_solver, run, two_task

NEAR, TURNED = 0.001, 3.0
"""m from the path or the goal, and deg at the end: further off is a miss"""
RULE, DISTANCE = "rotation shrunk first, ideal arm", "distance from the path"
SETTINGS = {"wdls": (0.005, 0.01, 0.02, 0.05, 0.1), "pinv": (1e-5, 1e-3, 1e-2, 0.05, 0.1)}


def lockstep_outcomes(limits: cc.JointLimits, reaches: list[Reach], feedback: bool) -> list[lockstep.LockstepReach]:
    """The reaches through the whole robot in virtual time; `feedback`: with all of the shipped feedback controllers."""
    with tempfile.TemporaryDirectory() as folder:
        manager = lockstep.with_feedback(Path(folder)) if feedback else lockstep.as_shipped()
        return [lockstep.reach(r.posture, r.goal, r.target, limits, manager) for r in reaches]


def shipped_rows(limits: cc.JointLimits, reaches: list[Reach], feedback: bool = False) -> list[Row]:
    """Rows of the whole robot; `feedback`: all of the shipped feedback controllers run, and the figures are reported.
    Without coglab_sim they are missed."""
    how = "with all shipped feedback controllers enabled" if feedback else "as shipped"
    what = f"{how}, {len(reaches)} reaches in lockstep with the simulated arm"
    if lockstep._virtual is None:
        missing = row("tracking", f"{what}: not measured, coglab_sim is not built", 0.0, "1", "<= 0")
        return [{**missing, "value": None, "ok": False}]
    outcomes = lockstep_outcomes(limits, reaches, feedback)
    for outcome in outcomes:
        if outcome.why:
            print(outcome.why, file=sys.stderr)
    begun = [o for o in outcomes if o.begun]
    ends = 1000.0 * np.array([o.last for o in outcomes])
    paths = 1000.0 * np.array([o.off_path for o in begun])
    hits = [o for o in outcomes if not o.why and o.last <= NEAR and o.turned <= TURNED]
    refused = sum(not o.begun for o in outcomes)
    missed = f"misses: {refused} refused, {sum(bool(o.why) for o in begun)} aborted, the rest beyond 1 mm or 3 deg"

    def figure(words: str, value: float, unit: str, goal: str = "") -> Row:
        return row("tracking", f"{what}: {words}", value, unit, "" if feedback else goal)

    return [
        ran_row(what, begun, feedback),
        figure(missed, len(outcomes) - len(hits), "1", "<= 0"),
        figure("hand from its goal at the end, 95th percentile; misses as far as they are", np.percentile(ends, 95),
               "mm", "<= 1"),
        figure("hand from its goal at the end, median", np.median(ends), "mm"),
        figure(f"hand as measured from the path, largest of a reach, 95th percentile of the {len(begun)} begun",
               np.percentile(paths, 95), "mm"),
        figure("until the arm stands, median of those that did not miss", np.median([o.duration for o in hits]), "s"),
        figure("joint speed sent, largest over its limit", max(o.over for o in begun), "1", "<= 1.000001"),
        figure("joint acceleration sent, largest over its limit", max(o.acceleration for o in begun), "1", "<= 1.0001"),
        figure("joint speed of the arm as measured, largest over its limit", max(o.arm_over for o in begun), "1",
               "<= 1.000001"),
        figure("joint position of the arm as measured, farthest beyond its range, negative inside",
               max(o.arm_beyond for o in begun), "rad", "<= 0"),
        figure("joint acceleration of the arm as measured, largest over its limit",
               max(o.arm_acceleration for o in begun), "1", "<= 1.0001"),
    ]  # fmt: skip


def ran_row(what: str, begun: list[lockstep.LockstepReach], feedback: bool) -> Row:
    """How many feedback controllers ran: the most at any time of any reach, and where they are to run the fewest."""
    if feedback:
        words = f"{what}: feedback controllers that ran, the fewest at any time of the {len(begun)} begun"
        return row("tracking", words, min(o.feedback[0] for o in begun), "1", f">= {lockstep.listed()}")
    words = f"{what}: feedback controllers that ran, the most at any time of the {len(begun)} begun"
    return row("tracking", words, max(o.feedback[1] for o in begun), "1")


Settings = dict[str, list[Outcome]]
"""a peer: its outcomes by its setting, "" for one that has none"""


def off(outcomes: list[Outcome]) -> np.ndarray:
    """Largest distances from the path, mm."""
    return 1000.0 * np.array([o.worst for o in outcomes])


def misses(outcomes: list[Outcome]) -> int:
    """Reaches with a joint at its stop, off their path, or not turned at the end."""
    return sum(o.stopped or o.worst > NEAR or o.turned > TURNED for o in outcomes)


def stops(outcomes: list[Outcome]) -> int:
    """Reaches in which a joint came to its stop."""
    return sum(o.stopped for o in outcomes)


def not_turned(outcomes: list[Outcome]) -> float:
    """Share of the reaches that end more than 3 deg from the goal's orientation."""
    return float(np.mean([o.turned > TURNED for o in outcomes])) if outcomes else 0.0


def distance(share: float) -> Callable[[list[Outcome]], float]:
    """Percentile of the distances from the path."""
    return lambda outcomes: float(np.percentile(off(outcomes), share))


def misses_then_distance(outcomes: list[Outcome]) -> tuple[int, float]:
    """What the setting is chosen by that decides in which reaches a peer comes to a stop: one for all rows, because
    all are over the same reaches."""
    return misses(outcomes), distance(95.0)(outcomes)


def best_of(peer: Settings, figure: Callable[[list[Outcome]], float]) -> tuple[str, float]:
    """The setting in which a peer has the smallest figure, and that figure."""
    return min(((setting, figure(outcomes)) for setting, outcomes in peer.items()), key=lambda found: found[1])


def free_of_limits(ours: list[Outcome], peers: dict[str, Settings | None]) -> np.ndarray:
    """Of each reach whether no method's joint has come to its stop in it: there the rules of priority alone differ.
    Each peer counts in the setting that is best in the whole, so that a bad one takes no reach out."""
    methods = [ours, *(min(peer.values(), key=misses_then_distance) for peer in peers.values() if peer is not None)]
    return np.array([not any(outcomes[i].stopped for outcomes in methods) for i in range(len(ours))])


def priority_rows(ours: list[Outcome], peers: dict[str, Settings | None]) -> list[Row]:
    """Ours beside each peer, on an ideal robot: over all reaches, also those with a joint at its stop, which are
    counted beside; and over those in which no method meets a limit of position. None: a peer that is not there."""
    rows, free = [], free_of_limits(ours, peers)
    for name, theirs in peers.items():
        rows += missing_peer_rows(name) if theirs is None else peer_rows(ours, theirs, name, free)
    return rows


def missing_peer_rows(name: str) -> list[Row]:
    """What would stand beside a peer that is not installed; both rows with a goal of each kind are missed."""
    rows = []
    for where in (f"{REACHES} reaches", "reaches without a stop"):
        for words, goal in ((f"{DISTANCE}, 95th percentile", "<= 0.3"), (f"{DISTANCE}, largest", "<= 1")):
            row_ = row("tracking", f"{RULE}, {where}: {words}: not measured, no peer", 0.0, "mm", goal, name)
            rows.append({**row_, "value": None, "ok": False})
    return rows


def peer_rows(ours: list[Outcome], theirs: Settings, name: str, free: np.ndarray) -> list[Row]:
    """Rows beside one peer, which is in each in its best setting by the row's own figure; `free`: the reaches in which
    no method's joint has come to its stop."""

    def beside(
        of: tuple[list[Outcome], Settings],
        words: str,
        figure: Callable[[list[Outcome]], float],
        unit: str,
        goal: str = "",
    ) -> Row:
        setting, its = best_of(of[1], figure)
        peer = f"{name}, best setting by this row: {setting}" if setting else name
        return row("tracking", words, figure(of[0]), unit, goal, peer, its, below_peer=bool(goal))

    def without_stops(outcomes: list[Outcome]) -> list[Outcome]:
        return [o for o, kept in zip(outcomes, free, strict=True) if kept]

    every = ours, theirs
    rows = [beside(every, f"{RULE}, {REACHES} reaches: a joint came to its stop", stops, "1")]
    kept = without_stops(ours), {setting: without_stops(outcomes) for setting, outcomes in theirs.items()}
    where_kept = f"the {int(free.sum())} of {REACHES} reaches in which no method comes to a stop"
    for where, of in ((f"{REACHES} reaches", every), (where_kept, kept)):
        words = "misses (joint at its stop, 1 mm off the path, 3 deg at the end)"
        rows.append(beside(of, f"{RULE}, {where}: {words}", misses, "1"))
        for words, share, goal in (("95th percentile", 95.0, "<= 0.3"), ("largest", 100.0, "<= 1")):
            figure = f"{RULE}, {where}: {DISTANCE}, {words}"
            if of[0]:
                rows.append(beside(of, figure, distance(share), "mm", goal))
            else:
                rows.append({**row("tracking", figure, 0.0, "mm", goal, name), "value": None, "ok": False})
        words = "more than 3 deg from the goal's orientation at the end"
        rows.append(beside(of, f"{RULE}, {where}: {words}", not_turned, "share"))
    return rows


def main() -> None:
    """Prints the rows as JSON."""
    chain, limits = cc.Chain(URDF.read_text()), cc.load_joint_limits(str(LIMITS))
    times = np.linspace(0.0, DURATION, 241)
    primitive = cc.learn(
        "reach", [(times, np.outer(minimum_jerk(times / DURATION), [0.5, 0.0, 0.0]))], mapping="similarity"
    )
    reaches = draw_reaches(chain, limits)

    def all_of(solver: Solver) -> list[Outcome]:
        return [run(chain, limits, reach, primitive, solver) for reach in reaches]

    ours = all_of(two_task(chain, limits, True))
    peers: dict[str, Settings | None] = {
        "two tasks, whole vector scaled (plain D4.10)": {"": all_of(two_task(chain, limits, False))}
    }
    for kind, settings in SETTINGS.items():
        if not PyKDL:
            peers[f"KDL {kind}: PyKDL is not installed"] = None
            continue
        peers[f"KDL {kind}"] = {
            f"{setting:g}": all_of(kdl_solver(chain, limits, kind, setting)) for setting in settings
        }
    rows = shipped_rows(limits, reaches) + shipped_rows(limits, reaches, feedback=True) + priority_rows(ours, peers)
    tried = [ours, *(outcomes for peer in peers.values() for outcomes in (peer or {}).values())]
    over = max(o.over for outcomes in tried for o in outcomes)
    words = "ideal arm, every method in every setting: largest joint speed over its limit"
    rows.append(row("tracking", words, over, "1", "<= 1.000000001"))
    json.dump(rows, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
