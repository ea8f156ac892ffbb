#!/usr/bin/python3
"""Bench of the partner: whole handovers with drawn people, each figure with its true quantity from the cell.

One run of the default world (people drawn, tracker as it is), profile and settings as shipped, and with the shipped
patterns recognised in every trial as in coglab.launch (they enter the prediction of where a hand will be, and the
monitor may switch the primitive): 100 people x 5 objects x 2 directions, and beside it the trials of single questions.
The recogniser takes each sight of the hand once, before the belief does, and is a new one in each trial. Seeds come
from SHA-256 of the commit's hash, so nobody has tried them. Without --long a few trials of each kind: a sample, which
meets no goal. COGLAB_TRIALS=FILE takes what `world_campaign.py FILE --of partner` has run; a row with fewer trials than
asked is incomplete, and missed if it has a goal. Nothing is left out of a percentile: what never happened is infinitely
late and shown as 999. Definitions, fixed before anything was measured:

Success: the machine says so, and at the end of the action the robot (receiving) or the person (giving) holds the
object in truth, and nobody else; claimed: the machine says so and that is not true. A direction that never began,
because the one before had failed, has failed. People who place while the arm moves: drawn so, or with a trust below
0.2 s; both of their directions count. Fell: it lies, or lay, on the floor. Documented: with a ReasonCode that is
neither 0 nor UNEXPECTED, or "not begun"; stuck and claimed are not.

Reach: from the beginning of a DMP motion to its end and until the palm stands (below 0.02 m/s; 0.5 s at most).
Wrong-way motion: farthest that the palm is behind where it had been already, along the line from its first to its last
place, until something touches the hand (0.5 N), or the person the object in it; reaches that end as withdrawn, outside
the region or fallen are counted apart. Speed peaks: of the palm's true speed, low-pass 10 Hz (Butterworth, second
order, both ways), prominence over 10 % of the largest. SPARC: 10 Hz, amplitude 0.05, of the whole reach. Path, peaks
and SPARC are of all reaches in which the palm moves.

Onset of hand (its own motion, without sway and tremor) or palm: where its speed is above 0.02 m/s for 0.1 s, first in
the action. An arm that does not start is infinitely late, and so is every direction that never began or in which the
person did not reach; how many of each is a row. Other motions: 200 (coglab_perception/test/other_motions.py), kinds in
turn, half with the object in the hand that moves, half with one in the robot's, which the drawn person has given it
before; palm: farthest from where it was, from the motion's beginning to 0.8 s after its end. Those that were not
carried out, because that person had failed, count as ones for which the palm moved, and are a row.

Human taker: starts 0.2 s after the onset and touches human_time(way from the palm at home to the object's middle)
later, but not before the object is there: the person's hand stands (below 0.02 m/s for 0.1 s), or the robot touches
it. Touch: 0.5 N on palm and fingers, all together. Weight carried: the robot's fingers hold the object, as the physics
has it, and at least half of the weight is on them, for 0.1 s; nine tenths is a row beside it. Holding on: from where
the object is there until the person's grip is below a half.

Speed near: the palm's own velocity along the line to the person's hand, within 0.25 m. Withdrawal and fall: while the
true distance from palm to object is a share of that at the reach's beginning, uniform in 0.30 .. 0.95; all the same
once the hand has waited in vain for 4 s. A withdrawal has happened once the hand is back by 0.10 m (as in
bench_belief), a fall when the object leaves the hand; speeds toward hand and object count from 0.2 s later to the end
of the action, at any distance. Outcomes: goal withdrawn or outside the region for a withdrawal, goal fell for a fall;
if the arm had not moved before, not seen on offer or not reachable, too. One in which it did not come about has not
ended in its outcome.

Force at touch: largest force of all that touches palm and fingers, in the first 0.1 s of touch. Pulling: people who
withdraw the object once it is felt in the palm ('pull_back') and who pull to and fro once the hand is closed ('tug'),
in turn; largest force of the object on the robot's hand while the person holds it, too, its weight included.
Hardships: 100 people, the objects in turn; all together is every one of them at once. Contact in motion has a bench of
its own: contact_motion.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from types import SimpleNamespace

import campaign
import numpy as np
import partner_motion_rows as motion
from campaign import Job
from coglab_controllers import GoalWatch
from coglab_py.packages import package_path
from coglab_sim.conditions import HARDSHIPS
from coglab_smach.context.config import Config
from coglab_smach.states.region import unless_withdrawn
from partner_rows import (
    ALL_TOGETHER,
    FELL,
    WITHDRAWN,
    Group,
    Row,
    asked_of,
    groups,
    hardship_rows,
    interrupted_rows,
    run,
    success_rows,
)
from trial_file import commit_of_sources, whole_hash
from world_rows import OBJECTS

SAME = {
    "timing": "natural",
    "postures.home": [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782],
    "handover.region_low": [0.45, -0.50, 0.05],
    "handover.region_high": [0.86, 0.50, 0.85],
    "handover.still_margin": 0.10,
    "handover.hand_margin": 0.10,
}
"""home and region when the goals were set, and the profile that they are for"""


def row(figure: str, value: float, unit: str, goal: str = "", ok: bool = True) -> dict:
    """One row of the bench table."""
    return {
        "bench": "partner",
        "figure": figure,
        "value": round(float(value), 4),
        "unit": unit,
        "goal": goal,
        "peer": None,
        "peer_value": None,
        "ok": bool(ok),
    }


def settings_rows(row: Row) -> list[dict]:
    """Nothing is won by moving home or region, nor by following what has left the region."""
    config = Config.load(str(package_path("coglab_smach", "config", "machines.yaml")), {})
    other = [name for name, value in SAME.items() if config.get(name) != value]
    changed = row(
        f"settings of home, region and timing that were changed ({', '.join(other) or 'none'})", len(other),
        "settings", "<= 0", not other)  # fmt: skip
    still, hand = (config.get(f"handover.{name}_margin") for name in ("still", "hand"))
    frames = {"where it is seen": "object_mug", "to where it will be": "object_mug_ahead"}
    ways = {way: followed(config, frame) for way, frame in frames.items()}
    words = (
        f"offered in it as at 5828bb3: handover.still_margin {still} m where it is held still, hand_margin {hand} m "
        f"for a hand that asks; on the way, of what has been in it, by the controller's own watch, "
        f"{', '.join(f'{way} {1000.0 * far:.0f} mm' for way, far in ways.items())}"
    )
    most = max(ways.values())
    return [changed, row(f"a reach follows what is outside the region ({words}), most", most, "m", "<= 0", most <= 0.0)]


def followed(config: Config, frame: str) -> float:
    """m beyond the handover region to which a reach follows this frame, which was in it and goes out, mm by mm, at each
    of its sides: the controller's watch with the limits that the machines give it."""
    region = np.array([config.get("handover.region_low"), config.get("handover.region_high")])
    middle, farthest = region.mean(axis=0), 0.0
    goal = unless_withdrawn(SimpleNamespace(config=config), {"frame": frame, "place": middle})
    sides = [goal["limits"][f"goal_region_{side}"] for side in ("low", "high")]
    for side, axis in np.ndindex(2, 3):
        watch = GoalWatch(*sides, 0.0, 0.0, middle, middle)
        place, out = middle.copy(), 1 if side else -1
        for beyond in np.arange(0.0, 1.0, 0.001):
            place[axis] = region[side, axis] + out * beyond
            if watch.update(0.005, place)[0]:
                break
            farthest = max(farthest, float(beyond))
    return farthest


