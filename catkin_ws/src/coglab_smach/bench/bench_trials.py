#!/usr/bin/python3
"""Bench of whole trials in virtual time: each action, each misbehaviour, reaches with noisy and with perfect
perception. Noisy: noise, latency and dropouts, but no occlusion, no swaps and no miscalibration, which `partner` and
the world's rows have. A sample by default, whose rows meet no goal; with COGLAB_LONG=1 the campaigns (100 trials of
each action, 20 of each misbehaviour) and five sessions of the whole system in real time. Seeds of people come from
SHA-256 of the commit's hash, so that nobody has tried them; those of the world's rows are fixed, as their baseline's.

Definitions. Succeeded: the share of all trials asked for; an action that never began, or got stuck, has not. Reach: one
DMP motion; every one is in the percentiles of its distances, where the arm stood, or, if it never did (it was met by a
touch, or is unfinished), at its end; the two kinds are shown apart beside it. Hand to the latched goal: to the one that
the motion has estimated and latched; to the pose as received: to the tracker's newest sight at that moment; to the true
grasp pose: by the cell's truth. A trial in which no reach of the action began, and a reach without such a goal, are
infinitely far off and infinitely late, shown as 999; percentiles are by rank, the higher one. Later than a person:
after coglab_sim's duration of a person's reach over the same way. Within 5 mm: from when on the measured palm stays
there, of the goal in use; an unfinished reach, one that stands or is met farther off, or one of less than 20 cycles, is
infinitely late. Met on the way: a touch of the person ended the reach, wherever the palm was then; with it as the
arrival of such a reach the same is judged once more. SPARC: 10 Hz, amplitude 0.05, of every reach of 20 cycles and
more. Misbehaving partners: accustomed people before the noisy tracker, 1 trial each, 20 with --long; each has one right
outcome, which for some depends on who holds the object in the end, by the cell's truth; beside it the share of each
final holder, so that losing the object every time cannot look like success. The definitions of the world's rows stand
in world_rows.py.
"""

import json
import os
import sys
from collections import Counter
from dataclasses import replace

import campaign as trials
import numpy as np
from campaign import EXCHANGES, Campaign, of_asked
from coglab_sim.conditions import CONSIDERATE, Conditions
from coglab_sim.tracker.tracker import PerceptionSettings
from misbehaviours import BY_HOLDER, OUTCOMES
from partner_rows import seeds_of
from trial_file import commit_of_sources
from world_rows import palm_rows, physics_rows, run_default, world_rows

LONG = os.environ.get("COGLAB_LONG") == "1"
TRIALS_ASKED, MISBEHAVED_ASKED = 100, 20
TRIALS = TRIALS_ASKED if LONG else 12
MISBEHAVED = MISBEHAVED_ASKED if LONG else 1
BOARD_ACTIONS = ("take", "put")
NOISY = Conditions(
    profile="accustomed",
    perception=PerceptionSettings(
        occlusion_distance=0.0, swap_probability=0.0, calibration_offset=0.0, calibration_turn_deg=0.0
    ),
)
"""Of the figures of single reaches: an accustomed person, a calibrated tracker with noise, latency and dropouts."""


