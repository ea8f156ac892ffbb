"""Grip force of a person. It depends on mass and friction, and rises with the felt load.

Grip force follows the load force and the load's turning moment, with a safety margin (Westling and Johansson 1984;
Kinoshita, Bäckström, Flanagan and Johansson 1997). The person knows the friction after a short touch. Each person's
margin is drawn, see docs/people.md.
"""

from __future__ import annotations

import numpy as np

from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene

GRAVITY = 9.81  # m/s^2
LOWEST = 1.0  # N, smallest grip force of a hand that holds something
LEVER = 0.04  # m; a turning moment needs as much grip as a force of moment / LEVER; our choice
RATE = 60.0  # N/s, largest change of the grip force


class GripForce:
    """Normal force of the closed fingers, N."""

    def __init__(self, person: Participant, scene: Scene, knows_weight: bool) -> None:
        self.person, self.scene = person, scene
        aside = scene.object_in_hand + scene.object_middle
        self._turning = 1.0 + float(np.linalg.norm(aside[:2])) / LEVER
        self.expected = scene.object_mass * GRAVITY * (1.0 if knows_weight else float(np.exp(person.weight_error)))
        """N, weight that the person expects"""
        self.force = self._wanted(self.expected)

    def _wanted(self, load: float) -> float:
        """Wanted grip force (N) for a load (N). Two sides press, so the object slips below load / (2 mu)."""
        slips = self._turning * load / (2.0 * self.scene.object_friction)
        return min(self.person.grip_limit, max(LOWEST, self.person.grip_safety * slips))

    def step(self, dt: float, felt: float, more: float = 0.0) -> float:
        """Returns the force (N) ``dt`` s later, for a felt load of ``felt`` N and ``more`` N that will follow."""
        change = self._wanted(max(self.expected, felt) + more) - self.force
        self.force += min(max(change, -RATE * dt), RATE * dt)
        return self.force

    def has_felt(self, weight: float) -> None:
        """The person carries the whole object and learns its weight (N)."""
        self.expected = weight
