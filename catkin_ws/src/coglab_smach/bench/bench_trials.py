#!/usr/bin/python3
"""Bench of whole trials in virtual time: each action, each misbehaviour, reaches with noisy and with perfect
perception. A sample by default; with COGLAB_LONG=1 the campaigns (100 trials of each action, 20 of each misbehaviour)
and five sessions of the whole system in real time."""

import json
import multiprocessing
import os
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import smach

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "test"))
from misbehaviours import OUTCOMES
from reach_figures import figures
from virtual_trial import VirtualTrial

LONG = os.environ.get("COGLAB_LONG") == "1"
TRIALS = 100 if LONG else 12
MISBEHAVED = 20 if LONG else 1
EXCHANGES = ("exchange_human_to_robot", "exchange_robot_to_human")
BOARD_ACTIONS = ("take", "put")


def row(figure, value, unit, goal="", ok=True, peer=None, peer_value=None):
    """One row of the bench table."""
    return {
        "bench": "trials",
        "figure": figure,
        "value": round(float(value), 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": peer_value if peer_value is None else round(float(peer_value), 4),
        "ok": bool(ok),
    }


def one_trial(job):
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
    if not stuck and trial.last_hub not in ("wait_without_object", "wait_with_object"):
        stuck = f"the machine waits in '{trial.last_hub}': {trial.ctx.journal.why()}"
    return {
        "seed": seed,
        "stuck": stuck,
        "outcomes": [(r.kind, r.outcome, r.reason) for r in results],
        "outside": trial.rig.robot.limit_violations,
        "moving": trial.ctx.contact.watched_while_moving,
        "virtual": trial.clock.now(),
        "processor": time.process_time() - started,
        "reaches": [(action, figures(reach)) for action, reach in zip(actions, trial.reaches, strict=False)],
    }


class Campaign:
    """Trials, on all cores; keeps counts, reasons and reach figures."""

    def __init__(self):
        self.outcomes = Counter()
        self.reaches = {action: [] for action in EXCHANGES}
        self.outside = self.moving = self.stuck = self.trials = 0
        self.virtual = self.processor = 0.0

    def run(self, actions, seeds, **kw):
        """One trial per seed; returns self."""
        jobs = [(actions, seed, kw) for seed in seeds]
        with multiprocessing.get_context("fork").Pool(min(len(jobs), os.cpu_count() or 1)) as pool:
            for trial in pool.imap(one_trial, jobs):
                self._count(actions, trial, kw.get("behaviour") or kw.get("later_behaviour", "normal"))
        return self

    def _count(self, actions, trial, behaviour):
        self.trials += 1
        for name in ("outside", "moving", "virtual", "processor"):
            setattr(self, name, getattr(self, name) + trial[name])
        self.stuck += bool(trial["stuck"])
        if trial["stuck"]:
            print(f"{behaviour}, seed {trial['seed']}: stuck: {trial['stuck']}", file=sys.stderr)
        for action in actions[len(trial["outcomes"]) :]:
            self.outcomes[(action, "not started")] += 1
        for kind, outcome, reason in trial["outcomes"]:
            self.outcomes[(kind, outcome)] += 1
            if outcome != "succeeded":
                print(f"{behaviour}, {kind}, seed {trial['seed']}: {outcome}: {reason}", file=sys.stderr)
        for action, found in trial["reaches"]:
            if action in self.reaches and found is not None:
                self.reaches[action].append(found)

    def share(self, action, good=("succeeded",)):
        """Share of the trials whose action ended so."""
        return sum(self.outcomes[(action, outcome)] for outcome in good) / max(1, self.trials)

    def safety_rows(self, what):
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


def reach_rows(campaign, action, perception):
    """What the issue asks of a reach. Distances to the goal as received; to the truth only with perfect perception."""
    found = campaign.reaches[action]
    if not found:
        return [row(f"{action}, {perception}: reaches measured", 0, "reaches", ">= 1", False)]
    many = {key: np.array([f[key] for f in found]) for key in found[0]}

    def judged(name, value, unit, goal, least=False):
        limit = float(goal.split()[-1]) if goal else 0.0
        return row(
            f"{action}, {perception}: {name}",
            value,
            unit,
            goal,
            not goal or (value >= limit if least else value <= limit),
        )

    true_goals = ("<= 5", "<= 3") if perception == "perfect perception" else ("", "")
    return [
        judged("hand to goal as received, p95", np.percentile(many["goal_mm"], 95), "mm", "<= 5"),
        judged("hand to goal as received, p95", np.percentile(many["goal_deg"], 95), "deg", "<= 3"),
        judged("hand to the newest single sight, p95", np.percentile(many["sight_mm"], 95), "mm", ""),
        judged("hand to the newest single sight, p95", np.percentile(many["sight_deg"], 95), "deg", ""),
        judged("hand to the true grasp pose, p95", np.percentile(many["truth_mm"], 95), "mm", true_goals[0]),
        judged("hand to the true grasp pose, p95", np.percentile(many["truth_deg"], 95), "deg", true_goals[1]),
        judged("arm there later than a person, median", np.median(many["late"]), "s", "<= 0.25"),
        judged("arm there later than a person, p95", np.percentile(many["late"], 95), "s", ""),
        judged("'reached' later than a person, median", np.median(many["reached_late"]), "s", ""),
        judged("SPARC, median", np.median(many["sparc"]), "1", ">= -1.6", least=True),
        judged("SPARC, p5", np.percentile(many["sparc"], 5), "1", ""),
    ]


def misbehaviour_rows():
    """Each behaviour ends in an outcome of its table."""
    rows, everything = [], Campaign()
    for (action, behaviour), allowed in sorted(OUTCOMES.items()):
        actions = EXCHANGES if action == EXCHANGES[1] else (action,)
        kw = {"later_behaviour": behaviour} if len(actions) == 2 else {"behaviour": behaviour}
        campaign = Campaign().run(actions, range(30, 30 + MISBEHAVED), **kw)
        share = campaign.share(action, allowed)
        got = ", ".join(f"{outcome} {n}" for (kind, outcome), n in sorted(campaign.outcomes.items()) if kind == action)
        rows.append(
            row(
                f"{action} with '{behaviour}' x {MISBEHAVED} ends as documented ({got})",
                share,
                "share",
                ">= 1",
                share >= 1.0 and campaign.stuck == 0,
            )
        )
        for name in ("outside", "moving", "stuck", "trials"):
            setattr(everything, name, getattr(everything, name) + getattr(campaign, name))
    return rows + everything.safety_rows("misbehaving partners")


def main() -> int:
    """Print the rows."""
    rows = []
    exchanges = Campaign().run(EXCHANGES, range(1000, 1000 + TRIALS))
    board = Campaign().run(BOARD_ACTIONS, range(1000, 1000 + TRIALS), object_on="world")
    speed = (exchanges.virtual + board.virtual) / (exchanges.processor + board.processor)
    for campaign, actions in ((exchanges, EXCHANGES), (board, BOARD_ACTIONS)):
        for action in actions:
            share = campaign.share(action)
            rows.append(row(f"{action}: {TRIALS} seeds, succeeded", share, "share", ">= 0.97", share >= 0.97))
        rows += campaign.safety_rows(" and ".join(actions))
    rows.append(row("virtual time over processor time, one core", speed, "x", ">= 8", speed >= 8))
    perfect = Campaign().run(EXCHANGES, range(2000, 2000 + TRIALS), perfect=True)
    for campaign, name in ((exchanges, "noisy perception"), (perfect, "perfect perception")):
        for action in EXCHANGES:
            rows += reach_rows(campaign, action, name)
    rows += misbehaviour_rows()
    if LONG:
        from real_time_sessions import session_rows

        rows += session_rows(row)
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
