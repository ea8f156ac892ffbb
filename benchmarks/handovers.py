#!/usr/bin/python3
"""Whole handovers with drawn people. Each result is measured on the true state of the simulated cell.

Success: the machine reports success, and at the end of the action the robot (receiving) or the person (giving) truly
holds the object. An action that never began has failed. First movement: speed above 0.02 m/s for 0.1 s; for the person
without sway. An arm that does not start is infinitely late. False starts: hands scratch, point or reach aside after the
robot got a request; the palm moves over 30 mm, or the trial failed. Pulls: people withdraw the object when they feel
the robot, or pull to and fro when the hand is closed. Later than a person: time until the palm stays within 5 mm of its
goal or meets the person, less a person's time over the same distance; accustomed people, noisy tracker.
"""

from __future__ import annotations

from collections.abc import Iterator

from coglab_sim.tracker.tracker import PerceptionSettings
from coglab_trials import Conditions
from common import Row, in_parallel, main, median, quantile, share
from trial_watch import OBJECTS, RECEIVE, Job, run_trial

FIRST_SEED = 100_000
NOISY = PerceptionSettings(
    occlusion_distance=0.0, swap_probability=0.0, calibration_offset=0.0, calibration_turn_deg=0.0
)


def jobs(first: int, count: int, **conditions: object) -> list[Job]:
    """Trials of `count` people, with the objects in turn."""
    return [
        Job(FIRST_SEED + first + i, Conditions(object_id=OBJECTS[i % len(OBJECTS)], **conditions)) for i in range(count)
    ]


def success(name: str, trials: list[dict], goal: str) -> Row:
    """Share of directions that truly succeed, two per trial."""
    good = [one["good"] for trial in trials for one in trial["directions"]]
    return share(name, good + [False] * (2 * len(trials) - len(good)), goal)


def drawn_people(quick: bool) -> Iterator[Row]:
    """Drawn people and the default tracker."""
    trials = in_parallel(run_trial, jobs(0, 4 if quick else 500))
    directions = [one for trial in trials for one in trial["directions"]]
    reaches = [reach for one in directions for reach in one["reaches"]]
    never = [None] * (2 * len(trials) - len(directions))
    yield success("handovers that succeed, drawn people and five objects", trials, ">= 95")
    yield share("objects that fall", [trial["fell"] for trial in trials], "<= 1")
    stuck = sum(bool(trial["stuck"]) for trial in trials)
    yield Row("trials in which a state machine gets stuck", stuck, "", "<= 0", f"of {len(trials)}")
    late = [one["late"] for one in directions] + never
    yield median("from the person's first movement to the arm's", late, "s", "<= 0.35")
    yield share("reaches with a single speed peak", [reach["peaks"] == 1 for reach in reaches], ">= 90")
    yield median("smoothness of the palm (SPARC; 0 is smoothest)", [r["sparc"] for r in reaches], "", ">= -1.5")
    yield median("length of the palm's path over the straight line", [r["detour"] for r in reaches], "", "<= 1.08")
    forces = [one["touch_force"] for one in directions if one["action"] == RECEIVE and one["touch_force"] is not None]
    yield quantile("force at touch, 95th percentile", forces, 0.95, "N", "<= 8")
    yield median("speed of a virtual trial on one core (real time: 1)", [t["speed"] for t in trials], "x", ">= 10")


def accustomed_people(quick: bool) -> Iterator[Row]:
    """People who know the robot, and a calibrated tracker with noise, latency and dropouts."""
    trials = in_parallel(run_trial, jobs(20_000, 4 if quick else 100, profile="accustomed", perception=NOISY))
    yield success("handovers that succeed, accustomed people", trials, ">= 97")
    late = [value for trial in trials for value in trial["late"] or [None]]
    yield median("extra time until the arm is at its goal, compared with a person, receiving", late, "s", "<= 0.25")


def false_starts(quick: bool) -> Iterator[Row]:
    """Hand motions that are neither offer nor request."""
    count = 6 if quick else 200
    others = [Job(FIRST_SEED + 40_000 + i, Conditions(), i) for i in range(count)]
    moved = [trial["moved"] is None or trial["moved"] > 0.030 for trial in in_parallel(run_trial, others)]
    what = "false starts: the arm moved for a hand motion that was no offer"
    interval = share("", moved).interval
    yield Row(what, 100.0 * sum(moved) / count, "%", "<= 5", interval)


def pulls(quick: bool) -> Iterator[Row]:
    """People who pull against the closing hand."""
    found = []
    for k, behaviour in enumerate(("pull_back", "tug")):
        each = jobs(60_000 + 1000 * k, 2 if quick else 50, behaviour=behaviour)
        trials = in_parallel(run_trial, [Job(job.seed, job.conditions, None, (RECEIVE,)) for job in each])
        found += [trial["directions"][0]["pull"] if trial["directions"] else None for trial in trials]
    what = "largest force on a person who pulls against the closing hand"
    yield quantile(what, found, 1.0, "N", "<= 15")


if __name__ == "__main__":
    main("handovers", drawn_people, accustomed_people, false_starts, pulls)
