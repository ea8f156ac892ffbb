"""Fuses joint torques, finger motors, touch and sight into one contact event.

Modes contact, load and (without a model of the arm) release are those of D4.10 for a resting arm (ContactDetector).
With a model, RELEASE watches how the weight leaves an arm that may move (LeavingLoad). IN_MOTION watches from arming
on, moving or not: torques of the moving arm, fingers, touch and the sight of the object at its grasp, each with a
probability, and D4.10's derivative when the arm stands. The event is the first moment at which a contact is likely
enough. Its source is the one that alone is likely enough, or ``fused``. LIFT watches how the weight comes to an arm
that lifts a grasped object, counted from arming on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_contact.detector import ContactDetector, Joints, Signal
from coglab_contact.evidence import (
    DECIDED,
    FUSED,
    MOMENTUM,
    ContactEvent,
    Evidence,
    Fingers,
    InPalm,
    Motor,
    Touch,
    name_of,
    probability,
    together,
)
from coglab_contact.load import GRAVITY, SETTLING, GripAndLoad, LeavingLoad
from coglab_contact.moving_contact import MovingContact

IN_MOTION = "contact_in_motion"
LIFT = "lift"
RELEASE = "release"
CARRIED = 0.06  # s for which the weight must be present
OLDEST_SIGHT = 0.15  # s; an older sight of an object is not compared with the palm
HELD_CENTRE = (0.04, 0.0, 0.0)  # m in ih2_palm, approximate centre of a held object


@dataclass
class _Lift:
    """State of mode LIFT. ``needed``: required weight, N. ``sum``: sum of the residuals after arming, Nm."""

    needed: float
    sum: np.ndarray = field(default_factory=lambda: np.zeros(7))
    count: int = 0
    begun: float | None = None
    since: float | None = None


class FusedDetector:
    """Processes all available sources. Each feed may return the one event of an arming. Times in s on one clock."""

    def __init__(
        self,
        still: ContactDetector,
        moving: MovingContact | None,
        touch: Touch | None = None,
        fingers: Fingers | None = None,
        held: GripAndLoad | None = None,
    ) -> None:
        """``moving``: None without a model of the arm; IN_MOTION is then refused. ``held``: grip and load by touch.
        Without it, or without touch data, only the torques show how much of a load has gone."""
        self.still, self.moving = still, moving
        self._touch, self._fingers, self._palm = touch or Touch(), fingers or Fingers(), InPalm()
        self._held = held
        self.holds = False
        """True if the hand reports a grip, independently of the set payload"""
        self._lift: _Lift | None = None
        self._leaving: LeavingLoad | None = None
        self._until: float | None = None
        self._first = False  # no sample was checked since arming
        self._evidence: dict[str, Evidence] = {}
        self._mass = 0.0
        self._before_reach: np.ndarray | None = None
        """Nm, residual at rest before the last reach with IN_MOTION"""
        self._last_stamp: float | None = None

    def arm(
        self,
        mode: str,
        now: float,
        timeout: float,
        k: float = 0.0,
        joints: Sequence[int] = (),
        mass: float = 0.0,
        load_share: float = 0.0,
    ) -> None:
        """Like ContactDetector.arm, plus the modes IN_MOTION and LIFT. ValueError: invalid request."""
        request = (mode, now, timeout, k, joints, mass, load_share)
        if mode in (IN_MOTION, LIFT) and self.moving is None:
            raise ValueError(f"{mode} needs a model of the arm and learnt thresholds, and there are none")
        leaving = None
        if mode == RELEASE and self.moving is not None:
            # Arm it too, so that it does not learn the effect of a taking hand as noise. Its own event is ignored.
            self.still.arm(*request)
            share = load_share if load_share > 0.0 else self.still.settings.load_share
            leaving = LeavingLoad(mass, share, now + timeout, self.moving.weight_before_motion())
            self._lift = None
        elif mode == LIFT:
            if not (mass > 0.0 and timeout > 0.0):
                raise ValueError(f"{LIFT} needs a mass (kg) and a time limit (s), got {mass} and {timeout}")
            self.still.disarm()
            self._lift = _Lift((load_share if load_share > 0.0 else self.still.settings.load_share) * mass * GRAVITY)
        else:
            carries = mode == IN_MOTION and self.moving is not None and self.moving.load > 0.0
            self.still.arm("contact" if mode == IN_MOTION else mode, *request[1:], carries)
            self._lift = None
        if mode == IN_MOTION and self.moving is not None:
            self._before_reach = self.moving.before_motion()
        self._leaving = leaving
        if self._held is not None:
            # A person who receives an object may touch it while the arm is still coming.
            {IN_MOTION: self._held.count_from_now, RELEASE: self._held.count_on}.get(mode, self._held.anew)()
        self._mass = mass if mode in ("load", LIFT) else 0.0
        self._until = now + timeout if mode in (IN_MOTION, LIFT) else None
        self._first = True
        self._evidence.clear()
        self._touch.reset()
        self._fingers.reset()
        self._palm.reset()

    def disarm(self) -> None:
        """Stop watching."""
        self.still.disarm()
        self._until = self._lift = self._leaving = None

    def state(self) -> str:
        """Returns off, waiting or watching (see ContactDetector.state). IN_MOTION watches after enough samples."""
        if self._leaving is not None:
            return "waiting" if self._leaving.share is None else "watching"
        if self._until is None:
            return self.still.state()
        return "watching" if self.moving is not None and self.moving.change is not None else "waiting"

    @property
    def margin(self) -> float:
        """Largest present signal over its threshold."""
        if self._leaving is not None:
            return self._leaving.margin
        if self._until is None:
            return self.still.margin
        return max((each.margin for each in self._evidence.values()), default=0.0)

    def set_payload(self, mass: float, centre: Joints = HELD_CENTRE) -> None:
        """Set the mass (kg, 0: nothing) that the hand carries from now on. ValueError: invalid mass."""
        if self.moving is not None:
            self.moving.set_payload(mass, centre)
        if self._held is not None:
            self._held.anew()

    def feed(self, stamp: float, torque: Joints, position: Joints, velocity: Joints) -> ContactEvent | None:
        """Process the external torques as estimated by the robot controller, and the joints: see
        ContactDetector.feed."""
        event = self.still.feed(stamp, torque, position, velocity)
        if event is None or self._leaving is not None:
            return None
        self._until = None
        # After a load event the payload is known; after a release the hand is empty.
        if event.code == ReasonCode.LOAD_CARRIED:
            self.set_payload(self._mass)
        elif event.code == ReasonCode.LOAD_RELEASED:
            self.set_payload(0.0)
        return event

    def feed_measured(
        self, stamp: float, position: Joints, torque: Joints, made: float | None = None
    ) -> ContactEvent | None:
        """Process measured joints and torques (rad, Nm). ``made``: see MomentumObserver.feed."""
        if self.moving is None:
            return None
        self._follow_clock(stamp)
        self.moving.feed(stamp, position, torque, made)
        if self._lift is not None:
            return self._watch_lift(stamp, self._lift)
        if self._leaving is not None:
            return self._watch_leaving(stamp, self._leaving)
        evidence = self.moving.evidence() if self._until is not None else None
        if evidence is None:
            return None
        if self._first:
            self._first = False
            steady = self.moving.steady()
            if steady is not None and steady.margin >= 1.0:
                return self._event(stamp, [steady], ReasonCode.CONTACT_CAME_EARLY)
        return self._judge(stamp, evidence)

    def feed_touch(
        self, stamp: float, forces: Sequence[Sequence[float]], deviation: float = 0.0
    ) -> ContactEvent | None:
        """Process the forces (N) on phalanges and palm, as in FingertipForces. While the fingers hold something, or a
        payload is set, touch is no evidence of contact: it measures grip and load."""
        if self._held is not None and self.moving is not None and self.moving.residual is not None:
            self._held.feed(stamp, forces, deviation, self.moving.residual.position)
        if self.holds or (self.moving is not None and self.moving.load > 0.0):
            return None
        return self._judge(stamp, self._touch.feed(stamp, forces, deviation))

    def feed_sight(self, stamp: float, distance: float, angle: float, speed: float) -> ContactEvent | None:
        """Process the palm's distance (m, rad) from its grasp of the object named on arming, and its speed (m/s)."""
        return self._judge(stamp, self._palm.feed(stamp, distance, angle, speed))

    def feed_hand(self, stamp: float, motors: Sequence[Motor]) -> ContactEvent | None:
        """Process the motors of the hand, as in HandStatus."""
        return self._judge(stamp, self._fingers.feed(stamp, motors))

    def _follow_clock(self, stamp: float) -> None:
        """If the clock was set, an arming keeps its remaining time."""
        if not math.isfinite(stamp):
            return
        if self._last_stamp is not None and abs(stamp - self._last_stamp) > 1.0:
            if self._until is not None:
                self._until += stamp - self._last_stamp
            if self._leaving is not None:
                self._leaving.clock_was_set(stamp - self._last_stamp)
            if self._lift is not None:
                self._lift.since = None
            self._evidence.clear()
        self._last_stamp = stamp

    def _watch_lift(self, stamp: float, lift: _Lift) -> ContactEvent | None:
        """Check whether the weight has come."""
        assert self.moving is not None and self._until is not None
        residual = self.moving.residual
        if stamp > self._until:
            self.disarm()
            return None
        if residual is None:
            return None
        if lift.begun is None or residual.fresh or stamp < lift.begun:
            lift.begun, lift.sum, lift.count, lift.since = stamp, np.zeros(7), 0, None
        if lift.count == 0 or stamp - lift.begun < SETTLING:
            lift.sum, lift.count = lift.sum + residual.torque, lift.count + 1
            return None
        force = self.moving.weight_since(lift.sum / lift.count)
        lift.since = None if force < lift.needed else stamp if lift.since is None else lift.since
        if lift.since is None or stamp - lift.since < CARRIED:
            return None
        margin, mass = force / lift.needed, self._mass
        self.disarm()
        self.set_payload(mass)
        message = f"{force:.1f} N carried now (needed {lift.needed:.1f} N)"
        return ContactEvent(True, MOMENTUM, margin, message, probability(margin), ReasonCode.LOAD_CARRIED)

    def _watch_leaving(self, stamp: float, leaving: LeavingLoad) -> ContactEvent | None:
        """Check whether the weight has gone. The share is available until the watch ends. The payload stays set until
        the hand is empty."""
        assert self.moving is not None
        residual = self.moving.residual
        if stamp > leaving.until:
            self._leaving = None
            return None
        felt = None if self._held is None else self._held.share_gone(stamp, leaving.weight)
        weight, fresh = None, False
        posture: Joints = () if residual is None else residual.position
        if residual is not None and (self.moving.slow() or residual.fresh):
            weight, fresh = self.moving.weight(residual.torque, residual.position), residual.fresh
        if leaving.feed(stamp, weight, self.moving.still(), fresh, felt, posture):
            gone, needed = (share * leaving.weight for share in (leaving.share or 0.0, leaving.needed))
            message = f"{gone:.1f} N of the load are gone (needed {needed:.1f} N)"
            sure = probability(leaving.margin)
            return ContactEvent(
                False, MOMENTUM if felt is None else FUSED, leaving.margin, message, sure, ReasonCode.LOAD_RELEASED
            )
        return None

    def share_gone(self) -> float | None:
        """Returns the certain part of the weight share that has left the hand since arming for RELEASE
        (LeavingLoad.sure); None while nothing is watched."""
        return self._leaving.sure if self._leaving is not None else None

    def force(self) -> np.ndarray | None:
        """Returns the force (N) on the palm in the base frame, relative to the force before the last reach with
        IN_MOTION, without the set payload; see MovingContact.force_since. None if unknown."""
        if self.moving is None or self._before_reach is None:
            return None
        return self.moving.force_since(self._before_reach)

    def grip(self, now: float) -> float | None:
        """Returns the grip force (N) of the fingers by touch; None if touch has no data at ``now`` (s)."""
        return None if self._held is None else self._held.grip(now)

    def look(self) -> Signal:
        """Like ContactDetector.look, also with the margin of RELEASE."""
        seen, leaving = self.still.look(), self._leaving
        if leaving is None:
            return seen
        return replace(seen, state=self.state(), mode=RELEASE, margin=leaving.margin)

    def _judge(self, stamp: float, evidence: Evidence | None) -> ContactEvent | None:
        if self._until is None or evidence is None or self._lift is not None:
            return None
        if stamp > self._until:
            self._until = None
            return None
        self._evidence[evidence.source] = evidence
        current = [each for each in self._evidence.values() if each.until >= stamp]
        if together(current) < DECIDED:
            return None
        return self._event(stamp, current, ReasonCode.CONTACT_FOUND)

    def _event(self, stamp: float, evidence: list[Evidence], code: int) -> ContactEvent:
        surest = max(evidence, key=lambda each: each.margin)
        self.disarm()
        return ContactEvent(True, name_of(evidence), surest.margin, surest.message, together(evidence), code)
