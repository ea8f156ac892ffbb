"""Seeded virtual participants. Everything that differs between people is drawn once per person.

docs/people.md has the sources. A draw outside its range is repeated, not clipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

BEHAVIOURS = (
    "normal",
    "slow",
    "hesitant",
    "early_release",
    "never_release",
    "pull_back",
    "change_side",
    "absent",
    "tug",
    "early_contact",
    "withdraws",
)

PROFILES = ("drawn", "patient", "accustomed")
"""drawn: a person with drawn parameters. patient: the same person, but trusts the robot's hand after 1.0 s of rest,
holds the object upright and stays inside the box. accustomed: a patient person with HABITS, right-handed and with less
scatter, as in the first versions of this cell."""

HABITS: Mapping[str, Any] = {
    "presses_again": 4,
    "used_to_touch": True,
    "believes_closed": 3.0,
    "aligns_within": 0.010,
    "relaxes": True,
}
"""Habits of a giver that make a handover easier for the robot. Only `accustomed` people have them."""


def _is_number(value: Any) -> bool:
    return isinstance(value, bool | int | float | np.number)


@dataclass(frozen=True)
class Participant:
    """Parameters of one person. Times in s, lengths in m, forces in N, angles in deg."""

    seed: int = 0
    behaviour: str = "normal"
    left_handed: bool = False
    """rest and handover are mirrored to the other side"""
    reaction_median: float = 0.35
    reaction_sigma: float = 0.30
    """standard deviation of the logarithm"""
    learning: float = 0.08
    """share by which the reaction time falls per trial, in the first three trials"""
    reach_time: float = 1.1
    """duration of a reach over 0.45 m"""
    reach_sigma: float = 0.12
    """standard deviation of the logarithm, from trial to trial"""
    bow: float = 0.0
    """height of the arc of a conic reach; 0: straight"""
    point_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """offset of this person's handover point: distance, side, height"""
    point_sigma: tuple[float, float, float] = (0.02, 0.04, 0.03)
    """scatter of the handover point from trial to trial, world axes"""
    inside_box: bool = False
    """True: the handover point is brought into the scene's box"""
    tilt: float = 12.0
    """standard deviation of the orientation of hand and object about each world axis, from trial to trial"""
    seeing_delay: float = 0.20
    """from an event to the reaction to its sight"""
    seen_noise: float = 0.003
    """standard deviation per axis of a seen position"""
    seen_turn: float = 2.0
    """standard deviation per axis of a seen orientation"""
    seen_speed: float = 0.10
    """standard deviation of a seen speed as share of it; 0.005 m/s of noise is added"""
    feeling_delay: float = 0.125
    """from a force at the hand to the reaction of the hand"""
    felt_threshold: float = 0.4
    """smallest change of force that is felt"""
    felt_share: float = 0.08
    """smallest change that is felt, as share of the present force"""
    hearing_delay: float = 0.5
    """from the beginning of a spoken sentence until the person understands it"""
    trust: float = 0.5
    """time that the robot's hand must be seen at rest before the person places or takes"""
    places_while_moving: bool = False
    """True: places as soon as the robot's hand is seen near, even while it moves"""
    place_speed: float = 0.10
    """m/s, speed of the object toward the robot's palm"""
    press: float = 1.5
    """felt force, beyond first contact, that presses the object into the palm"""
    release_share: float = 0.3
    """the person lets go when this share of the weight is gone, without other signs"""
    assurance: float = 0.2
    """time that the signs of a firm hold must last before the person lets go"""
    release_time: float = 0.35
    """time in which the fingers open, without the pause that checks whether the robot holds"""
    grip_safety: float = 2.0
    """grip force as multiple of the force at which the object slips"""
    grip_limit: float = 40.0
    """largest grip force"""
    weight_error: float = 0.0
    """error of the logarithm of the expected weight, before the person has held the object"""
    grip_time: float = 0.25
    """time in which the fingers close"""
    patience: float = 12.0
    """time that the person waits for the robot before giving up"""
    presses_again: int = 0
    """number of times that the person presses again after the open hand backed away"""
    used_to_touch: bool = False
    """True: a touch by the open hand while the person waits does not count as placing the object"""
    believes_closed: float = math.inf
    """s after which the person believes that a closed hand holds, even without feeling it"""
    aligns_within: float = math.inf
    """m, distance from the palm's middle along the fingers above which the person corrects while placing"""
    relaxes: bool = False
    """True: at half grip the arm sinks, so that a robot that holds gets the weight"""
    sway: float = 0.002
    tremor: float = 0.0003

    def __post_init__(self) -> None:
        if self.behaviour not in BEHAVIOURS:
            raise ValueError(f"behaviour '{self.behaviour}' is none of {', '.join(BEHAVIOURS)}")
        for name, value in vars(self).items():
            if name == "behaviour":
                continue
            if name in ("point_offset", "point_sigma"):
                if np.shape(value) != (3,) or not all(_is_number(each) and math.isfinite(each) for each in value):
                    raise ValueError(f"person: {name}: three finite numbers (m) are expected, got {value!r}")
            elif not _is_number(value) or math.isnan(value) or (value < 0 and name != "weight_error"):
                raise ValueError(f"person: {name}: a number 0 or more is expected, got {value!r}")

    @staticmethod
    def draw(seed: int, behaviour: str = "normal", profile: str = "drawn") -> Participant:
        """The person with this seed. ValueError for an unknown profile."""
        if profile not in PROFILES:
            raise ValueError(f"profile '{profile}' is none of {', '.join(PROFILES)}")
        person = _drawn(seed, behaviour)
        return person if profile == "drawn" else _patient(person) if profile == "patient" else _accustomed(person)

    @staticmethod
    def from_mapping(data: Mapping[str, Any]) -> Participant:
        """Reads a participant file. ``seed`` and ``profile`` draw the person, other fields override drawn values."""
        known = {f.name for f in fields(Participant)} | {"profile"}
        unknown = sorted(set(data) - known)
        if unknown:
            raise ValueError(
                f"participant file: unknown fields {', '.join(unknown)}; known: {', '.join(sorted(known))}"
            )
        profile = str(data.get("profile", "drawn"))
        drawn = asdict(Participant.draw(int(data.get("seed", 0)), str(data.get("behaviour", "normal")), profile))
        drawn.update({k: tuple(v) if isinstance(v, list) else v for k, v in data.items() if k != "profile"})
        return Participant(**drawn)


