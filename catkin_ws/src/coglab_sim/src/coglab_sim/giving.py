"""How the virtual human gives: place the object into the robot's palm, hold on, let go."""

from __future__ import annotations

import numpy as np

from .phases import Phases
from .scene import WorldView

SLIP = 0.010
"""m: an object that has sunk this much in the robot's hand while the grip opens is slipping."""


class Giving(Phases):
    """Phases of VirtualHuman."""

    def _placing(self, t: float, dt: float, view: WorldView) -> None:
        """Bring the object into the palm, against the palm's outward axis, until it is felt; then press a little."""
        p = self.participant
        toward_palm = -view.robot_hand.axis(0)
        speed = p.place_speed * min(1.0, (t - self._since) / 0.15)
        if self._felt_since is None and view.palm_force > 0.3:
            self._felt_since = t
            self._travelled = 0.0
        if self._felt_since is not None and p.behaviour == "early_release":
            self._go("releasing", t)
            return
        if self._felt_since is not None and self._travelled >= p.press:
            if p.behaviour == "pull_back":
                self._retreat(t)
                return
            self._go("holding", t)
            return
        if self._felt_since is None and self._travelled > (0.2 if p.behaviour == "early_contact" else 0.09):
            # Nothing was met where the palm should be: stop and wait for the robot.
            self._go("holding", t)
            return
        self._velocity = toward_palm * speed
        self._hand = self._hand + self._velocity * dt
        self._travelled += speed * dt

    def _holding(self, t: float, dt: float, view: WorldView) -> None:
        """Hold on until the robot carries enough."""
        self._velocity = np.zeros(3)
        p = self.participant
        self._grip = min(1.0, self._grip + dt / 0.10)
        if p.behaviour == "tug" and view.held_by == "both":
            pull = 0.012 * np.sin(2 * np.pi * 1.5 * (t - self._since))
            self._velocity = np.array([0.012 * 2 * np.pi * 1.5 * np.cos(2 * np.pi * 1.5 * (t - self._since)), 0, 0])
            self._hand = self._hand + self._velocity * dt
            if t - self._since > 3.0 and abs(pull) < 0.002:
                self._go("releasing", t)
            return
        if p.behaviour == "never_release":
            if t - self._since > p.patience:
                self._retreat(t)
            return
        carried = view.robot_load_share >= p.release_share or view.held_by in ("both", "robot")
        if not carried:
            self._load_since = None
        elif self._load_since is None:
            self._load_since = t
        if self._load_since is not None:
            needed = p.release_delay + (0.0 if view.robot_load_share >= p.release_share else 0.35)
            if t - self._load_since > needed:
                self._go("releasing", t)
                return
        if t - self._since > p.patience:
            self._retreat(t)

    def _releasing(self, t: float, dt: float, view: WorldView) -> None:
        """Open the grip; whoever gives feels it if the object slips in the robot's hand, and holds on again."""
        self._velocity = np.zeros(3)
        height = float(view.object.position[2] - view.robot_hand.position[2])
        if self._grip == 1.0:
            self._height_in_palm = height
        careful = self._task == "give" and self.participant.behaviour != "early_release"
        if careful and self._height_in_palm - height > SLIP and view.robot_load_share < 0.5:
            self._go("holding", t)
            return
        duration = self.participant.release_time + 0.1 * self.scene.object_mass
        self._grip = max(0.0, self._grip - dt / duration)
        if self._grip == 0.0:
            self._retreat(t)
