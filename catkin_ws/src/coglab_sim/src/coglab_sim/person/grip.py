"""How hard a person grips: as mass and friction ask, with a margin, and more where the load is felt to grow.

Grip force follows load force and the load's turning moment with a safety margin that each person keeps (Westling and
Johansson 1984; Kinoshita, Bäckström, Flanagan and Johansson 1997); friction is known after a moment of touch. The
margin is drawn, see docs/people.md.
"""

from __future__ import annotations

import numpy as np

from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene

GRAVITY = 9.81
LOWEST = 1.0
"""N, of a hand that holds anything at all"""
LEVER = 0.04
"""m over which the fingers resist turning: a moment asks for as much grip as a force of moment / LEVER; ours"""
RATE = 60.0
"""N/s at which the grip force changes"""


class GripForce:
    """Normal force of the closed fingers, N."""

    def __init__(self, person: Participant, scene: Scene, knows_weight: bool) -> None:
        self.person, self.scene = person, scene
        aside = scene.object_in_hand + scene.object_middle
        self._turning = 1.0 + float(np.linalg.norm(aside[:2])) / LEVER
        self.expected = scene.object_mass * GRAVITY * (1.0 if knows_weight else float(np.exp(person.weight_error)))
        """N, weight that the person counts on"""
        self.force = self._wanted(self.expected)

    def _wanted(self, load: float) -> float:
        """Two sides press, so the object slips below load / (2 mu)."""
        slips = self._turning * load / (2.0 * self.scene.object_friction)
        return min(self.person.grip_limit, max(LOWEST, self.person.grip_safety * slips))

    def step(self, dt: float, felt: float, more: float = 0.0) -> float:
        """The force ``dt`` s later, with a load of ``felt`` N and ``more`` N expected soon."""
        change = self._wanted(max(self.expected, felt) + more) - self.force
        self.force += min(max(change, -RATE * dt), RATE * dt)
        return self.force

    def has_felt(self, weight: float) -> None:
        """The person carries the whole object and knows now what it weighs, N."""
        self.expected = weight