def row(figure, value, unit, goal="", ok=True, peer=None, peer_value=None):
    """One row of the bench table."""
    return {
        "bench": "trials",
        "figure": figure,
        "value": value if value is None else round(float(value), 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": peer_value if peer_value is None else round(float(peer_value), 4),
        "ok": bool(ok),
    }


NEVER = 999.0
"""shown for what never happened, whatever the unit"""


def reach_rows(campaign, action, perception):
    """Duration, smoothness, end of every reach. Distances to the pose as received and, beside it, to the latched goal,
    which is the controller's own estimate; to the truth with a goal only where perception is perfect."""
    begun, without, what = campaign.reaches[action], campaign.without_reach[action], f"{action}, {perception}"
    reaches = [*begun, *[{"stood": False, "met": False}] * without]
    told, seen = (sum(key in each for each in reaches) for key in ("goal_mm", "sight_mm"))
    smooth = [each["sparc"] for each in reaches if "sparc" in each]
    unfinished = sum(not (each["stood"] or each["met"]) for each in begun)
    every, of = len(reaches), f"of {len(reaches)}"
    counted = [
        row(f"{what}: trials in which no reach began", without, of),
        *(
            row(f"{what}: reaches with a {name} at their end", n, of, f">= {every}", every > 0 and n == every)
            for name, n in (("latched goal", told), ("sight", seen))
        ),
        row(f"{what}: reaches unfinished", unfinished, of),
        row(f"{what}: reaches of 20 cycles and more", len(smooth), of),
        *palm_rows(row, begun, what),
    ]

    def judged(name, value, unit, goal, least=False):
        if value is None:
            return row(f"{what}: {name}", None, unit, goal, not goal)
        limit = float(goal.split()[-1]) if goal else 0.0
        met = not goal or (value >= limit if least else value <= limit)
        return row(f"{what}: {name}", min(value, NEVER), unit, goal, met)

    def ranked(key, share=95):
        """A percentile by rank, in which what never happened is infinite; None where nothing was tried."""
        return np.percentile([each.get(key, np.inf) for each in reaches], share, method="higher") if reaches else None

    true_goals = ("<= 5", "<= 3") if perception == "perfect perception" else ("", "")
    later = "later than a person"
    return [
        *counted,
        judged("hand to the pose as received, p95", ranked("sight_mm"), "mm", "<= 5"),
        judged("hand to the pose as received, p95", ranked("sight_deg"), "deg", "<= 3"),
        judged("hand to the latched goal, p95", ranked("goal_mm"), "mm", "<= 5"),
        judged("hand to the latched goal, p95", ranked("goal_deg"), "deg", "<= 3"),
        judged("hand to the true grasp pose, p95", ranked("truth_mm"), "mm", true_goals[0]),
        judged("hand to the true grasp pose, p95", ranked("truth_deg"), "deg", true_goals[1]),
        judged(f"arm within 5 mm of its goal {later}, median", ranked("late", 50), "s", "<= 0.25"),
        judged(f"arm within 5 mm of its goal {later}, p95", ranked("late"), "s", ""),
        judged(f"arm there, or met on the way, {later}, median", ranked("met_late", 50), "s", "<= 0.25"),
        judged(f"arm there, or met on the way, {later}, p95", ranked("met_late"), "s", ""),
        judged(f"'reached' or met {later}, median", ranked("reached_late", 50), "s", ""),
        judged("SPARC, median", np.median(smooth) if smooth else None, "1", ">= -1.6", least=True),
        judged("SPARC, p5", np.percentile(smooth, 5) if smooth else None, "1", ""),
    ]


def misbehaviour_rows(commit):
    """Each behaviour ends in the outcome of its table; where that has two, the true holder decides, with a row each."""
    rows, everything = [], Campaign()
    for (action, behaviour), outcome in sorted(OUTCOMES.items(), key=lambda item: item[0]):
        actions = EXCHANGES if action == EXCHANGES[1] else (action,)
        kw = {"conditions": NOISY, "later_behaviour": behaviour}
        if len(actions) == 1:
            kw = {"conditions": replace(NOISY, behaviour=behaviour)}
        seeds = seeds_of(commit, f"trials, {action}, {behaviour}", MISBEHAVED)
        campaign = Campaign().run_each(actions, [(seed, kw) for seed in seeds], behaviour)
        rows += documented_rows(campaign, action, behaviour, outcome) + holder_rows(campaign, action, behaviour)
        everything.fastest = max(everything.fastest, campaign.fastest)
        for name in ("outside_commanded", "outside_measured", "over_command", "moving", "stuck", "trials"):
            setattr(everything, name, getattr(everything, name) + getattr(campaign, name))
    return rows + everything.safety_rows(row, "misbehaving partners")


def documented_rows(campaign, action, behaviour, outcome):
    """How many trials of a behaviour have ended as documented; a kind that did not occur beside the other has no value,
    and nothing is judged of it."""
    what = f"{action} with '{behaviour}' x {campaign.trials}"
    if outcome != BY_HOLDER:
        cases = [("", outcome, campaign.ends[action])]
    else:
        of = {held: [end for end in campaign.ends[action] if (end[1] == "robot") == held] for held in (True, False)}
        cases = [
            (", the robot holds the object in the end", outcome[0], of[True]),
            (", the robot does not hold it in the end", outcome[1], of[False]),
        ]
    rows = []
    occurred = len(campaign.ends[action])
    for where, wanted, ends in cases:
        good, got = sum(end[0] == wanted for end in ends), Counter(end[0] for end in ends)
        told = ", ".join(f"{name} {n}" for name, n in sorted(got.items())) or f"did not occur in {occurred} trials"
        figure = f"{what}{where}: ends with {wanted} ({told})"
        share = good / len(ends) if ends else None
        fine = share is not None and share >= 1.0 and campaign.stuck == 0
        unjudged = not ends and occurred > 0
        rows.append(row(figure, share, "share", "" if unjudged else ">= 1", unjudged or fine))
    return rows


def holder_rows(campaign, action, behaviour):
    """The share of each true holder at the end, the robot's even where it never is; no goal, since several may be."""
    held = Counter(holder or "nobody" for _, holder in campaign.ends.get(action, ()))
    what, every = f"{action} with '{behaviour}' x {campaign.trials}", sum(held.values())
    return [
        row(f"{what}: {name} holds the object in the end", held[name] / every if every else None, "share")
        for name in sorted({"robot", *held})
    ]


def people_rows(commit):
    """Each action with accustomed people, and every reach, with noisy and with perfect perception."""
    rows, seeds = [], seeds_of(commit, "trials, noisy", TRIALS)
    exchanges = Campaign().run(EXCHANGES, seeds, conditions=NOISY)
    board = Campaign().run(BOARD_ACTIONS, seeds, conditions=NOISY, object_on="world")
    speed = (exchanges.virtual + board.virtual) / (exchanges.processor + board.processor)
    for campaign, actions in ((exchanges, EXCHANGES), (board, BOARD_ACTIONS)):
        for action in actions:
            share = campaign.share(action)
            what = f"{action}: {TRIALS} accustomed people, noisy tracker without occlusion, succeeded"
            rows.append(row(what, share, "share", ">= 0.97", share >= 0.97))
        rows += campaign.safety_rows(row, " and ".join(actions))
    rows.append(row("virtual time over processor time, one core", speed, "x", ">= 10", speed >= 10))
    perfect = Campaign().run(EXCHANGES, seeds_of(commit, "trials, perfect", TRIALS), conditions=CONSIDERATE)
    for campaign, name in ((exchanges, "noisy perception"), (perfect, "perfect perception")):
        for action in EXCHANGES:
            rows += reach_rows(campaign, action, name)
    return rows


def main() -> int:
    """Print the rows."""
    rows = physics_rows(row) + world_rows(row, run_default())
    commit = commit_of_sources() if trials.FILE is None else trials.FILE.commit
    rows += of_asked(people_rows(commit), TRIALS, TRIALS_ASKED)
    rows += of_asked(misbehaviour_rows(commit), MISBEHAVED, MISBEHAVED_ASKED)
    if LONG:
        from real_time_sessions import session_rows

        rows += session_rows(row)
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
