"""Figures of a world that nobody tuned: whether the physics are right, the default world, each hardship alone.

Definitions. A trial is a person who gives the object (receive) and asks for it again (give): every person is a trial of
both directions; each direction of each trial has succeeded or failed for exactly one reason, which may be that the
trial got stuck in it, or that it never began. Physics right: profile patient, perfect perception, every object grasped
with all fingers (power grasp); what an object's file asks for otherwise is printed beside. An object has fallen if it
lies, or lay, on the floor. A period is outside a limit as commanded if the answered positions or their speeds are; as
measured if a joint of the plant is beyond its range at the end of the period, or faster than its limit in any of its
steps of 1 ms, without tolerance. The default world is `Conditions()`; a hardship changes one thing of it. Palm to the
true goal pose: once the arm stands still and nobody has touched it; of reaches after which it never did, at their end,
with their number. Beside them, without a goal: people whose habits make a handover easier, in the default world
(`CAREFUL`) and in the one of the physics (`CONSIDERATE`).
No recogniser watches in them, unlike in what ships and in bench_partner: none did when their baseline was printed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from campaign import EXCHANGES, Campaign, Job, of_asked
from coglab_objects.database import objects_folder, read_object
from coglab_sim.conditions import CAREFUL, CONSIDERATE, HARDSHIPS, PATIENT, Conditions, hardship

PEOPLE_ASKED, DEFAULT_ASKED, HARDSHIP_ASKED, ACCUSTOMED_ASKED = 100, 200, 200, 20
LONG = os.environ.get("COGLAB_LONG") == "1"
PEOPLE = PEOPLE_ASKED if LONG else 2
DEFAULT_TRIALS = DEFAULT_ASKED if LONG else 8
HARDSHIP_TRIALS = HARDSHIP_ASKED if LONG else 2
ACCUSTOMED = ACCUSTOMED_ASKED if LONG else 1
NAMES = dict(zip(EXCHANGES, ("receive", "give"), strict=True))
OBJECTS = sorted(path.stem for path in objects_folder().glob("*.yaml"))
NEVER_STOOD = "never stood still, at the reach's end"
Row = Callable[..., dict]


@dataclass(frozen=True)
class Plan:
    """Trials of both directions under one name: seeds, conditions of each; ``power``: with all fingers in any case."""

    name: str
    seeds: range
    conditions: Callable[[int], Conditions]
    power: bool = False

    def jobs(self) -> list[Job]:
        """As they are run."""
        return [
            Job(self.name, EXCHANGES, seed, {"conditions": self.conditions(seed), "power": self.power})
            for seed in self.seeds
        ]

    def run(self) -> Campaign:
        """All of them."""
        return Campaign().run_under(EXCHANGES, self.seeds, self.name, self.conditions, power=self.power)


def physics_plan(object_id: str, power: bool = True) -> Plan:
    """Patient people, perfect perception."""
    conditions = replace(PATIENT, object_id=object_id)
    name = f"physics, {object_id}" + ("" if power else ", own grasp")
    return Plan(name, range(5000, 5000 + PEOPLE), lambda seed: conditions, power)


def accustomed_plan(object_id: str) -> Plan:
    """The same with people who have habits."""
    conditions = replace(CONSIDERATE, object_id=object_id)
    return Plan(f"accustomed, {object_id}", range(5000, 5000 + ACCUSTOMED), lambda seed: conditions, True)


def default_plan(n: int = DEFAULT_TRIALS) -> Plan:
    """The world as it is."""
    return Plan("default", range(6000, 6000 + n), lambda seed: Conditions())


def hardship_plans() -> list[Plan]:
    """Each hardship alone."""
    seeds = range(6000, 6000 + HARDSHIP_TRIALS)
    return [Plan(f"hardship '{name}'", seeds, lambda seed, name=name: hardship(name, seed)) for name in HARDSHIPS]


def careful_plan() -> Plan:
    """The default world, but for people with habits."""
    return Plan("careful people", range(6000, 6000 + HARDSHIP_TRIALS), lambda seed: CAREFUL)


def own_grasps() -> list[str]:
    """Objects whose file asks for something else than all fingers."""
    return [name for name in OBJECTS if not power_grasped(name)]


def plans() -> list[Plan]:
    """Everything whose figures the rows below are: first what is judged, then the default world and what makes it
    harder, then what stands beside."""
    own = [physics_plan(name, power=False) for name in own_grasps()]
    accustomed = [accustomed_plan(name) for name in OBJECTS]
    physics = [physics_plan(name) for name in OBJECTS]
    return [*physics, default_plan(), *hardship_plans(), careful_plan(), *own, *accustomed]


def power_grasped(object_id: str) -> bool:
    """Whether the object's own file asks for all fingers."""
    entry = read_object(objects_folder() / f"{object_id}.yaml")[0]
    return bool(entry["grasps"][entry["default_grasp"]]["hand"]["mode"] == "cylindrical")


