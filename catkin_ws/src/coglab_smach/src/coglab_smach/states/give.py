"""Giving an object: the grip loosens while the person takes the load, and closes again if they do not keep it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.hand import firm_speed
from coglab_smach.states.hand_tracking import AWAY, HandLook, HandTrack, from_palm, hand_from_palm, way_to_hand
from coglab_smach.states.held_object import HeldObject
from coglab_smach.states.loosening_grip import LooseningGrip
from coglab_smach.states.motion import await_rest, rise, shift
from coglab_smach.states.reach import WaitForPerson
from coglab_smach.states.weight import person_holds

GRAVITY = 9.81  # m/s^2
ASTRAY = 0.02  # m, smallest distance from object to person's hand that the arm corrects
BEYOND = 0.06  # m, the same before ``give.lower_after``: a nearer hand comes to the object by itself
PRESSES = 2.0  # N (or the weight, if larger): downward force of a hand that has the object
LASTS = 0.3  # s of pressing after which the arm sinks with the hand
SINKS = 3  # largest number of times that the arm sinks
BRINGS = 3  # largest number of times that the arm brings the object to the hand
LOOKS = 0.3  # s between two looks; a waiting hand moves by less than ASTRAY in between


class WaitTaker(WaitForPerson):
    """wait_stop of a reach to the person's hand. At its end the arm stands, and the contact detector is armed for
    release.

    The goal is the person's hand. When the hand comes to the object, a following arm would back away. Therefore, the
    reach ends early within the last ``give.touch_within`` m, if the hand is within ``give.near`` m of the palm: at a
    contact, or when the hand is nearer to the palm than at the delivery, so that the goal moves away again by
    ``give.goal_leaves`` m. The person covers the rest of the way. A hand that is farther away is followed.
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
        if not self.reason:  # the arm must come to rest at its latched goal
            await_rest(self.ctx, self.check)
        self.await_pending(self.ctx.arm.switch_controller("ptp"), "end of the reach by switching to 'ptp'", 3.0)
        self.wait_for(self._held.there, "a sight of the object in the hand", 2.0, code=ReasonCode.WAITS_FOR_SIGHT)
        limit = float(release.get("timeout", self.ctx.config.get("release_timeout")))
        weight = {"mass": settings["mass"], "load_share": float(release.get("threshold", 0.5))}
        # give_load starts immediately afterwards, and disarms it.
        self.await_pending(contact.arm("release", limit + 5.0, weight), "arming of the contact detector", 2.0)
        return "succeeded"

    def arrived(self) -> bool:
        self._held.check()
        return super().arrived()

    def _await_taker(self, settings: dict[str, Any], goal: dict[str, Any]) -> str:
        """Wait until the reach has ended or the person has come. Returns the evidence that they have come, or ''."""
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
        if leaving():
            return f"the hand moved away when the arm was {nearest:.2f} m from its goal; the arm does not follow it"
        return ""

    def _comes_to_its_end(self) -> bool:
        within = self.ctx.config.number("give.touch_within")
        if not 0.0 < self.ctx.arm.dmp_progress().remaining_distance < within:
            return False
        distance = hand_from_palm(self)
        return distance is not None and distance < self.ctx.config.number("give.near")


