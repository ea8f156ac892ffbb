"""Under which conditions a trial runs: whose hand, which tracker, which object; and hardships that can be added."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from coglab_sim.person.participant import HABITS, Participant
from coglab_sim.tracker.tracker import PerceptionSettings


@dataclass(frozen=True)
class Conditions:
    """Of one trial. By default a person is drawn, the tracker has the errors of trackers, and the object is as its file
    says. Example::

        tired = Conditions(person={"reaction_median": 0.6}, object_id="bottle", mass=1.3)
        sharp = Conditions(profile="accustomed", perception=PerceptionSettings(perfect=True))
        slow = replace(sharp, behaviour="slow")
    """

    behaviour: str = "normal"
    """what the person does: coglab_sim.person.participant.BEHAVIOURS, e.g. "slow" or "never_release"."""
    profile: str = "drawn"
    """who the person is: "drawn" by the seed, "patient" or "accustomed"."""
    person: Mapping[str, Any] = field(default_factory=dict)
    """fields of Participant that are set, whoever was drawn"""
    perception: PerceptionSettings = PerceptionSettings()
    object_id: str = "mug"
    mass: float = 1.0
    """of the true object, as share of what its file says"""
    friction: float = 1.0

    def participant(self, seed: int) -> Participant:
        """The person with this seed."""
        return replace(Participant.draw(seed, self.behaviour, self.profile), **self.person)


PATIENT = Conditions(profile="patient", perception=PerceptionSettings(perfect=True))
"""Where the physics are judged: a patient person, perfect perception."""
CONSIDERATE = Conditions(profile="accustomed", perception=PerceptionSettings(perfect=True))
"""For what is about machinery and not about people: an accustomed person, perfect perception."""
CAREFUL = Conditions(person=HABITS)
"""The world as it is, but for people with the habits of the accustomed: printed beside it."""

HARDSHIPS: dict[str, Callable[[Conditions, int], Conditions]] = {
    "trust 0.1 s": lambda c, seed: replace(c, person={**c.person, "trust": 0.1}),
    "tilt 20 deg": lambda c, seed: replace(c, person={**c.person, "tilt": 20.0}),
    "bias 10 mm": lambda c, seed: replace(c, perception=replace(c.perception, calibration_offset=0.010)),
    "mass +-30 %": lambda c, seed: replace(c, mass=c.mass * (1.3 if seed % 2 else 0.7)),
    "friction -30 %": lambda c, seed: replace(c, friction=0.7 * c.friction),
    "latency +100 ms": lambda c, seed: replace(c, perception=replace(c.perception, latency=c.perception.latency + 0.1)),
}
"""Each alone makes the world harder; the seed decides where there are two ways."""


def hardship(name: str, seed: int, conditions: Conditions = Conditions()) -> Conditions:
    """The conditions with one hardship; none for an empty name. ValueError for an unknown one."""
    if not name:
        return conditions
    if name not in HARDSHIPS:
        raise ValueError(f"hardship '{name}' is none of {', '.join(HARDSHIPS)}")
    return HARDSHIPS[name](conditions, seed)
