"""Conditions of a trial: person, tracker and object, and hardships that can be added."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from coglab_sim.person.participant import Participant
from coglab_sim.tracker.tracker import PerceptionSettings


@dataclass(frozen=True)
class Conditions:
    """Conditions of one trial. By default, the seed draws the person, the tracker has realistic errors, and the object
    has the mass and friction of its file. Example::

        tired = Conditions(person={"reaction_median": 0.6}, object_id="bottle", mass=1.3)
        sharp = Conditions(profile="accustomed", perception=PerceptionSettings(perfect=True))
        slow = replace(sharp, behaviour="slow")
    """

    behaviour: str = "normal"
    """behaviour of the person: one of coglab_sim.person.participant.BEHAVIOURS, e.g. "slow" or "never_release" """
    profile: str = "drawn"
    """type of person: "drawn" (by the seed), "patient" or "accustomed" """
    person: Mapping[str, Any] = field(default_factory=dict)
    """fields of Participant that override the profile"""
    perception: PerceptionSettings = PerceptionSettings()
    object_id: str = "mug"
    mass: float = 1.0
    """mass of the simulated object, relative to its file"""
    friction: float = 1.0

    def participant(self, seed: int) -> Participant:
        """Returns the person for this seed."""
        return replace(Participant.draw(seed, self.behaviour, self.profile), **self.person)


PATIENT = Conditions(profile="patient", perception=PerceptionSettings(perfect=True))
"""For tests of the physics: a patient person, perfect perception."""
CONSIDERATE = Conditions(profile="accustomed", perception=PerceptionSettings(perfect=True))
"""For tests of the machines, not of people: an accustomed person, perfect perception."""

HARDSHIPS: dict[str, Callable[[Conditions, int], Conditions]] = {
    "trust 0.1 s": lambda c, seed: replace(c, person={**c.person, "trust": 0.1}),
    "tilt 20 deg": lambda c, seed: replace(c, person={**c.person, "tilt": 20.0}),
    "bias 10 mm": lambda c, seed: replace(c, perception=replace(c.perception, calibration_offset=0.010)),
    "mass +-30 %": lambda c, seed: replace(c, mass=c.mass * (1.3 if seed % 2 else 0.7)),
    "friction -30 %": lambda c, seed: replace(c, friction=0.7 * c.friction),
    "latency +100 ms": lambda c, seed: replace(c, perception=replace(c.perception, latency=c.perception.latency + 0.1)),
}
"""Each hardship alone makes the trial harder. The seed chooses the sign where two are possible."""


def hardship(name: str, seed: int, conditions: Conditions = Conditions()) -> Conditions:
    """Returns the conditions with one hardship added; unchanged for an empty name. ValueError: unknown name."""
    if not name:
        return conditions
    if name not in HARDSHIPS:
        raise ValueError(f"hardship '{name}' is none of {', '.join(HARDSHIPS)}")
    return HARDSHIPS[name](conditions, seed)
