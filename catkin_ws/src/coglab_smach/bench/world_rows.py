"""Figures of a world that nobody tuned: whether the physics are right, the default world, each hardship alone.

Definitions. A trial is a person who gives the object (receive) and asks for it again (give): every person is a trial of
both directions, a second direction that never began counts as failed. Physics right: profile patient, perfect
perception, every object grasped with all fingers (power grasp); what an object's file asks for otherwise is printed
beside. An object has fallen if it lies, or lay, on the floor. The default world is `Conditions()`; a hardship changes
one thing of it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from campaign import EXCHANGES, Campaign
from coglab_objects.database import objects_folder, read_object
from coglab_sim.conditions import CONSIDERATE, HARDSHIPS, Conditions, hardship

LONG = os.environ.get("COGLAB_LONG") == "1"
PEOPLE = 100 if LONG else 2
DEFAULT_TRIALS = 200 if LONG else 8
HARDSHIP_TRIALS = 200 if LONG else 2
NAMES = dict(zip(EXCHANGES, ("receive", "give"), strict=True))
OBJECTS = sorted(path.stem for path in objects_folder().glob("*.yaml"))
Row = Callable[..., dict]


def power_grasped(object_id: str) -> bool:
    """Whether the object's own file asks for all fingers."""
    entry = read_object(objects_folder() / f"{object_id}.yaml")[0]
    return bool(entry["grasps"][entry["default_grasp"]]["hand"]["mode"] == "cylindrical")


def physics_rows(row: Row) -> list[dict]:
    """Patient people, perfect perception, control as it is."""
    rows, good, fell, stuck, outside, trials = [], 0.0, 0, 0, 0, 0
    for object_id in OBJECTS:
        conditions = replace(CONSIDERATE, object_id=object_id)
        campaign = Campaign().run_under(
            EXCHANGES, range(5000, 5000 + PEOPLE), f"physics, {object_id}", lambda seed, c=conditions: c, power=True
        )
        trials += campaign.trials
        good += sum(campaign.share(action) for action in EXCHANGES) * campaign.trials
        fell, stuck, outside = fell + campaign.fell, stuck + campaign.stuck, outside + campaign.outside
        rows += direction_rows(row, campaign, f"physics right, {object_id}, power grasp")
    share, fallen = good / (2 * trials), fell / trials
    what = f"physics right, {PEOPLE} patient people x {len(OBJECTS)} objects x 2 directions, power grasps"
    rows += [
        row(f"{what}: succeeded", share, "share", ">= 0.97", share >= 0.97),
        row(f"{what}: object fell", fallen, "share of trials", "<= 0.01", fallen <= 0.01),
        row(f"{what}: stuck", stuck, "trials", "<= 0", stuck == 0),
        row(f"{what}: measured periods outside a joint limit", outside, "periods", "<= 0", outside == 0),
    ]
    for object_id in [name for name in OBJECTS if not power_grasped(name)]:
        conditions = replace(CONSIDERATE, object_id=object_id)
        campaign = Campaign().run_under(
            EXCHANGES, range(5000, 5000 + PEOPLE), f"physics, {object_id}, own grasp", lambda seed, c=conditions: c
        )
        rows += direction_rows(row, campaign, f"physics right, {object_id}, the grasp of its file")
        rows.append(row(f"physics right, {object_id}, the grasp of its file: object fell", campaign.fell, "trials"))
    return rows


def direction_rows(row: Row, campaign: Campaign, what: str) -> list[dict]:
    """Success and failures by reason, per direction; no goal."""
    return [
        row(
            f"{what}, {NAMES[action]}: succeeded of {campaign.trials} (failures: {campaign.failures(action)}; "
            f"not begun: {campaign.trials - campaign.begun(action)})",
            campaign.share(action),
            "share",
        )
        for action in EXCHANGES
    ]


def world_rows(row: Row, default: Campaign) -> list[dict]:
    """The default world and each hardship alone, printed with control as it is."""
    rows = whole_rows(row, default, "default world")
    for name in HARDSHIPS:
        campaign = Campaign().run_under(
            EXCHANGES, range(6000, 6000 + HARDSHIP_TRIALS), name, lambda seed, name=name: hardship(name, seed)
        )
        rows += whole_rows(row, campaign, f"hardship '{name}'")
    return rows


def whole_rows(row: Row, campaign: Campaign, what: str) -> list[dict]:
    """Of one campaign: success by direction, falls, stuck, limits, palm against the true grasp pose."""
    rows = direction_rows(row, campaign, what)
    give = EXCHANGES[1]
    rows += [
        row(f"{what}, give: succeeded of {campaign.begun(give)} begun", campaign.share_of_begun(give), "share"),
        row(f"{what}: object fell", campaign.fell, "trials"),
        row(f"{what}: stuck", campaign.stuck, "trials"),
        row(f"{what}: measured periods outside a joint limit", campaign.outside, "periods"),
    ]
    for action in EXCHANGES:
        found = campaign.reaches[action]
        for key, unit in (("truth_mm", "mm"), ("truth_deg", "deg")):
            if not found:
                rows.append(row(f"{what}, {NAMES[action]}: palm to the true goal, no reach ended", 0, "reaches"))
                break
            values = np.array([each[key] for each in found])
            for label, value in (("median", np.median(values)), ("p95", np.percentile(values, 95))):
                rows.append(row(f"{what}, {NAMES[action]}: palm to the true goal pose, {label}", value, unit))
    return rows


def run_default(n: int = DEFAULT_TRIALS) -> Campaign:
    """Trials in the world as it is."""
    return Campaign().run_under(EXCHANGES, range(6000, 6000 + n), "default", lambda seed: Conditions())


def contact_rows(row: Row, people: int) -> list[dict]:
    """Contact over drawn people who place while the arm stands, and while it moves; nothing is left out."""
    campaign = Campaign().run_under(EXCHANGES[:1], range(6000, 6000 + people), "contact", lambda seed: Conditions())
    rows = []
    for moving, what in ((False, "arm still"), (True, "arm moving")):
        touched = [each for each in campaign.touches if each[0] is not None and each[2] == moving]
        found = [each[1] - each[0] for each in touched if each[1] is not None and not each[3]]
        name = f"drawn people, {what} at first touch"
        rows.append(row(f"{name}: touches", len(touched), "of " + str(people)))
        rows.append(row(f"{name}: found", len(found) / max(1, len(touched)), "share"))
        if found:
            rows.append(row(f"{name}: delay from 0.3 N to contact, median", 1000 * np.median(found), "ms"))
            rows.append(row(f"{name}: delay from 0.3 N to contact, p95", 1000 * np.percentile(found, 95), "ms"))
    false = sum(each[3] for each in campaign.touches)
    rows.append(row("drawn people: contact found before anything touched", false, f"of {len(campaign.touches)} waits"))
    untouched = sum(each[0] is None for each in campaign.touches)
    rows.append(row("drawn people: nothing touched the hand", untouched, f"of {len(campaign.touches)} waits"))
    return rows
