#!/usr/bin/python3
"""Recognition in whole trials: drawn people, the default tracker, shipped patterns, belief and machine.

Definitions, fixed before anything was measured. 100 people x 2 directions, the objects in turn, and 50 hands that are
about something else (coglab_perception/test/other_motions.py, kinds in turn, half of them in a hub, half after the
robot was asked for an action, half with an object in the robot's hand, which that person has given before); without
--long a few. Seeds come from SHA-256 of the commit's hash, so that no file was made with them. All motions of all hands
count; nothing is left out, and what never happened is infinitely late and shown as 999.

Reach: the person is reaching, as the person knows; from the onset (own speed above 0.02 m/s for 0.1 s) to the arrival.
Way back: from the handover to rest. People have no patterns of their own: the true pattern of a reach is the one in
whose middle 99 % of displacements, as the shipped patterns were trained on them, its true displacement lies, the
nearest of several; where there is none, and for ways back and motions of something else, it is unknown. Decided: what
the recogniser says is decided, from the onset to the next motion, but at most 0.3 s after the end, when its last sights
have come; what is left from before counts in a reach. Right: the true pattern was decided and never another one; of an
unknown one: none was. Wrong: any other was, at any time.

switch_dmp: as the machine has asked the arm for it, from a motion's beginning to that of the next. Wrong: to a
primitive that `monitor.primitives` does not name for the true pattern; of an unknown one, to any. Needed: the arm has
begun with another primitive of these than the true pattern's. Belief: an offer of a closed hand, a request of an open
one, at or above `decision`, when the machine can read it. Before a motion: believed while the hand rests, 0.3 s after
its last motion and later.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Mapping
from typing import Any

import campaign
from campaign import EXCHANGES, Job, of_asked
from coglab_sim.conditions import Conditions
from partner_rows import LONG, RECEIVE, Group, late, object_of, run, seeds_of, share
from recognition_trials import BACK, OTHER, REACH, SHARES, others, people
from trial_file import commit_of_sources

ASKED = (100, 50)
PEOPLE, OTHERS = ASKED if LONG else (5, 3)


def row(figure: str, value: float, unit: str, goal: str = "", ok: bool = True) -> dict:
    """One row of the bench table."""
    columns = {"bench": "recognition", "figure": f"whole trials: {figure}", "value": round(float(value), 4)}
    return columns | {"unit": unit, "goal": goal, "peer": None, "peer_value": None, "ok": bool(ok)}


def jobs_of(commit: str) -> list[Job]:
    """All trials."""
    jobs = []
    for i, seed in enumerate(seeds_of(commit, "recognition, people", PEOPLE)):
        arguments: dict[str, Any] = {"conditions": Conditions(object_id=object_of(i))}
        jobs.append(Job("recognition, people", EXCHANGES, seed, arguments, people))
    for i, seed in enumerate(seeds_of(commit, "recognition, others", OTHERS)):
        arguments = {"conditions": Conditions(), "number": i, "hub": i // 2 % 2 == 0}
        jobs.append(Job("recognition, others", (RECEIVE,), seed, arguments, others))
    return jobs


def wrong(motion: Mapping[str, Any]) -> bool:
    """Another pattern than the true one was decided."""
    return any(name != motion["truth"] for name in motion["decided"])


def right(motion: Mapping[str, Any]) -> bool:
    """As defined above."""
    return not wrong(motion) and bool(motion["decided"]) == bool(motion["truth"])


def pattern_rows(group: Group, motions: list[dict[str, Any]]) -> list[dict]:
    """What was decided."""
    reaches = [each for each in motions if each["about"] == REACH]
    known, unknown = ([each for each in reaches if bool(each["truth"]) == is_known] for is_known in (True, False))
    true = ", ".join(f"{name or 'unknown'} {n}" for name, n in Counter(m["truth"] for m in reaches).most_common())
    of = f"of {len(known)} reaches of a pattern"
    rows = [
        group.row(f"a wrong pattern decided, of {len(motions)} motions", share(list(map(wrong, motions))), "share",
                  "<= 0.01"),
        group.row(f"reaches of an unknown pattern, of {len(reaches)} ({true or 'none'})", len(unknown), "reaches"),
        group.row(f"pattern rightly decided, {of}", share(list(map(right, known))), "share"),
        group.row(f"pattern wrongly decided, {of}", share(list(map(wrong, known))), "share"),
        group.row(f"no pattern decided, {of}", share([not each["decided"] for each in known]), "share"),
    ]  # fmt: skip
    parts = {"reaches of an unknown pattern": unknown}
    for name, about in (("ways back", BACK), ("motions of something else", OTHER)):
        parts[name] = [each for each in motions if each["about"] == about]
    for name, part in parts.items():
        rows.append(group.row(f"a pattern decided, of {len(part)} {name}", share(list(map(wrong, part))), "share"))
    for at in SHARES:
        good = share([each["right_at"][f"{at:.0%}"] for each in known])
        goal = ">= 0.95" if at == SHARES[0] else ""
        rows.append(group.row(f"pattern right after {at:.0%} of the time, {of}", good, "share", goal))
    after = [None if each["after"] is None else each["after"] / max(each["duration"], 1e-3) for each in known]
    for name, percentile in (("median", 50), ("95th percentile", 95)):
        rows.append(group.row(f"decided after, {name}, {of}", late(after, percentile), "share of the time"))
    return rows


def switch_rows(group: Group, motions: list[dict[str, Any]]) -> list[dict]:
    """What the machine has made of it."""
    needed = [each for each in motions if each["needed"]]
    switched = sum(each["switched"] for each in motions)
    wrong_ones = sum(each["switched_wrong"] for each in motions)
    followed = sum(each["switched"] > 0 for each in motions)
    missing = sum(each["missing"] for each in needed)
    return [
        group.row("motions that a switch_dmp followed", followed, f"of {len(motions)}"),
        group.row("switch_dmp to the primitive of a wrong pattern", wrong_ones, f"of {switched}"),
        group.row("switch_dmp that was needed and did not come", missing, f"of {len(needed)}"),
    ]


def belief_rows(group: Group, motions: list[dict[str, Any]], rests: list[bool]) -> list[dict]:
    """When it is believed, and when it is not so."""
    reaches = [each for each in motions if each["about"] == REACH]
    rows = []
    for name, part, goal in (
        ("reaches", reaches, "<= 0.25"),
        ("offers", [each for each in reaches if each["holds"]], ""),
        ("requests", [each for each in reaches if not each["holds"]], ""),
    ):
        delays, of = [each["believed"] for each in part], f"of {len(part)} {name}"
        rows.append(group.row(f"onset to belief, median {of}", late(delays, 50), "s", goal))
        rows.append(group.row(f"onset to belief, 95th percentile {of}", late(delays, 95), "s"))
        rows.append(group.row(f"never believed, {of}", sum(each is None for each in delays), name))
    other = [each["crossed"] for each in motions if each["about"] == OTHER]
    kinds = sum(each["other_kind"] for each in reaches)
    return [
        *rows,
        group.row("a request believed of an offer, or the other way round", kinds, f"of {len(reaches)}"),
        group.row(f"believed before there was a motion, of {len(rests)} rests of the hand", share(rests), "share"),
        group.row(f"believed of {len(other)} motions of something else", share(other), "share", "<= 0.05"),
    ]


def rows_of(commit: str, jobs: list[Job]) -> list[dict]:
    """All rows, of these trials."""
    group = Group(row, jobs, run(jobs))
    motions = [motion for trial in group.trials for motion in trial["truth"]["motions"]]
    rests = [believed for trial in group.trials for believed in trial["truth"]["rests"]]
    rows = pattern_rows(group, motions) + switch_rows(group, motions) + belief_rows(group, motions, rests)
    succeeded = [end[1] == "succeeded" for job, t in zip(group.jobs, group.trials, strict=True)
                 for end in campaign.ends_of(job.actions, t) if job.actions == EXCHANGES]  # fmt: skip
    asked = sum("hub" in job.arguments for job in group.jobs)
    missing = asked - sum(motion["about"] == OTHER for motion in motions)
    return [
        *rows,
        group.row(
            "motions of something else that were not carried out, the robot had no object", missing, f"of {asked}"
        ),
        group.row(f"the machine says that it has succeeded, of {len(succeeded)} directions", share(succeeded), "share"),
    ]


def main() -> int:
    """Print the rows."""
    commit = commit_of_sources() if campaign.FILE is None else campaign.FILE.commit
    print(json.dumps(of_asked(rows_of(commit, jobs_of(commit)), PEOPLE + OTHERS, sum(ASKED))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
