"""How far the palm was from where a reach was to bring it: by the simulated cell's truth, not by who steers the arm.

A reach begins with each execute_dmp of an exchange and is over when wait_stop is left, whatever the outcome. It is
measured where its last motion ended: at the change of the motion's state that ended it, or, where the brain ended it
(at the touch, or as the person came), when wait_stop was left. Nothing is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from coglab_py.pose import Pose

if TYPE_CHECKING:
    from coglab_bringup.trial_recorder import Trial

TAKES, GIVES = "exchange_human_to_robot", "exchange_robot_to_human"
MOVING = ("running", "holding")  # states of a motion that is on its way
OLDEST = 0.1  # s, before the moment that is measured, from which a truth still tells where things were


@dataclass(frozen=True)
class Reach:
    """One reach: when (s) it was measured, and how it ended: reached, met (by a touch, or as the person came) or
    unfinished."""

    moment: float
    ended: str


def reaches_of(trial: Trial, start: float, end: float) -> Iterator[Reach]:
    """The reaches that began between `start` and `end` (s); one that nobody ended is measured at `end`, by the last
    truth until then."""
    rows = [row for row in trial.transitions if start <= row[0] <= end and row[1].endswith("/approach/arm_motion")]
    begun: float | None = None
    for t, _, from_state, outcome, *_ in rows:
        if from_state == "execute_dmp" and outcome == "succeeded":
            begun = t
        elif from_state == "wait_stop" and begun is not None:
            yield _ended(trial, begun, t, outcome == "succeeded")
            begun = None
    if begun is not None:
        yield _ended(trial, begun, min([end, *(row[0] for row in trial.poses[-1:])]), False)


def _ended(trial: Trial, begun: float, left: float, succeeded: bool) -> Reach:
    states = [(t, state) for t, state, _ in trial.feedback if begun <= t <= left]
    ends = [later for (_, before), later in zip(states, states[1:], strict=False) if before in MOVING]
    ends = [(t, state) for t, state in ends if state not in MOVING]
    stands = bool(ends) and states[-1][1] not in MOVING
    if stands and ends[-1][1] == "reached":
        return Reach(ends[-1][0], "reached")
    return Reach(ends[-1][0] if stands else left, "met" if succeeded else "unfinished")


def grasp_of(trial: Trial, until: float) -> str:
    """Name of the grasp that was chosen last before `until` (s), as set_dmp_goal tells it; empty if none was."""
    told = [row[5] for row in trial.transitions if row[0] <= until and row[2] == "set_dmp_goal"]
    found = [match.group(1) for match in (re.fullmatch(r"grasp '(.+)'", reason) for reason in told) if match]
    return found[-1] if found else ""


def palm_goal(kind: str, entry: Mapping[str, Any], grasp: str) -> Pose:
    """Where the palm is to be by the object's file: from a person relative to the object, to a person relative to the
    person's hand. Neither stand-off nor what the brain adds to its goal is in it."""
    palm = Pose.from_dict(entry["grasps"][grasp or entry["default_grasp"]]["pose"])
    if kind == TAKES:
        return palm
    return Pose.from_dict(entry["deliveries"][entry["default_delivery"]]["pose"]) * palm


def reach_errors(trial: Trial, kind: str, entry: Mapping[str, Any] | None, start: float, end: float) -> dict[str, Any]:
    """Fields of result.json: `reaches`, each with how it ended, mm and degrees; those of the last one once more as
    `final_error_mm` and `final_error_deg`; and who measured them, or why nobody did."""
    reaches = list(reaches_of(trial, start, end))
    rows: list[dict[str, Any]] = [
        {"ended": reach.ended, **_error(trial, kind, entry, reach.moment)} for reach in reaches
    ]
    last = rows[-1] if rows else {"error_mm": None, "error_deg": None}
    if kind not in (TAKES, GIVES):
        by = "nobody: the goal of this action is no grasp of a person's object"
    elif not rows:
        by = "nobody: no reach began"
    elif entry is None:
        by = "nobody: the object database did not tell the object's grasps"
    elif not trial.poses:
        by = "nobody: there is no truth on /coglab_sim/truth/cell, as with a real robot"
    elif last["error_mm"] is None:
        by = "nobody: the truth or the choice of the grasp was not told at the end of the reach"
    else:
        by = "truth of the simulated cell"
    return {
        "final_error_mm": last["error_mm"],
        "final_error_deg": last["error_deg"],
        "final_error_by": by,
        "reaches": rows,
    }


def _error(trial: Trial, kind: str, entry: Mapping[str, Any] | None, moment: float) -> dict[str, float | None]:
    """mm and degrees from palm to goal as they truly were, None where that is not known."""
    truth = [row for row in trial.poses if moment - OLDEST <= row[0] <= moment]
    grasp = grasp_of(trial, moment)
    if entry is None or kind not in (TAKES, GIVES) or not truth or (kind == TAKES and not grasp):
        return {"error_mm": None, "error_deg": None}
    _, palm, hand, thing = truth[-1]
    metres, angle = palm.distance((thing if kind == TAKES else hand) * palm_goal(kind, entry, grasp))
    return {"error_mm": round(1000.0 * metres, 3), "error_deg": round(float(np.degrees(angle)), 3)}
