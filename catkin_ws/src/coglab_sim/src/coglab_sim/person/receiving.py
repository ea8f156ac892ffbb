"""How the virtual human takes an object: close the last way, grip, lift until the robot lets go."""

from __future__ import annotations

import numpy as np
from coglab_msgs.msg import Say
from coglab_py.pose import length

from coglab_sim.person.phases import Phases
from coglab_sim.person.senses import Percept

THERE = 0.010
"""m between where hand and object are seen to belong together, from which on the fingers close"""
LIFT_SPEED, LIFT = 0.03, 0.03
"""m/s, m: how the hand rises, and how far"""
MORE_THAN_WEIGHT = 1.2
"""share of the expected weight at which it rises no further"""
OPENED, OPEN_FOR = 0.08, 0.2
"""share of their way by which the robot's fingers must have been seen to open, and s since then"""
GRASPS_WITHIN = 4.0
"""s after which who has not come to the object gives up"""


class Receiving(Phases):
    """Phases of VirtualHuman."""

    def _grasping(self, t: float, dt: float, seen: Percept) -> None:
        """Close the last way to the object as it is seen, and grip it."""
        error = seen.object.position - self._turn.apply(self.scene.taken_in_hand) - self._hand
        distance = length(error)
        if self._grip == 0.0 and distance > THERE:
            speed = min(self.participant.place_speed, 4.0 * distance)
            self._velocity = error / distance * speed
            self._hand = self._hand + self._velocity * min(dt, distance / speed)
            if t - self._since > GRASPS_WITHIN:
                self._retreat(t)
            return
        self._velocity = np.zeros(3)
        self._grip = min(1.0, self._grip + dt / self.participant.grip_time)
        if self._grip < 1.0:
            return
        if self.participant.behaviour in ("early_release", "pull_back"):
            self._go("releasing", t)
        else:
            self._closure = seen.hand_closure
            self._go("lifting", t)

    def _lifting(self, t: float, dt: float, seen: Percept) -> None:
        """Take the weight: the hand rises slowly until the robot's hand is seen to open."""
        opened = self._closure - seen.hand_closure > OPENED or self._told == Say.YOU_HAVE_IT
        self._velocity = np.zeros(3)
        if opened:
            if self._sure_since is None:
                self._sure_since = t
            if t - self._sure_since > OPEN_FOR:
                self.grip_force.has_felt(max(self._weight(), float(-seen.load[2])))
                self._retreat(t)
            return
        p = self.participant
        limit = 0.0 if p.behaviour == "never_release" else LIFT
        if self._travelled < limit and self._load_share(seen) < MORE_THAN_WEIGHT:
            self._velocity = np.array([0.0, 0.0, LIFT_SPEED])
            self._hand = self._hand + self._velocity * dt
            self._travelled += LIFT_SPEED * dt
        if t - self._since > p.patience:
            self._go("releasing", t)
