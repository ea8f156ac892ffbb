"""How the virtual human takes an object: close the last way, grip, lift until the robot lets go."""

from __future__ import annotations

import numpy as np

from .phases import Phases
from .scene import WorldView


class Receiving(Phases):
    """Phases of VirtualHuman."""

    def _grasping(self, t: float, dt: float, view: WorldView) -> None:
        """Receiving: close the last way to the object, grip it, then lift until the robot lets go."""
        wanted = view.object.position - self.scene.object_in_hand
        error = wanted - self._hand
        distance = float(np.linalg.norm(error))
        if self._grip == 0.0 and distance > 0.004:
            speed = min(self.participant.place_speed, 4.0 * distance + 0.01)
            self._velocity = error / distance * speed
            self._hand = self._hand + self._velocity * min(dt, distance / speed)
            if t - self._since > 4.0:
                self._retreat(t)
            return
        self._velocity = np.zeros(3)
        self._grip = min(1.0, self._grip + dt / 0.25)
        if self._grip == 1.0:
            if self.participant.behaviour == "early_release":
                self._go("releasing", t)
            elif self.participant.behaviour == "pull_back":
                self._go("releasing", t)
            else:
                self._go("lifting", t)

    def _lifting(self, t: float, dt: float, view: WorldView) -> None:
        """Take the weight: the hand rises slowly until the robot's hand carries nothing any more."""
        if view.held_by == "human":
            if self._load_since is None:
                self._load_since = t
            if t - self._load_since > 0.2:
                self._retreat(t)
            return
        self._load_since = None
        p = self.participant
        limit = 0.0 if p.behaviour == "never_release" else 0.03
        if self._travelled < limit and view.human_load_share < 1.2:
            self._velocity = np.array([0.0, 0.0, 0.03])
            self._hand = self._hand + self._velocity * dt
            self._travelled += 0.03 * dt
        else:
            self._velocity = np.zeros(3)
        if t - self._since > p.patience:
            self._go("releasing", t)
