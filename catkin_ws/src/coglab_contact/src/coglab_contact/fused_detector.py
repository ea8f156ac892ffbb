"""Fuses joint torques, finger motors, touch and sight into one contact event.

Modes contact, load and, without a model of the arm, release are those of D4.10 (ContactDetector), for a resting arm.
With a model, release watches the weight go from an arm that may move (LeavingLoad). Mode IN_MOTION watches from
arming on, whether the arm moves or not: torques of the moving arm, fingers, touch and the sight of the object at its
grasp, each with a probability, and D4.10's derivative once the arm stands. The event is the first moment at which a
contact is likely enough; its source is the one that is sure alone, or ``fused``. Mode LIFT watches the weight come to
an arm that lifts what it has grasped, counted from arming on.
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
from coglab_contact.load import GripAndLoad, LeavingLoad
from coglab_contact.moving_contact import MovingContact

IN_MOTION = "contact_in_motion"
LIFT = "lift"
RELEASE = "release"
GRAVITY = 9.81
SETTLING = 0.10  # s after arming over which the residual is averaged that a weight is counted from
CARRIED = 0.06  # s for which the weight has to be there
HELD_CENTRE = (0.04, 0.0, 0.0)  # m in ih2_palm: about where the fingers hold an object


@dataclass
class _Lift:
    """A wait for the weight: N that it takes, and the mean residual of the first moment (Nm)."""

    needed: float
    sum: np.ndarray = field(default_factory=lambda: np.zeros(7))
    count: int = 0
    begun: float | None = None
    since: float | None = None


class FusedDetector:
    """Feed it what there is; each feed may answer with the one event of an arming. Times in s on one clock."""

    def __init__(
        self,
        still: ContactDetector,
        moving: MovingContact | None,
        touch: Touch | None = None,
        fingers: Fingers | None = None,
        held: GripAndLoad | None = None,
    ) -> None:
        """``moving`` None: there is no model of the arm, and IN_MOTION is refused. ``held``: what touch tells of grip
        and load; without it, or where nobody feeds touch, the torques alone tell how much of a load has gone."""
        self.still, self.moving = still, moving
        self._touch, self._fingers, self._palm = touch or Touch(), fingers or Fingers(), InPalm()
        self._held = held
        self.holds = False
        """whether the hand says that it holds something, whatever the arm was told to carry"""
        self._lift: _Lift | None = None
        self._leaving: LeavingLoad | None = None
        self._until: float | None = None
        self._first = False  # nothing was looked at yet since arming
        self._evidence: dict[str, Evidence] = {}
        self._mass = 0.0
        self._before_reach: np.ndarray | None = None
        """Nm, residual of the rest before the reach in which contact was watched for last"""
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
        """As ContactDetector.arm, with the modes IN_MOTION and LIFT besides. ValueError says what is wrong with the
        request."""
        request = (mode, now, timeout, k, joints, mass, load_share)
        if mode in (IN_MOTION, LIFT) and self.moving is None:
            raise ValueError(f"{mode} needs a model of the arm and learnt thresholds, and there are none")
        leaving = None
        if mode == RELEASE and self.moving is not None:
            # Armed too, so that it does not learn what a hand that takes the load does; its own event is not told.
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
            # Who is given something may touch it while the arm still comes.
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
        """off, waiting or watching, see ContactDetector.state; in motion it watches as soon as it has seen enough."""
        if self._leaving is not None:
            return "waiting" if self._leaving.share is None else "watching"
        if self._until is None:
            return self.still.state()
        return "watching" if self.moving is not None and self.moving.change is not None else "waiting"

    @property
    def margin(self) -> float:
        """Largest signal over its threshold now."""
        if self._leaving is not None:
            return self._leaving.margin
        if self._until is None:
            return self.still.margin
        return max((each.margin for each in self._evidence.values()), default=0.0)

    def set_payload(self, mass: float, centre: Joints = HELD_CENTRE) -> None:
        """The hand carries this from now on; 0 kg: nothing. ValueError for what is no mass."""
        if self.moving is not None:
            self.moving.set_payload(mass, centre)
        if self._held is not None:
            self._held.anew()

    def feed(self, stamp: float, torque: Joints, position: Joints, velocity: Joints) -> ContactEvent | None:
        """External torques as the robot controller estimates them, and the joints: see ContactDetector.feed."""
        event = self.still.feed(stamp, torque, position, velocity)
        if event is None or self._leaving is not None:
            return None
        self._until = None
        # Who has felt the load come knows what the arm carries from now on; with its going the hand is empty.
        if event.code == ReasonCode.LOAD_CARRIED:
            self.set_payload(self._mass)
        elif event.code == ReasonCode.LOAD_RELEASED:
            self.set_payload(0.0)
        return event

    def feed_measured(
        self, stamp: float, position: Joints, torque: Joints, made: float | None = None
    ) -> ContactEvent | None:
        """Joints and torques as measured (rad, Nm); ``made``: see MomentumObserver.feed."""
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
        """Forces on the phalanges and the palm (N), as FingertipForces has them. Fingers that hold something feel that:
        while they do, or a payload was told, touch is no source of contact, but tells grip and load."""
        if self._held is not None and self.moving is not None and self.moving.residual is not None:
            self._held.feed(stamp, forces, deviation, self.moving.residual.position)
        if self.holds or (self.moving is not None and self.moving.load > 0.0):
            return None
        return self._judge(stamp, self._touch.feed(stamp, forces, deviation))

    def feed_sight(self, stamp: float, distance: float, angle: float, speed: float) -> ContactEvent | None:
        """How far (m, rad) the palm is from its place at the object that was named on arming, and its speed (m/s)."""
        return self._judge(stamp, self._palm.feed(stamp, distance, angle, speed))

    def feed_hand(self, stamp: float, motors: Sequence[Motor]) -> ContactEvent | None:
        """Motors of the hand, as HandStatus has them."""
        return self._judge(stamp, self._fingers.feed(stamp, motors))

    def _follow_clock(self, stamp: float) -> None:
        """A clock that was set leaves an arming the time that it had."""
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
        """Has the weight come?"""
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
        """Has the weight gone? The share is told until the watch ends. What the hand carries stays told as well, until
        it is empty."""
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
        """Share of the weight that has left the hand since it was armed for RELEASE, as far as that is sure
        (LeavingLoad.sure); None while it is not watched."""
        return self._leaving.sure if self._leaving is not None else None

    def force(self) -> np.ndarray | None:
        """N on the palm, base frame, beyond what acted before the reach in which contact was watched for last, less the
        payload that was told; see MovingContact.force_since. None where that is not known."""
        if self.moving is None or self._before_reach is None:
            return None
        return self.moving.force_since(self._before_reach)

    def grip(self, now: float) -> float | None:
        """N with which the fingers squeeze what they hold, as touch feels it; None where that does not tell at ``now``
        (s)."""
        return None if self._held is None else self._held.grip(now)

    def look(self) -> Signal:
        """As ContactDetector.look; the margin of RELEASE is told too."""
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