def physics_rows(row: Row) -> list[dict]:
    """Patient people, perfect perception, control as it is."""
    rows, campaigns = [], []
    for object_id in OBJECTS:
        campaigns.append(physics_plan(object_id).run())
        rows += direction_rows(row, campaigns[-1], f"physics right, {object_id}, power grasp")
    rows += judged_rows(row, campaigns)
    rows = of_asked(rows, PEOPLE, PEOPLE_ASKED) + of_asked(accustomed_rows(row), ACCUSTOMED, ACCUSTOMED_ASKED)
    for object_id in own_grasps():
        campaign, what = physics_plan(object_id, power=False).run(), f"{object_id}, the grasp of its file"
        own = direction_rows(row, campaign, f"physics right, {what}")
        own.append(campaign.marked(row)(f"physics right, {what}: object fell", campaign.fell, "trials"))
        rows += of_asked(own, PEOPLE, PEOPLE_ASKED)
    return rows


def judged_rows(row: Row, campaigns: list[Campaign]) -> list[dict]:
    """The goals of power grasps, over all objects."""
    everything, share = together(campaigns)
    fallen = everything.fell / max(1, everything.trials)
    what = f"physics right, {PEOPLE} patient people x {len(OBJECTS)} objects x 2 directions, power grasps"
    row, stuck = everything.marked(row), everything.stuck
    return [
        row(f"{what}: succeeded", share, "share", ">= 0.97", share >= 0.97),
        row(f"{what}: object fell", fallen, "share of trials", "<= 0.01", fallen <= 0.01),
        row(f"{what}: stuck", stuck, "trials", "<= 0", stuck == 0),
        *everything.limit_rows(row, what, "<= 0"),
    ]


def together(campaigns: list[Campaign]) -> tuple[Campaign, float]:
    """Their counts added up, and the share of all directions that succeeded."""
    everything, good = Campaign(), 0
    for campaign in campaigns:
        good += sum(campaign.outcomes[(action, "succeeded")] for action in EXCHANGES)
        for count in ("trials", "asked", "fell", "stuck", "outside_commanded", "outside_measured", "over_command"):
            setattr(everything, count, getattr(everything, count) + getattr(campaign, count))
        everything.fastest = max(everything.fastest, campaign.fastest)
    return everything, good / max(1, 2 * everything.trials)


def accustomed_rows(row: Row) -> list[dict]:
    """Beside what is judged: the same trials with people who have habits; no goal."""
    everything, share = together([accustomed_plan(name).run() for name in OBJECTS])
    what = f"{ACCUSTOMED} accustomed people (patient, with habits) x {len(OBJECTS)} objects x 2 directions"
    row = everything.marked(row)
    return [
        row(f"{what}: succeeded", share, "share"),
        row(f"{what}: object fell", everything.fell, "trials"),
        row(f"{what}: stuck", everything.stuck, "trials"),
    ]


def direction_rows(row: Row, campaign: Campaign, what: str) -> list[dict]:
    """Success and failures by reason, per direction; no goal."""
    return [
        campaign.marked(row)(
            f"{what}, {NAMES[action]}: succeeded of {campaign.trials} (failures: {campaign.failures(action)})",
            campaign.share(action),
            "share",
        )
        for action in EXCHANGES
    ]


