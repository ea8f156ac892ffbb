"""Giving an object to a person: the grip loosens as they take the load, and closes again if they do not keep it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.context.wait_reasons import PERSON, SIGHT
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.hand import firm_speed
from coglab_smach.states.hand_tracking import AWAY, HandLook, HandTrack, from_palm, hand_from_palm, way_to_hand
from coglab_smach.states.held_object import HeldObject
from coglab_smach.states.loosening_grip import LooseningGrip
from coglab_smach.states.motion import await_rest, rise, shift
from coglab_smach.states.reach import WaitForPerson
from coglab_smach.states.weight import person_holds

GRAVITY = 9.81
ASTRAY = 0.02  # m that the object is from where it is offered, from which on it is brought there
BEYOND = 0.06  # m, the same before ``give.lower_after``: a hand that is nearer comes to the object by itself
PRESSES = 2.0  # N, or the weight if that is more: a hand that has the object presses it down
LASTS = 0.3  # s of pressing after which the arm sinks with the hand
SINKS = 3  # times at most that the arm sinks
BRINGS = 3  # times at most that the object is brought to the hand
LOOKS = 0.3  # s between two looks, between which a hand that waits moves by less than ASTRAY


class WaitTaker(WaitForPerson):
    """wait_stop of a reach toward the person's hand. At its end the arm stands, and the contact detector is armed for
    release.

    The goal is the person's hand, and it now comes to the object: an arm that still followed it would back away. So
    within the last ``give.touch_within`` m, with the hand within ``give.near`` m of the palm, the reach ends with a
    contact, or when the hand is nearer to the palm than at the delivery, so that the goal goes away again by
    ``give.goal_leaves`` m: the rest of the way is the person's. A hand that is farther away is followed.
    """

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, ["object_id", "object_entry", "delivery", "goal"])
        self._held: HeldObject

    def run(self, ud: Any) -> str:
        contact, entry, release = self.ctx.contact, ud.object_entry, ud.delivery["release"]
        settings = {**entry.get("contact", {}), "mass": float(entry.get("mass", 0.0))}
        self._grip = ud.grip
        self._grip.hand = HandTrack()
        self.watch_person(ud.goal)
        self._held = HeldObject(self.ctx, ud.object_id, ud.grip)
        self.await_reach(lambda: self.arrived() or self._comes_to_its_end())
        self.reason = self._await_taker(settings, ud.goal) if not self.arrived() else ""
        self.ctx.journal.mark("motion_reached")
        self.leave_approach_profile()
        if not self.reason:  # it has to come to rest at the goal that it has latched
            await_rest(self.ctx, self.check)
        self.await_pending(self.ctx.arm.switch_controller("ptp"), "end of the reach by switching to 'ptp'", 3.0)
        self.wait_for(self._held.there, "a sight of the object in the hand", 2.0, code=SIGHT)
        limit = float(release.get("timeout", self.ctx.config.get("release_timeout")))
        weight = {"mass": settings["mass"], "load_share": float(release.get("threshold", 0.5))}
        # give_load begins in a moment, and ends it.
        self.await_pending(contact.arm("release", limit + 5.0, weight), "arming of the contact detector", 2.0)
        return "succeeded"

    def arrived(self) -> bool:
        self._held.check()
        return super().arrived()

    def _await_taker(self, settings: dict[str, Any], goal: dict[str, Any]) -> str:
        """Until the reach has ended; or until the person has come, and then what tells that."""
        contact, leaves = self.ctx.contact, self.ctx.config.number("give.goal_leaves")
        nearest, delivered = math.inf, math.hypot(*goal["offset"])

        def leaving() -> bool:
            nonlocal nearest
            distance, away = self.ctx.arm.dmp_progress().remaining_distance, hand_from_palm(self) or math.inf
            nearest = min(nearest, distance)
            return away < delivered - leaves or (away < delivered and distance > nearest + leaves)

        self.await_pending(contact.arm("contact_in_motion", 10.0, settings), "arming of the contact detector", 2.0)
        try:
            self.await_reach(lambda: self.arrived() or contact.event() is not None or leaving())
        finally:
            contact.disarm()
        event = contact.event()
        if event is not None:
            return f"touched on the way: {event.message}"
        return f"the hand came to within {nearest:.2f} m of its goal and is followed no more" if leaving() else ""

    def _comes_to_its_end(self) -> bool:
        within = self.ctx.config.number("give.touch_within")
        if not 0.0 < self.ctx.arm.dmp_progress().remaining_distance < within:
            return False
        distance = hand_from_palm(self)
        return distance is not None and distance < self.ctx.config.number("give.near")


class GiveLoad(CoglabState):
    """Let the person take the load of the object that the arm holds out, and end when they carry as much of it as the
    delivery's ``release`` asks for. The contact detector is armed for release (WaitStop).

    The grip loosens in proportion to their share of the weight, as people's does (Chan 2012, Endo 2012): where the hand
    feels its grip, the force of it falls as the load does, down to ``give.grip_safety`` times what friction needs for
    what the hand still carries, by ``give.ease`` counts at most; else it is ``give.loosen`` counts. When the load comes
    back to the arm, or the object sinks in the hand by ``give.slip`` m, the grip closes again; what has sunk so once is
    held closed to the end. If the person's hand waits near, but not at the object, the arm brings the object to it,
    from ``give.bring_after`` s after its arrival on: a predicted place may be wrong for a hand that hesitates. If
    nothing has happened for ``give.lower_after`` s the arm sinks by ``give.lower`` m, so that the weight comes to lie
    in the hand; at once if the hand that has the object presses it down. After the time limit the grip closes, with the
    lowest force (``give.close_speed``) since the person's fingers are there, and firmly at home only.
    """

    default_time_limit = 20.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id", "object_entry", "grasp_name", "delivery"], io_keys=["grip"])
        self._grip = Grip()
        self._fingers: LooseningGrip
        self._needed = self._slips_at = self._weight = 0.0
        """share of the load; N of grip below which the object slips while the hand carries all of it; N"""
        self._firm = 0  # wire speed of the grip that is as firm as before
        self._held: HeldObject
        self._hand: HandLook
        self._offer: Callable[[], np.ndarray | None] = lambda: None
        """the way (m) from the object to where the person's hand takes it"""
        self._reset()

    def _reset(self) -> None:
        """For each object that is given."""
        self._lowering: Pending | None = None
        self._moving: Pending | None = None
        self._ending: Pending | None = None  # of what moves
        self._lower_at = self._look_at = 0.0
        self._brings = self._sinks = 0
        self._pressed_since: float | None = None
        self._way: np.ndarray | None = None  # m, of the last look: from the object to where the person's hand takes it
        self._back_since: float | None = None

    def _number(self, name: str) -> float:
        return self.ctx.config.number(f"give.{name}")

    def run(self, ud: Any) -> str:
        release, contact = ud.delivery["release"], self.ctx.contact
        limit = float(release.get("timeout", self.ctx.config.get("release_timeout")))
        self._needed = float(release.get("threshold", 0.5))
        self.allow(limit + 10.0)
        entry = ud.object_entry
        grip = self._grip = ud.grip
        grip.mass, grip.hand = float(entry.get("mass", 0.0)), HandTrack()
        self._hand = HandLook(self.ctx, grip.hand)
        self._weight = GRAVITY * grip.mass
        # Two sides press: the object slips where friction on both does not carry it.
        self._slips_at = self._weight / (2.0 * float(entry.get("friction", 0.5)))
        self._fingers = LooseningGrip(
            self.ctx.hand,
            int(self._number("loosen_speed")),
            int(self._number("close_speed")),
            int(self._number("ease_speed")),
            contact.grip,
        )
        self._firm = firm_speed(self.ctx, entry, ud.grasp_name)
        self._reset()
        self._offer = partial(way_to_hand, self, ud.object_id, ud.delivery)
        self._held = HeldObject(self.ctx, ud.object_id, grip)
        now = self.ctx.clock.now()
        self._look_at, self._lower_at = now + self._number("bring_after"), now + self._number("lower_after")
        try:
            self.wait_for(self._taken, "the person's taking of the load", limit, code=PERSON)
        except TimeLimit as error:
            self._keep()
            error.code = error.code if error.code != ReasonCode.TIME_LIMIT else ReasonCode.NOT_RELEASED
            if not grip.shared and error.code == ReasonCode.NOT_RELEASED:
                grip.shared = self._may_hold()
            raise
        except (Interrupted, PortError):
            self._keep()
            raise
        finally:
            contact.disarm()
            for motion in (self._moving, self._lowering):
                if motion is not None:
                    motion.cancel()
        # Until the hand is open the arm must not go away with what the person holds as well.
        grip.shared = True
        self.ctx.journal.mark("contact")
        event = contact.event()
        self.reason = event.message if event is not None else ""
        return "succeeded"

    def _taken(self) -> bool:
        """Look at the person's share, and do what it asks for; whether it is enough."""
        if self._held.there() and self.ctx.contact.event() is not None:
            return True
        self._hand.look()
        share, now = self.ctx.contact.share_gone(), self.ctx.clock.now()
        begins = self._number("begins")
        self._follow(0.0 if share is None else share, begins, now)
        pressed = share is not None and self._is_pressed(share, now)
        if share is not None and share < begins and now >= self._look_at:
            if pressed:
                self._sink_with_them(now)
                return False
            self._ending = None
            if self._lowering is None and (self._moving is None or self._moving.done()):
                self._bring_or_lower(now)
        return False

    def _is_pressed(self, share: float, now: float) -> bool:
        """Whether a hand that has the object has pressed it down for LASTS s."""
        if -share * self._weight < max(PRESSES, self._weight):
            self._pressed_since = None
        elif self._pressed_since is None:
            self._pressed_since = now
        return self._pressed_since is not None and now - self._pressed_since >= LASTS

    def _sink_with_them(self, now: float) -> None:
        """Rather than bring it anywhere."""
        if self._moving is not None and not self._moving.done():
            # The next motion begins when this one has ended, or its end would be the next one's.
            if self._ending is None:
                self._ending = self.ctx.arm.cancel_motion("the object is pressed down")
            if not self._ending.done():
                return
        self._moving = self._ending = None
        if self._sinks < SINKS and (self._lowering is None or self._lowering.done()):
            self._lower(now)

    def _follow(self, share: float, begins: float, now: float) -> None:
        """As loose as the share asks for; closed again where it does not stay, and where the object slips."""
        if self._held.sunk > self._number("slip"):
            self._close_again()
        elif share > begins / 2:
            self._back_since = None
            part = (share - begins) / max(1e-6, self._needed - begins)
            if part > 0.0:
                # The person's hand is at the object: the arm must not go away with it.
                self._grip.shared = True
                if not self._ease(share):
                    self._fingers.loosen_to(min(1.0, part) * self._number("loosen"))
            elif not self._ease(0.0):
                self._fingers.stand()
        else:
            self._back_since = now if self._back_since is None else self._back_since
            self._fingers.stand()
            if now - self._back_since >= self._number("back_time"):
                self._grip.shared = False
                self._close_again()

    def _ease(self, share: float) -> bool:
        """The ratio of grip and load stays; False where the hand does not feel its grip."""
        left = 1.0 - min(1.0, share)
        least = left * self._slips_at * self._number("grip_safety")
        return self._fingers.ease_to(left, least, self._number("ease"), self.ctx.clock.now())

    def _bring_or_lower(self, now: float) -> None:
        """Bring the object to a person's hand that waits elsewhere, or sink; where no hand is, look again soon."""
        self._look_at = now + LOOKS
        distance, near, before = hand_from_palm(self), self._number("near"), self._way
        self._way = None
        if distance is None or distance >= near:
            return
        way = self._way = self._offer()
        length = 0.0 if way is None else math.hypot(*way)
        if way is not None and (BEYOND if now < self._lower_at else ASTRAY) < length < near and self._brings < BRINGS:
            if before is not None and math.hypot(*(way - before)) < ASTRAY:
                speed = self._number("bring_speed")
                self._moving, self._way, self._brings = shift(self.ctx, way, speed), None, self._brings + 1
                self._lower_at = now + length / speed + self._number("lower_after")
        elif now >= self._lower_at:
            self._lower(now)

    def _lower(self, now: float) -> None:
        """The arm sinks."""
        self._look_at, self._sinks = now + LOOKS, self._sinks + 1
        self._lowering = rise(self.ctx, -self._number("lower"), self._number("lower_speed"))

    def _may_hold(self) -> bool:
        """Whether the person does: what they carry of a light object is not sure to be felt while the arm stands. Only
        a hand that was seen to go away from it holds nothing; one that nobody sees may be at it."""
        away = from_palm(self, self._grip.hand, 0.3)
        if away is not None and away > AWAY and self._grip.hand.is_sure:
            return False
        for motion in (self._moving, self._lowering):
            if motion is not None:
                motion.cancel()
        return person_holds(self, {"mass": self._grip.mass, "load_share": self._needed}) is not False

    def _keep(self) -> None:
        """The object stays in the hand: closed again, where it was loosened."""
        self._fingers.stand()
        self._close_again()

    def _close_again(self) -> None:
        """Gently, if it is loosened."""
        if (self._fingers.loosened() or 0) > 0:
            self._grip.firm = self._firm
            self._fingers.tighten()
