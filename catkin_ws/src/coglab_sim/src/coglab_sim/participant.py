"""Seeded virtual participants: everything that differs between people, drawn once per person.

The figures are plausible defaults from the handover literature, not validated against a population.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
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
)


@dataclass(frozen=True)
class Participant:
    """One person. Times in s, lengths in m, forces in N."""

    seed: int = 0
    behaviour: str = "normal"
    reaction_median: float = 0.35
    reaction_sigma: float = 0.30
    """of the logarithm"""
    learning: float = 0.08
    """share by which the reaction gets shorter per trial, for the first three"""
    reach_time: float = 1.1
    """of a reach of 0.45 m"""
    reach_sigma: float = 0.12
    """of the logarithm, from trial to trial"""
    point_sigma: tuple[float, float, float] = (0.02, 0.04, 0.03)
    """scatter of the handover point, world axes"""
    point_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """of this person's handover point: height, handedness"""
    bow: float = 0.0
    """height of a conic reach's arc; 0: straight"""
    place_speed: float = 0.10
    """m/s at which the object is brought into the robot's palm"""
    look_time: float = 1.0
    """for which the robot's hand must have stood still before the person trusts that it waits"""
    press: float = 0.006
    """how far past first touch the hand goes on: with the grip's stiffness this makes the press force"""
    release_share: float = 0.3
    """load share of the robot at which the person lets go"""
    release_delay: float = 0.12
    release_time: float = 0.25
    grip_force: float = 12.0
    patience: float = 12.0
    """how long the person waits for the robot before giving up"""
    sway: float = 0.002
    tremor: float = 0.0003

    def __post_init__(self) -> None:
        if self.behaviour not in BEHAVIOURS:
            raise ValueError(f"behaviour '{self.behaviour}' is none of {', '.join(BEHAVIOURS)}")

    @staticmethod
    def draw(seed: int, behaviour: str = "normal") -> Participant:
        """The person with this seed."""
        rng = np.random.default_rng([seed, 17])
        return Participant(
            seed=seed,
            behaviour=behaviour,
            reaction_median=float(np.clip(0.35 * np.exp(rng.normal(0, 0.15)), 0.2, 0.7)),
            reach_time=float(np.clip(1.1 * np.exp(rng.normal(0, 0.10)), 0.8, 1.5)),
            point_offset=(float(rng.normal(0, 0.008)), float(rng.normal(0, 0.02)), float(rng.normal(0, 0.02))),
            bow=float(abs(rng.normal(0.0, 0.02))) if rng.random() < 0.5 else 0.0,
            place_speed=float(rng.uniform(0.06, 0.18)),
            press=float(rng.uniform(0.005, 0.008)),
            release_share=float(np.clip(rng.normal(0.3, 0.1), 0.1, 0.6)),
            release_delay=float(rng.uniform(0.05, 0.2)),
            grip_force=float(rng.uniform(9, 16)),
        )

    @staticmethod
    def from_mapping(data: Mapping[str, Any]) -> Participant:
        """A participant file: ``seed`` draws the person, every other field overrides what was drawn."""
        known = {f.name for f in fields(Participant)}
        unknown = sorted(set(data) - known)
        if unknown:
            raise ValueError(
                f"participant file: unknown fields {', '.join(unknown)}; known: {', '.join(sorted(known))}"
            )
        drawn = asdict(Participant.draw(int(data.get("seed", 0)), str(data.get("behaviour", "normal"))))
        drawn.update({k: tuple(v) if isinstance(v, list) else v for k, v in data.items()})
        return Participant(**drawn)


def population(n: int, seed: int, behaviour: str = "normal") -> list[Participant]:
    """n different people, the same ones for the same seed."""
    seeds = np.random.default_rng(seed).integers(0, 2**31, size=n)
    return [Participant.draw(int(s), behaviour) for s in seeds]