def world_rows(row: Row, default: Campaign) -> list[dict]:
    """The default world and what stands beside it, printed with control as it is."""
    rows = of_asked(whole_rows(row, default, "default world"), default.asked, DEFAULT_ASKED)
    for plan in (*hardship_plans(), careful_plan()):
        rows += of_asked(whole_rows(row, plan.run(), plan.name), HARDSHIP_TRIALS, HARDSHIP_ASKED)
    return rows


def whole_rows(row: Row, campaign: Campaign, what: str) -> list[dict]:
    """Of one campaign: success by direction, falls, stuck, limits, palm against the true grasp pose."""
    rows = direction_rows(row, campaign, what)
    row, give = campaign.marked(row), EXCHANGES[1]
    rows += [
        row(f"{what}, give: succeeded of {campaign.begun(give)} begun", campaign.share_of_begun(give), "share"),
        row(f"{what}: object fell", campaign.fell, "trials"),
        row(f"{what}: stuck", campaign.stuck, "trials"),
        *campaign.limit_rows(row, what),
    ]
    for action in EXCHANGES:
        rows += palm_rows(row, campaign.reaches[action], f"{what}, {NAMES[action]}")
    return rows


def palm_rows(row: Row, reaches: list[dict[str, float]], what: str) -> list[dict]:
    """Palm to the true goal pose of every reach: where the arm stood, and of those that never stood, at their end."""
    stood, never = ([each for each in reaches if bool(each["stood"]) == whether] for whether in (True, False))
    rows = off_rows(row, stood, len(reaches), what, "arm standing")
    return rows + off_rows(row, never, len(reaches), what, NEVER_STOOD)


def off_rows(row: Row, found: list[dict[str, float]], every: int, what: str, where: str) -> list[dict]:
    """How many of every reach these are, and how far off their palms were."""
    rows = [row(f"{what}: reaches, {where}", len(found), f"of {every}")]
    if not found:
        return rows
    for key, unit in (("truth_mm", "mm"), ("truth_deg", "deg")):
        values, name = [each[key] for each in found], f"{what}: palm to the true goal pose, {where}"
        rows.append(row(f"{name}, median", np.median(values), unit))
        rows.append(row(f"{name}, p95", np.percentile(values, 95), unit))
    return rows


def run_default(n: int = DEFAULT_TRIALS) -> Campaign:
    """Trials in the world as it is."""
    return default_plan(n).run()


def contact_rows(row: Row, campaign: Campaign) -> list[dict]:
    """Contact and palm over drawn people who place while the arm stands, and while it moves; nothing is left out."""
    rows, waits = [], len(campaign.touches)
    row = campaign.marked(row)
    for moving, what in ((False, "arm still"), (True, "arm moving")):
        touched = [each for each in campaign.touches if each["touched"] is not None and each["moving"] == moving]
        real = [each for each in touched if each["found"] is not None and not each["false_alarm"]]
        found = [each["found"] - each["touched"] for each in real]
        name = f"drawn people, {what} at first touch"
        rows.append(row(f"{name}: touches", len(touched), f"of {waits} waits"))
        rows.append(row(f"{name}: found, of {len(touched)} touches", len(found) / max(1, len(touched)), "share"))
        if found:
            rows.append(row(f"{name}: delay from 0.3 N to contact, median", 1000 * np.median(found), "ms"))
            rows.append(row(f"{name}: delay from 0.3 N to contact, p95", 1000 * np.percentile(found, 95), "ms"))
        then = [palm for palm, each in campaign.palms if each["touched"] is not None and each["moving"] == moving]
        rows += palm_rows(row, then, name)
        false = sum(each["false_alarm"] and each["moving_when_found"] == moving for each in campaign.touches)
        rows.append(row(f"drawn people, {what}: contact found before anything touched", false, f"of {waits} waits"))
    untouched = [palm for palm, each in campaign.palms if each["touched"] is None]
    rows.append(row("drawn people: nothing touched the hand", len(untouched), f"of {waits} waits"))
    return rows + palm_rows(row, untouched, "drawn people, nothing touched the hand")
