"""Rows of bench_partner about how the arm moves: shape of its reaches, when it starts, touch, speeds and forces."""

from __future__ import annotations

import numpy as np
from coglab_msgs.msg import ReasonCode
from partner_rows import GIVE, RECEIVE, Direction, Group, late, share

GIVEN_UP = (
    ReasonCode.GOAL_WITHDRAWN,
    ReasonCode.GOAL_LEFT_REGION,
    ReasonCode.GOAL_AHEAD_OUTSIDE,
    ReasonCode.GOAL_FELL,
)
"""codes of reaches that end on the way, because there is nothing to reach for any more"""


def reach_rows(group: Group) -> list[dict]:
    """Straight toward the goal, in one go."""
    reaches = [reach for each in group.directions for reach in each.truth.get("reaches", [])]
    moved = [reach for reach in reaches if reach["moved"]]
    given_up = [reach for reach in reaches if reach["code"] in GIVEN_UP]
    wrong = [reach["wrong_mm"] for reach in reaches if reach["code"] not in GIVEN_UP]
    detours, smooth = [reach["detour"] for reach in moved], [reach["sparc"] for reach in moved]
    low = [float(np.percentile(smooth, p, method="lower")) if smooth else -np.inf for p in (50, 5)]
    of = f" of {len(moved)} reaches"
    single = share([reach["peaks"] == 1 for reach in moved])
    return [
        group.row("reaches of the palm, all", len(reaches), "reaches"),
        group.row("reaches in which the palm did not move", len(reaches) - len(moved), "reaches"),
        group.row(f"wrong-way motion, 99th percentile of {len(wrong)} reaches", late(wrong, 99), "mm", "<= 5"),
        group.row("wrong-way motion, worst", late(wrong, 100), "mm"),
        group.row("reaches given up on the way", len(given_up), f"of {len(reaches)}"),
        group.row(
            "wrong-way motion of reaches given up on the way, worst",
            max((r["wrong_mm"] for r in given_up), default=0.0),
            "mm",
        ),
        group.row(f"path over the straight line, median{of}", late(detours, 50), "share", "<= 1.08"),
        group.row(f"path over the straight line, 95th percentile{of}", late(detours, 95), "share"),
        group.row(f"reaches with one speed peak{of}", single, "share", ">= 0.9"),
        group.row(f"SPARC, median{of}", low[0], "1", ">= -1.5"),
        group.row(f"SPARC, 5th percentile{of}", low[1], "1", ">= -1.65"),
    ]


def starts_late(each: Direction) -> float | None:
    """s from the onset of the person's reach to that of the arm; None where one of them does not start."""
    arm, person = each.truth.get("arm_onset"), each.truth.get("onset")
    return None if arm is None or person is None else arm - person


def onset_rows(group: Group) -> list[dict]:
    """Start with the person: every direction counts, and one without both onsets is infinitely late."""
    found = group.directions
    every = [starts_late(each) for each in found]
    what = "onset of the person's reach to the onset of the arm"
    rows = [
        group.row(f"{what}, median of {len(every)}", late(every, 50), "s", "<= 0.35"),
        group.row(f"{what}, 95th percentile", late(every, 95), "s"),
    ]
    for action, name in ((RECEIVE, "receiving"), (GIVE, "giving")):
        part = [starts_late(each) for each in found if each.action == action]
        rows.append(group.row(f"{what}, {name}, median of {len(part)}", late(part, 50), "s"))
    begun = [each.truth for each in found if each.truth]
    hands = [truth for truth in begun if truth["onset"] is not None]
    arms = [truth for truth in hands if truth["arm_onset"] is not None]
    without = (
        ("the direction never began", len(found) - len(begun)),
        ("the person did not reach", len(begun) - len(hands)),
        ("the arm did not start", len(hands) - len(arms)),
    )
    for why, number in without:
        rows.append(group.row(f"{what}: infinitely late, {why}", number, f"of {len(found)}"))
    before = share([value is not None and value < 0.0 for value in every])
    return [*rows, group.row("the arm moves before the person's reach", before, "share")]


def other_rows(group: Group, hub: bool) -> list[dict]:
    """Hands that are about something else."""
    found = [trial["truth"] for trial in group.trials]
    done = [each for each in found if each["moved_mm"] is not None]
    what = "the hub left by recognition" if hub else "asked for by the operator"
    where = f"hand motions that are neither offer nor request, {what}"
    # One that was not carried out shows nothing, and counts as one for which the palm moved.
    moved = share([each["moved_mm"] is None or each["moved_mm"] > 30.0 for each in found])
    rows = [group.row(f"{where}: palm moves over 30 mm, of {len(found)}", moved, "share", "" if hub else "<= 0.05")]
    for holds, who in ((False, "object in the moving hand"), (True, "object in the robot's")):
        part = [each["moved_mm"] > 30.0 for each in done if each["robot_holds"] == holds]
        rows.append(group.row(f"{where}, {who}: palm moves over 30 mm, of {len(part)}", share(part), "share"))
    missing = len(found) - len(done)
    return [*rows, group.row(f"{where}: not carried out, the robot had no object", missing, f"of {len(found)}")]


def receiving_rows(group: Group) -> list[dict]:
    """Against a human taker."""
    begun = [each.truth for each in group.directions if each.action == RECEIVE]

    def times(name: str, what: str, goal: str) -> list[dict]:
        values = [each.get(name) for each in begun]
        return [
            group.row(f"{what}, median of {len(values)}", late(values, 50), "s", goal),
            group.row(f"{what}, 95th percentile", late(values, 95), "s"),
            group.row(f"{what}: never", sum(value is None for value in values), f"of {len(values)}"),
        ]

    moving = share([bool(each.get("touch_moving")) for each in begun])
    return [
        *times("touch_late", "receiving: first touch later than a human taker's", "<= 0.5"),
        *times("carry", "receiving: touch to grip closed and weight carried", "<= 1.2"),
        *times("carry_most", "receiving: touch to grip closed and nine tenths of the weight carried", ""),
        *times("holding_on", "receiving: the person's hand stands still and holds on", "<= 2"),
        group.row("receiving: the palm still moves at touch", moving, "share"),
    ]


def speed_and_force_rows(group: Group) -> list[dict]:
    """Near the person's hand."""
    begun = [each.truth for each in group.directions if each.truth]
    speeds = [each["near_speed"] for each in begun]
    forces = [each["touch_force"] for each in begun if each.get("touch_force") is not None]
    fastest, highest = late(speeds, 100), late(forces, 100)
    return [
        group.row("palm toward the person's hand within 0.25 m of it, largest", fastest, "m/s", "<= 0.5"),
        group.row("palm toward the person's hand within 0.25 m of it, 95th percentile", late(speeds, 95), "m/s"),
        group.row(f"force at touch, 95th percentile of {len(forces)} touches", late(forces, 95), "N", "<= 8"),
        group.row("force at touch, largest", highest, "N"),
    ]


def pull_rows(group: Group) -> list[dict]:
    """People who pull against the closing hand."""
    pulls = {name: [] for name in ("pull_back", "tug")}
    for job, each in zip(group.jobs, group.directions, strict=True):
        pulls[job.arguments["conditions"].behaviour].append(each.truth.get("pull"))
    every = [value for values in pulls.values() for value in values]
    what = f"force on a person who pulls against the closing hand, largest of {len(every)}"
    rows = [group.row(what, late(every, 100), "N", "<= 15")]
    for name, values in pulls.items():
        rows.append(
            group.row(f"force on a person with '{name}', 95th percentile of {len(values)}", late(values, 95), "N")
        )
    return rows
