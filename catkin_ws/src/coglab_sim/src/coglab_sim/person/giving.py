"""How the virtual human gives: place the object into the robot's palm, hold on, let go."""

from __future__ import annotations

import numpy as np
from coglab_msgs.msg import Say
from coglab_py.pose import length
from scipy.spatial.transform import Rotation

from coglab_sim.person.phases import NEAR, REGRIPS, STILL, Phases
from coglab_sim.person.senses import Percept

BEYOND = 0.05
"""m past where the palm was seen after which the person stops: nothing is there"""
PLACES_WITHIN = 4.0
"""s after which who has felt nothing stops, too"""
AFTER_TOUCH, RAMP = 0.02, 0.15
"""m/s at which the object is pressed on from first touch, and s in which the hand gets as fast as it places"""
FOLLOW_UP = 0.015
"""m, most that the hand goes on after first touch"""
CLOSED = 0.08
"""share of their way by which the robot's fingers must have been seen to close"""
CLOSING = 0.1
"""1/s of their way, below which they look as if they had closed"""
TOUCH_PART, TOLD_PART = 0.7, 0.4
"""what a closed hand whose grip is felt, and a spoken 'I have it', count of what it takes to let go"""
AGAIN = 0.5
"""s without enough touch in a hand that is not closing, after which who has the habit presses again"""
LOOSE, FEELS = 0.5, 0.5
"""share of the grip at which the fingers stop, s at most, until it is felt who carries"""
SINK_SPEED = 0.03
"""m/s at which an arm that relaxes sinks meanwhile"""
CARRIES = 0.7
"""share of the weight that may still be felt then, or the robot does not hold"""