def within(low: float, high: float, draw: Callable[[], float]) -> float:
    """Returns the first of up to 100 draws inside the range, else the middle of the range."""
    for _ in range(100):
        value = float(draw())
        if low <= value <= high:
            return value
    return (low + high) / 2


def _drawn(seed: int, behaviour: str) -> Participant:
    rng = np.random.default_rng([seed, 17])

    def normal(mean: float, sigma: float, low: float, high: float) -> float:
        return within(low, high, lambda: rng.normal(mean, sigma))

    def lognormal(median: float, sigma: float, low: float, high: float) -> float:
        return within(low, high, lambda: median * np.exp(rng.normal(0, sigma)))

    return Participant(
        seed=seed,
        behaviour=behaviour,
        left_handed=bool(rng.random() < 0.1),
        reaction_median=lognormal(0.35, 0.15, 0.2, 0.7),
        reach_time=lognormal(1.1, 0.10, 0.8, 1.5),
        bow=float(abs(rng.normal(0.0, 0.02))) if rng.random() < 0.5 else 0.0,
        point_offset=(float(rng.normal(0, 0.02)), float(rng.normal(0, 0.04)), float(rng.normal(0, 0.045))),
        seeing_delay=float(rng.uniform(0.15, 0.25)),
        seen_noise=float(rng.uniform(0.002, 0.005)),
        feeling_delay=float(rng.uniform(0.10, 0.15)),
        felt_threshold=float(rng.uniform(0.2, 0.6)),
        felt_share=float(rng.uniform(0.05, 0.10)),
        hearing_delay=float(rng.uniform(0.4, 0.8)),
        trust=lognormal(0.45, 0.7, 0.1, 1.5),
        places_while_moving=bool(rng.random() < 0.2),
        place_speed=float(rng.uniform(0.06, 0.18)),
        press=float(rng.uniform(1.0, 3.0)),
        release_share=normal(0.3, 0.1, 0.1, 0.6),
        assurance=float(rng.uniform(0.1, 0.4)),
        release_time=float(rng.uniform(0.25, 0.5)),
        grip_safety=lognormal(2.0, 0.15, 1.6, 3.0),
        weight_error=float(rng.normal(0, 0.15)),
        grip_time=float(rng.uniform(0.2, 0.35)),
        patience=float(rng.uniform(8, 16)),
    )


def _patient(person: Participant) -> Participant:
    """The same person, who trusts after 1.0 s, holds upright and stays inside the box."""
    return replace(person, trust=1.0, places_while_moving=False, tilt=0.0, inside_box=True)


def _accustomed(person: Participant) -> Participant:
    """The same person as in the first versions of this cell: patient, with HABITS, right-handed, and with less scatter
    of the handover point."""
    x, y, z = person.point_offset
    return replace(
        _patient(person),
        left_handed=False,
        point_offset=(0.4 * x, 0.5 * y, 0.45 * z),
        patience=12.0,
        **HABITS,
    )