def rows_of(row: Row, commit: str, jobs: Mapping[str, list[Job]]) -> list[dict]:
    """All rows, of these trials by group; their seeds are those of a commit."""
    trials = run([job for part in jobs.values() for job in part])
    group = {name: Group(row, part, trials, asked_of(name)) for name, part in jobs.items()}
    everybody = [job for name, part in jobs.items() if name.startswith("people") for job in part]
    people = Group(row, everybody, trials, len(OBJECTS) * asked_of("people"))
    rows = [*settings_rows(row), *success_rows(people), *motion.reach_rows(people), *motion.onset_rows(people)]
    rows += motion.other_rows(group["others"], False) + motion.other_rows(group["others, hub"], True)
    rows += motion.receiving_rows(people) + motion.speed_and_force_rows(people)
    rows += interrupted_rows(group["withdrawals"], "withdrawals", WITHDRAWN)
    rows += interrupted_rows(group["falls"], "falls", FELL)
    rows += motion.pull_rows(group["pulls"])
    for name in (*HARDSHIPS, ALL_TOGETHER):
        rows += hardship_rows(group[name], name)
    known = whole_hash(commit)
    changed = " with changes" if commit.endswith("-changed") else ""
    seeds = f"seeds of commit {known[:12]}{changed}" if known else "seeds of no commit: git does not tell"
    return [*rows, row(f"{seeds}: people", people.planned // len(OBJECTS), "people")]


def main() -> int:
    """Print the rows."""
    commit = commit_of_sources() if campaign.FILE is None else campaign.FILE.commit
    print(json.dumps(rows_of(row, commit, groups(commit))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