class Giving(Phases):
    """Phases of VirtualHuman."""

    def _taken_already(self, seen: Percept, near: bool) -> bool:
        """While waiting: the robot's hand is seen to close on the object, or is felt to press on it already."""
        if not near or self.participant.used_to_touch:
            self._held_load = seen.load
        self._closure = min(self._closure, seen.hand_closure) if near else seen.hand_closure
        pressed = length(seen.load - self._held_load) >= self.participant.press
        return pressed or seen.hand_closure - self._closure > CLOSED

    def _placing(self, t: float, dt: float, seen: Percept) -> None:
        """Bring the object into the palm, against the palm's outward axis, until it is felt; then press a little."""
        p = self.participant
        normal, along = seen.robot_hand.axis(0), seen.robot_hand.axis(2)
        to_object = self._middle() - seen.robot_hand.position
        gap = float(to_object @ normal) - self._thickness(normal)
        pressing = length(seen.load - self._held_load)
        if self._felt_since is None and pressing > 0.0:
            self._felt_since, self._travelled = t, 0.0
        if self._felt_since is not None and p.behaviour == "early_release":
            self._go("releasing", t)
            return
        if self._felt_since is not None and (pressing >= p.press or self._travelled >= FOLLOW_UP):
            if p.behaviour == "pull_back":
                self._retreat(t)
            else:
                self._go("holding", t)
            return
        if self._felt_since is None and (gap < -BEYOND or t - self._since > PLACES_WITHIN):
            self._go("holding", t)
            return
        ramp = min(1.0, (t - self._since) / RAMP)
        speed = ramp * min(p.place_speed, 2.0 * max(gap, 0.0) + 0.04)
        self._velocity = -normal * (AFTER_TOUCH if self._felt_since is not None else speed)
        aside = float(to_object @ along)
        if self._felt_since is None and abs(aside) > p.aligns_within:
            self._velocity = self._velocity - ramp * along * float(np.clip(2.0 * aside, -0.05, 0.05))
        self._hand = self._hand + self._velocity * dt
        self._travelled += length(self._velocity) * dt

    def _thickness(self, direction: np.ndarray) -> float:
        """m, half of the object along a direction."""
        turned = self._turn * Rotation.from_quat(self.scene.object_turn)
        return float(np.abs(turned.inv().apply(direction)) @ self.scene.object_size) / 2

    def _holding(self, t: float, dt: float, seen: Percept) -> None:
        """Hold on until load and grip say that the robot has it."""
        self._velocity = np.zeros(3)
        p = self.participant
        self._grip = min(1.0, self._grip + dt / REGRIPS)
        if self._sunk > 0.0:  # up again, after a try to let go
            self._sink(SINK_SPEED, dt)
        closed = seen.hand_closure - self._closure > CLOSED and seen.closing_speed < CLOSING
        if p.behaviour == "tug" and closed:
            self._tug(t, dt)
            return
        if p.behaviour == "never_release":
            if t - self._since > p.patience:
                self._retreat(t)
            return
        if not closed and self._lost_touch(t, seen):
            self._tries += 1
            self._go("placing", t)
            return
        if self._signs(t, seen, closed) < 1.0:
            self._sure_since = None
        elif self._sure_since is None:
            self._sure_since = t
        if self._sure_since is not None and t - self._sure_since > p.assurance:
            self._go("releasing", t)
        elif t - self._since > p.patience:
            self._retreat(t)

    def _lost_touch(self, t: float, seen: Percept) -> bool:
        """The robot's open hand has backed away from the object: time to press again, if not tried too often."""
        touch = length(seen.load - self._held_load)
        if touch >= 0.5 * self.participant.press or seen.robot_speed >= STILL or seen.closing_speed > CLOSING:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = t
        away = self._still_since is not None and t - self._still_since > AGAIN
        return away and self._tries < self.participant.presses_again and self._gap(seen.robot_hand, seen.object) < NEAR

    def _signs(self, t: float, seen: Percept, closed: bool) -> float:
        """How surely the robot holds; the person lets go from 1 on."""
        signs = max(0.0, 1.0 - self._load_share(seen)) / self.participant.release_share
        if not closed:
            self._felt_since = None
            return signs
        if self._felt_since is None:
            self._felt_since, self._touched = t, self._held_load
        grip_felt = bool(np.any(seen.load != self._touched)) or t - self._felt_since > self.participant.believes_closed
        return signs + TOUCH_PART * grip_felt + TOLD_PART * (self._told == Say.I_HAVE_IT)

    def _tug(self, t: float, dt: float) -> None:
        """Pull to and fro before letting go."""
        if self._sure_since is None:
            self._sure_since = t
        since = t - self._sure_since
        rate = 2 * np.pi * 1.5
        self._velocity = np.array([0.012 * rate * np.cos(rate * since), 0.0, 0.0])
        self._hand = self._hand + self._velocity * dt
        if since > 3.0 and abs(np.sin(rate * since)) < 0.2:
            self._go("releasing", t)

    def _releasing(self, t: float, dt: float, seen: Percept) -> None:
        """Open the grip; halfway, whoever gives waits to feel that the robot carries, else holds on again."""
        self._velocity = np.zeros(3)
        p = self.participant
        careful = self._task == "give" and p.behaviour != "early_release"
        if careful and self._grip <= LOOSE and not self._checked:
            self._feel_who_carries(t, dt, seen)
            return
        self._grip = max(0.0, self._grip - dt / p.release_time)
        if self._grip == 0.0:
            self._retreat(t)

    def _feel_who_carries(self, t: float, dt: float, seen: Percept) -> None:
        """Less of the weight must be felt. An arm that relaxes sinks a little: what the robot holds does not sink with
        it."""
        loosened = self.participant.release_time * (1.0 - LOOSE) + self.participant.feeling_delay
        self._checked = self._load_share(seen) < CARRIES and t - self._since > loosened
        if self._checked:
            return
        if self.participant.relaxes and self._sunk < SINK_SPEED * FEELS:
            self._sink(-SINK_SPEED, dt)
        elif t - self._since > loosened + FEELS:
            self._go("holding", t)

    def _sink(self, speed: float, dt: float) -> None:
        self._velocity = np.array([0.0, 0.0, speed])
        self._hand = self._hand + self._velocity * dt
        self._sunk -= speed * dt
