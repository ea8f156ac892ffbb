"""Contact from all that feels it, as one event: the detector behind the ContactPort.

Modes contact, load and release are those of D4.10 (ContactDetector): torques of an arm that stands still. Mode
IN_MOTION watches from arming on, whether the arm moves or not: the moving arm's torques, the fingers and touch, each
with a probability, and D4.10's derivative once the arm stands. The first moment at which a contact is likely enough is
the event; its source is the one that says so alone, or ``fused``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from coglab_msgs.msg import ReasonCode

from coglab_smach.contact.detector import ContactDetector, Joints
from coglab_smach.contact.evidence import DECIDED, Evidence, Fingers, Motor, Touch, name_of, together
from coglab_smach.contact.moving_contact import MovingContact
from coglab_smach.ports.interfaces import ContactEvent

IN_MOTION = "contact_in_motion"
HELD_CENTRE = (0.04, 0.0, 0.0)
"""m in ih2_palm: about where the fingers hold an object"""


class FusedDetector:
    """Feed it what there is; each feed may answer with the one event of an arming. Times in s on one clock."""

    def __init__(
        self,
        still: ContactDetector,
        moving: MovingContact | None,
        touch: Touch | None = None,
        fingers: Fingers | None = None,
    ) -> None:
        """``moving`` None: there is no model of the arm, and IN_MOTION is refused."""
        self.still, self.moving = still, moving
        self._touch, self._fingers = touch or Touch(), fingers or Fingers()
        self._until: float | None = None
        self._first = False
        """nothing was looked at yet since arming"""
        self._evidence: dict[str, Evidence] = {}
        self._mass = 0.0
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
        """As ContactDetector.arm, with the mode IN_MOTION besides. ValueError says what is wrong with the request."""
        if mode == IN_MOTION and self.moving is None:
            raise ValueError(f"{IN_MOTION} needs a model of the arm and learnt thresholds, and there are none")
        self.still.arm("contact" if mode == IN_MOTION else mode, now, timeout, k, joints, mass, load_share)
        self._mass = mass if mode == "load" else 0.0
        self._until = now + timeout if mode == IN_MOTION else None
        self._first = True
        self._evidence.clear()
        self._touch.reset()
        self._fingers.reset()

    def disarm(self) -> None:
        """Stop watching."""
        self.still.disarm()
        self._until = None

    def state(self) -> str:
        """off, waiting or watching, see ContactDetector.state; in motion it watches as soon as it has seen enough."""
        if self._until is None:
            return self.still.state()
        return "watching" if self.moving is not None and self.moving.change is not None else "waiting"

    @property
    def margin(self) -> float:
        """Largest signal over its threshold now."""
        if self._until is None:
            return self.still.margin
        return max((each.margin for each in self._evidence.values()), default=0.0)

    def set_payload(self, mass: float, centre: Joints = HELD_CENTRE) -> None:
        """The hand carries this from now on; 0 kg: nothing. ValueError for what is no mass."""
        if self.moving is not None:
            self.moving.set_payload(mass, centre)

    def feed(self, stamp: float, torque: Joints, position: Joints, velocity: Joints) -> ContactEvent | None:
        """External torques as the robot controller estimates them, and the joints: see ContactDetector.feed."""
        event = self.still.feed(stamp, torque, position, velocity)
        if event is None:
            return None
        self._until = None
        # Who has felt the load come knows what the arm carries from now on; with its going the hand is empty.
        if event.code == ReasonCode.LOAD_CARRIED:
            self.set_payload(self._mass)
        elif event.code == ReasonCode.LOAD_RELEASED:
            self.set_payload(0.0)
        return event

    def feed_measured(self, stamp: float, position: Joints, torque: Joints) -> ContactEvent | None:
        """Joints and torques as measured (rad, Nm)."""
        if self.moving is None:
            return None
        self._follow_clock(stamp)
        evidence = self.moving.feed(stamp, position, torque)
        if self._until is None or evidence is None:
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
        while a payload was told, touch is no source."""
        if self.moving is not None and self.moving.load > 0.0:
            return None
        return self._judge(stamp, self._touch.feed(stamp, forces, deviation))

    def feed_hand(self, stamp: float, motors: Sequence[Motor]) -> ContactEvent | None:
        """Motors of the hand, as HandStatus has them."""
        return self._judge(stamp, self._fingers.feed(stamp, motors))

    def _follow_clock(self, stamp: float) -> None:
        """A clock that was set leaves an arming the time that it had."""
        if not math.isfinite(stamp):
            return
        if self._last_stamp is not None and self._until is not None and abs(stamp - self._last_stamp) > 1.0:
            self._until += stamp - self._last_stamp
            self._evidence.clear()
        self._last_stamp = stamp

    def _judge(self, stamp: float, evidence: Evidence | None) -> ContactEvent | None:
        if self._until is None or evidence is None:
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
