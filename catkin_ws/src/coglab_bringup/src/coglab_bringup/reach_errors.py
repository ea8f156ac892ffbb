"""Distance of the palm from the correct grasp at the end of each reach, measured in the simulated cell.

A reach begins with each execute_dmp of an exchange and is over when wait_stop is left. It is measured at the end of its
last motion. If the machine ended the motion (at contact, or because the person came), it is measured when wait_stop is
left.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from coglab_py.pose import Pose

if TYPE_CHECKING:
    from coglab.series import Series

TAKES, GIVES = "exchange_human_to_robot", "exchange_robot_to_human"
MOVING = ("running", "holding")  # states of a motion in progress
OLDEST = 0.1  # s, largest age of the simulated poses that are used


def _reaches_of(trial: Series, start: float, end: float) -> Iterator[tuple[float, str]]:
    """Time of the measurement (s) of each reach that began between `start` and `end` (s), and how it ended: reached,
    met or unfinished."""
    begun: float | None = None
    for t, path, from_state, outcome, *_ in trial.transitions:
        if not start <= t <= end or not path.endswith("/approach/arm_motion"):
            continue
        if from_state == "execute_dmp" and outcome == "succeeded":
            begun = t
        elif from_state == "wait_stop" and begun is not None:
            yield _end_of(trial, begun, t, outcome == "succeeded")
            begun = None
    if begun is not None:
        yield _end_of(trial, begun, min([end, *(row[0] for row in trial.poses[-1:])]), False)


def _end_of(trial: Series, begun: float, left: float, succeeded: bool) -> tuple[float, str]:
    states = [(t, state) for t, state, _ in trial.feedback if begun <= t <= left]
    pairs = zip(states, states[1:], strict=False)
    ends = [later for (_, before), later in pairs if before in MOVING and later[1] not in MOVING]
    stands = bool(ends) and states[-1][1] not in MOVING
    if stands and ends[-1][1] == "reached":
        return ends[-1][0], "reached"
    return (ends[-1][0] if stands else left), ("met" if succeeded else "unfinished")


def _grasp_of(trial: Series, until: float) -> str:
    """Name of the last grasp chosen before `until` (s), from the transitions of set_dmp_goal; empty if none was."""
    told = [row[5] for row in trial.transitions if row[0] <= until and row[2] == "set_dmp_goal"]
    found = [match.group(1) for match in (re.fullmatch(r"grasp '(.+)'", reason) for reason in told) if match]
    return found[-1] if found else ""


def _error(trial: Series, kind: str, entry: Mapping[str, Any] | None, moment: float) -> dict[str, float | None]:
    """Distance in mm and angle in degrees from the palm to its goal: the grasp in the object's file, or the delivery
    pose in front of the person's hand. None if unknown."""
    truth = [row for row in trial.poses if moment - OLDEST <= row[0] <= moment]
    grasp = _grasp_of(trial, moment)
    if entry is None or kind not in (TAKES, GIVES) or not truth or (kind == TAKES and not grasp):
        return {"error_mm": None, "error_deg": None}
    _, palm, hand, thing = truth[-1]
    goal = Pose.from_dict(entry["grasps"][grasp or entry["default_grasp"]]["pose"])
    if kind == GIVES:
        goal = hand * Pose.from_dict(entry["deliveries"][entry["default_delivery"]]["pose"]) * goal
    metres, angle = palm.distance(thing * goal if kind == TAKES else goal)
    return {"error_mm": round(1000.0 * metres, 3), "error_deg": round(float(np.degrees(angle)), 3)}


def reach_errors(trial: Series, kind: str, entry: Mapping[str, Any] | None, start: float, end: float) -> dict[str, Any]:
    """Fields of result.json: `reaches`, the errors of the last reach as `final_error_mm` and `final_error_deg`, and the
    source of the measurement, or the reason why there is none. `entry`: the object's entry in the database."""
    rows: list[dict[str, Any]] = [
        {"ended": ended, **_error(trial, kind, entry, moment)} for moment, ended in _reaches_of(trial, start, end)
    ]
    last = rows[-1] if rows else {"error_mm": None, "error_deg": None}
    nobody = {
        "the goal of this action is no grasp of a person's object": kind not in (TAKES, GIVES),
        "no reach began": not rows,
        "the object database did not return the object": entry is None,
        "no truth is published on /coglab_sim/truth/cell, as with a real robot": not trial.poses,
        "truth or chosen grasp are unknown at the end of the reach": last["error_mm"] is None,
    }
    why = next((f"nobody: {reason}" for reason, true in nobody.items() if true), "truth of the simulated cell")
    errors = {"final_error_mm": last["error_mm"], "final_error_deg": last["error_deg"]}
    return {**errors, "final_error_by": why, "reaches": rows}