class GiveLoad(CoglabState):
    """Let the person take the load of the offered object. Ends when they carry the share given by the delivery's
    ``release``. The contact detector is already armed for release (WaitTaker).

    The grip loosens in proportion to the person's share of the weight, as the grip of people does (Chan 2012, Endo
    2012). If the hand measures its grip force, the force falls with the load: at least ``give.grip_safety`` times the
    force that friction needs for the rest of the load, and at most ``give.ease`` counts looser. Otherwise the grip
    opens by up to ``give.loosen`` counts. If the load returns to the arm, or the object sinks in the hand by
    ``give.slip`` m, the grip closes again. After such a slip it stays closed to the end.

    If the person's hand waits near, but not at the object, the arm brings the object to it, from ``give.bring_after`` s
    after its arrival on: the predicted place may be wrong for a hand that hesitates. If nothing has happened for
    ``give.lower_after`` s, the arm sinks by ``give.lower`` m, so that the weight rests in the hand. It sinks at once if
    the hand presses the object down. After the time limit the grip closes with the lowest force (``give.close_speed``),
    because the person's fingers are there. It tightens only at home.
    """

    default_time_limit = 20.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id", "object_entry", "grasp_name", "delivery"], io_keys=["grip"])
        self._grip = Grip()
        self._fingers: LooseningGrip
        self._needed = self._slips_at = self._weight = 0.0
        """needed: share of the load. slips_at: grip force (N) below which the object slips if the hand carries all of
        it. weight: N"""
        self._firm = 0  # wire speed that restores the grip force of before
        self._held: HeldObject
        self._hand: HandLook
        self._offer: Callable[[], np.ndarray | None] = lambda: None
        """returns the vector (m) from the object to the place where the person's hand takes it"""
        self._reset()

    def _reset(self) -> None:
        """Reset for each object."""
        self._lowering: Pending | None = None
        self._moving: Pending | None = None
        self._ending: Pending | None = None  # cancel request of the running motion
        self._lower_at = self._look_at = 0.0
        self._brings = self._sinks = 0
        self._pressed_since: float | None = None
        self._way: np.ndarray | None = None  # m, from the object to the place where the hand takes it, at the last look
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
        # Two sides press on the object: it slips if the friction on both cannot carry it.
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
            self.wait_for(self._taken, "the person's taking of the load", limit, code=ReasonCode.WAITS_FOR_PERSON)
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
        # Until the hand is open, the arm must not move away: the person holds the object too.
        grip.shared = True
        self.ctx.journal.mark("contact")
        event = contact.event()
        self.reason = event.message if event is not None else ""
        return "succeeded"

    def _taken(self) -> bool:
        """Process the person's share of the load. Returns True if it is large enough."""
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
        """True if a hand that has the object has pressed it down for LASTS s."""
        if -share * self._weight < max(PRESSES, self._weight):
            self._pressed_since = None
        elif self._pressed_since is None:
            self._pressed_since = now
        return self._pressed_since is not None and now - self._pressed_since >= LASTS

    def _sink_with_them(self, now: float) -> None:
        """Sink with a hand that presses, instead of bringing the object elsewhere."""
        if self._moving is not None and not self._moving.done():
            # Wait for the end of this motion; otherwise its end would count as the end of the next one.
            if self._ending is None:
                self._ending = self.ctx.arm.cancel_motion("the object is pressed down")
            if not self._ending.done():
                return
        self._moving = self._ending = None
        if self._sinks < SINKS and (self._lowering is None or self._lowering.done()):
            self._lower(now)

    def _follow(self, share: float, begins: float, now: float) -> None:
        """Loosen the grip according to the share. Close it again if the load returns or the object slips."""
        if self._held.sunk > self._number("slip"):
            self._close_again()
        elif share > begins / 2:
            self._back_since = None
            part = (share - begins) / max(1e-6, self._needed - begins)
            if part > 0.0:
                # The person's hand is at the object: the arm must not move away with it.
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
        """Keep the ratio of grip force and load. Returns False if the hand does not measure its grip force."""
        left = 1.0 - min(1.0, share)
        least = left * self._slips_at * self._number("grip_safety")
        return self._fingers.ease_to(left, least, self._number("ease"), self.ctx.clock.now())

    def _bring_or_lower(self, now: float) -> None:
        """Bring the object to a waiting hand, or sink. If no hand is seen nearby, look again later."""
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
        """Let the arm sink by ``give.lower`` m."""
        self._look_at, self._sinks = now + LOOKS, self._sinks + 1
        self._lowering = rise(self.ctx, -self._number("lower"), self._number("lower_speed"))

    def _may_hold(self) -> bool:
        """Returns whether the person may hold the object. At rest, the load of a light object may be too small to
        measure. Only a hand that was tracked away from the object does not hold it; an unseen hand may be at it."""
        away = from_palm(self, self._grip.hand, 0.3)
        if away is not None and away > AWAY and self._grip.hand.is_sure:
            return False
        for motion in (self._moving, self._lowering):
            if motion is not None:
                motion.cancel()
        return person_holds(self, {"mass": self._grip.mass, "load_share": self._needed}) is not False

    def _keep(self) -> None:
        """The object stays in the hand: close the grip again if it was loosened."""
        self._fingers.stand()
        self._close_again()

    def _close_again(self) -> None:
        """Close gently, if the grip is loosened."""
        if (self._fingers.loosened() or 0) > 0:
            self._grip.firm = self._firm
            self._fingers.tighten()
