"""States of a reach: starting a DMP, and waiting for its end or for contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.awaited import ARM, CONTACT, HAND, PERSON
from coglab_smach.context.context import Context
from coglab_smach.context.hand_track import HandTrack
from coglab_smach.kinematics.motion_time import reach_time
from coglab_smach.ports.interfaces import ContactEvent, DmpRequest
from coglab_smach.ports.pending import PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.motion import shift, shift_time
from coglab_smach.states.reach_watch import LEFT, LOWERED, OUTSIDE, PersonsGrip, ReachWatch, target_of
from coglab_smach.states.where import HandLook, off_grasp, palm_axis

BUMPS = 2
"""touches of something else after which the arm still comes again"""
DRAWN_BACK, DRAWING_BACK = 0.06, 5.0
"""m; and s that drawing back may take beyond what limits and speed scale ask for"""
SEATED = 0.03
"""m off its grasp at most, for an object that the fingers may close on at a touch"""
FIRM = 2.5
"""margin of a touch that is more than brushing past"""
BETWEEN = 0.01
"""m off the last of the way, at most, for an object that is seen between the fingers"""
NEWS = 0.02  # s after which the arm tells of a motion that has begun
CAUGHT = 1.0
"""s in which fingers that have begun to close on the way stand"""
SLIDING = 0.6  # s for which the hand goes on at most, at full speed scale


def dmp_request(goal: dict[str, Any], primitive: str | None = None, ratio: float | None = None) -> DmpRequest:
    """The request of a goal as it travels in user data."""
    orientation = goal.get("orientation")
    return DmpRequest(
        primitive_id=primitive or goal["primitive"],
        goal_frame=goal["frame"],
        goal_offset=list(goal["offset"]),
        dmp_ratio=float(ratio if ratio is not None else goal.get("dmp_ratio", 1.0)),
        orientation_control=orientation is not None,
        target_orientation=list(orientation if orientation is not None else (0.0, 0.0, 0.0, 0.0)),
        goal_approach=goal.get("approach", (0.0, 0.0, 0.0)),
        arrival_speed=float(goal.get("arrival_speed", 0.0)),
        **goal.get("limits", {}),
    )


def start(state: CoglabState, request: DmpRequest) -> None:
    """Start a reach. A tracker that has lost the goal for a moment gets as long as a running motion would give it."""
    ctx = state.ctx
    end = ctx.clock.now() + float(ctx.config.get("goal_lost_time", 1.0))
    while True:
        try:
            state.await_pending(ctx.arm.execute_dmp(request), f"start of primitive '{request.primitive_id}'", 3.0)
            return
        except TimeLimit:
            raise
        except PortError as error:
            if error.code != ReasonCode.GOAL_STALE or ctx.clock.now() >= end:
                raise
        state.pause(0.05)


class ExecuteDmp(CoglabState):
    """Temporary state: starts the motion and passes on to wait_stop; the controller manager closes the loop."""

    default_time_limit = 5.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["goal"])

    def run(self, ud: Any) -> str:
        request = dmp_request(ud.goal)
        profile = str(self.ctx.config.get("approach_profile", ""))
        if profile:
            self.await_pending(self.ctx.arm.apply_profile(profile), f"feedback profile '{profile}'", 2.0)
        start(self, request)
        self.ctx.journal.mark("motion_started")
        self.reason = f"primitive '{request.primitive_id}' toward {request.goal_frame}"
        return "succeeded"


class WaitStop(CoglabState):
    """Wait for the end of the reach or, if ``trigger`` asks for it, for the contact trigger.

    trigger: '' (the end of the motion is enough) or 'contact' (an object is in the hand). Contact is watched for from
    the last ``contact_within`` m of the reach on and ends the motion. The reach may take ``reach_timeout`` beyond what
    the primitive's duration and the arm's limits ask for.
    """

    default_time_limit = 20.0
    owns_motion = True

    def __init__(self, ctx: Context, trigger: str, keys: Sequence[str] = ()) -> None:
        super().__init__(ctx, input_keys=["object_entry", "goal", "grasp"] if trigger == "contact" else keys)
        self.trigger = trigger
        self._left = False
        """the compliant profile of the approach"""
        self._watched: ReachWatch | None = None
        self._grip: PersonsGrip | None = None
        self._arrived: float | None = None
        """s, when the hand was first at its place"""
        self._deeper = False
        """it has gone on from there"""
        self._watches = self._caught = False
        """for a contact; and the fingers have closed around something while the arm paused"""
        self._looks: HandLook | None = None
        """at the person's hand, once the fingers have begun to close"""
        self._hand: dict[str, Any] = {}
        """of the grasp, as the object's entry has it"""

    def run(self, ud: Any) -> str:
        self._left = self._deeper = self._watches = self._caught = False
        self.ctx.closing = self.ctx.hand_track = self._looks = self._arrived = None
        target = target_of(ud.goal) if self.trigger == "contact" else ""
        self._grip = PersonsGrip(self, target) if target else None
        self._watched = ReachWatch(self, ud.goal, self._grip) if self.trigger and "watch" in ud.goal else None
        if self.trigger == "contact":
            self.ctx.closing_firm = int(ud.grasp["hand"].get("firm", 0))
            self.ctx.shared_mass = float(ud.object_entry.get("mass", 0.0))
            self._hand = ud.grasp["hand"]
            try:
                return self._await_contact(ud)
            except Interrupted:
                # STOP, or an action that is ended: what closes on a person's object stops at once.
                if self.ctx.closing is not None:
                    self.ctx.closing.cancel()
                raise
        return self._await_end(ud)

    def _await_end(self, ud: Any) -> str:
        self._await_reach(self._reached)
        self.ctx.journal.mark("motion_reached")
        return "succeeded"

    def _await_contact(self, ud: Any) -> str:
        """The object may come into the hand on the way, at its end, or be brought there once the arm waits. What
        touches the hand while the object is elsewhere is not the object: the arm draws back and comes again."""
        arm, within = self.ctx.arm, float(self.ctx.config.get("contact_within", 0.12))
        for left in reversed(range(BUMPS + 1)):
            self._await_reach(lambda: self._reached() or 0.0 < arm.dmp_progress().remaining_distance < within)
            self._watch(ud)
            away, event = off_grasp(self, ud.goal), self.ctx.contact.event()
            if away is None or away < float(self.ctx.config.get("contact_near", 0.09)):
                if event is not None and away is not None and away > SEATED and event.margin < FIRM:
                    self._slide_in(ud)
                return self._found(event)
            self.ctx.journal.mark("bumped")
            if left:
                self._come_again(ud)
        raise PortError(
            f"something touches the hand, and the object is {away:.2f} m from where it would be held",
            ("something is in the way, or somebody pushes the arm",),
            ReasonCode.NO_CONTACT,
        )

    def _come_again(self, ud: Any) -> None:
        """Draw back against the palm's outward axis with the hand open, and begin the reach anew."""
        arm = self.ctx.arm
        self.allow(20.0)
        # What begins while the arm moves takes its speed along, and brakes less than an arm that is stopped.
        self.await_pending(arm.cancel_motion("something touches the hand"), "rest of the arm", 3.0, code=ARM)
        self.await_pending(arm.switch_controller("ptp"), "switching to 'ptp'", 3.0)
        self._open_again()
        back = palm_axis(self.ctx)
        if back is not None:
            way = (self.ctx, -DRAWN_BACK * back, 0.1)
            limit, moved = DRAWING_BACK + shift_time(*way), shift(*way)
            self.allow(limit + 10.0)
            if moved is not None:
                try:
                    self.await_pending(moved, "drawing back", limit, arm.speed_scale, ARM)
                except PortError as error:
                    self.reason = error.sentence  # as far as it goes
        self.await_pending(arm.switch_controller("dmp"), "switching to controller 'dmp'", 3.0)
        watch = self._watched
        if watch is None:
            self._begin_again(ud.goal)
        elif watch.hopeful():
            watch.forgive()
            # Where the object will be is not told any more once the person's reach is over.
            self._begin_again(watch.goal_now())
        else:
            self._pause(watch, *watch.doubt())

    def _open_again(self) -> None:
        """Fingers that have begun to close: with them the arm would come as a fist."""
        self._caught = False
        if self.ctx.closing is None:
            return
        self.ctx.closing.cancel()
        self.ctx.closing = self.ctx.hand_track = self._looks = None
        opening = self.ctx.hand.preshape(self._hand["mode"], self._hand["level"])
        self.await_pending(opening, "the hand's opening", 5.0, code=HAND)
        self.ctx.shared = False

    def _begin_again(self, goal: dict[str, Any]) -> None:
        """Start a reach anew. What lies where no hand may go by now has fallen, or was taken there."""
        try:
            start(self, dmp_request(goal))
            self.pause(NEWS)  # until then the arm tells how the motion before has ended
        except PortError as error:
            if error.code != ReasonCode.GOAL_OUTSIDE_WORKSPACE or self._grip is None:
                raise
            code = self._grip.fell_or_withdrawn()
            raise TimeLimit("the reach was given up", (error.sentence,), code) from None

    def _pause(self, watch: ReachWatch, code: int, why: str) -> None:
        """Nobody seems to offer or ask within the region any more: the arm stands. Who goes on within
        ``handover.pause`` s is met; else the reach is given up, with this code and reason."""
        limit = float(self.ctx.config.get("handover.pause", 3.0))
        self.allow(limit + 8.0)
        resting = self.ctx.arm.cancel_motion("the arm waits: nobody offers or asks")
        self.await_pending(resting, "rest of the arm", 3.0, code=ARM)
        self.ctx.journal.mark("paused")
        try:
            self.wait_for(watch.hopeful, "that the person goes on", limit, code=PERSON)
        except TimeLimit as error:
            if error.code != ReasonCode.TIME_LIMIT:
                raise
            raise TimeLimit("the reach was given up", (why,), code) from None
        if self._watches and self.ctx.contact.event() is not None:
            return  # an object has come into the hand that stands
        self._caught = self._has_caught()
        if self._caught:
            return
        self._open_again()
        watch.forgive()
        self._begin_again(watch.goal_now())

    def _has_caught(self) -> bool:
        """Whether fingers that have begun to close hold something: they open for nobody who is merely seen."""
        if self.ctx.closing is None:
            return False
        end = self.ctx.clock.now() + CAUGHT
        # The hand tells that it holds something a moment after its order has ended.
        while not (self.ctx.closing.done() and self.ctx.hand.state().holding) and self.ctx.clock.now() < end:
            self.pause(NEWS)
        return self.ctx.hand.state().holding

    def _watch(self, ud: Any) -> None:
        """Arm the detector and wait for what it finds; where the arm has arrived and feels nothing, it goes on."""
        settings = self._contact_settings(ud)
        limit = float(settings.get("timeout", self.ctx.config.get("contact_timeout", 6.0)))
        self.allow(limit + 5.0)
        arming = self.ctx.contact.arm("contact_in_motion", limit, settings)
        self.await_pending(arming, "arming of the contact detector", 2.0)
        self._watches = True
        try:
            self.wait_for(partial(self._happened, ud.goal), "contact of an object with the hand", limit, code=CONTACT)
        except TimeLimit as error:
            error.code = error.code if error.code != ReasonCode.TIME_LIMIT else ReasonCode.NO_CONTACT
            raise
        finally:
            self._watches = False
            self.ctx.contact.disarm()

    def _happened(self, goal: dict[str, Any]) -> bool:
        if self.ctx.contact.event() is not None or self._caught:
            return True
        self._close_on_the_way(goal)
        if self._looks is not None:
            self._looks.look()
        if self._reached():
            now = self.ctx.clock.now()
            self._arrived = now if self._arrived is None else self._arrived
            self.ctx.journal.mark("motion_reached")
            self._leave_approach_profile()
            if not self._deeper and now - self._arrived >= float(self.ctx.config.get("handover.feel", 0.3)):
                self._go_on(goal)
        return False

    def _close_on_the_way(self, goal: dict[str, Any]) -> None:
        """The fingers need as long as the last of the way: a person lets go of what is light with the first touch, or
        with what they take for it. So they begin to close where the object is seen between them."""
        within = float(self.ctx.config.get("handover.close_within", 0.03))
        if (
            self.ctx.closing is not None
            or not self.ctx.preshaped
            or not 0.0 < self.ctx.arm.dmp_progress().remaining_distance < within
        ):
            return
        away = off_grasp(self, goal)
        if away is not None and away < within + BETWEEN:
            # From here on the person's object may be in the fingers, whatever becomes of the reach.
            self.ctx.shared, self.ctx.closing_on = True, target_of(goal)
            self.ctx.closing = self.ctx.hand.close_on_object()
            self.ctx.hand_track = HandTrack()
            self._looks = HandLook(self.ctx, self.ctx.hand_track)
            self.ctx.journal.mark("closing_on_the_way")

    def _go_on(self, goal: dict[str, Any]) -> None:
        """A tracker's error or a light touch: the hand goes on along the grasp's axis, as slowly as it has come."""
        self._deeper = True
        goal = self._watched.goal_now() if self._watched is not None else goal
        axis = np.array(goal.get("approach", np.zeros(3)))
        length = float(np.linalg.norm(axis))
        if length > 0.0:
            offset = np.array(goal["offset"]) + float(self.ctx.config.get("handover.deeper", 0.02)) / length * axis
            request = dmp_request({**goal, "offset": offset.tolist(), "approach": np.zeros(3).tolist()})
            try:
                self.await_pending(self.ctx.arm.execute_dmp(request), "the last of the way", 3.0)
                self.ctx.journal.mark("went_on")
            except TimeLimit:
                raise
            except PortError as error:
                self.reason = error.sentence  # it waits where it is

    def _slide_in(self, ud: Any) -> None:
        """Fingers touch the object on their way past it: closed there, they would hold it by its edge. The reach goes
        on until the palm is at its grasp, unless something stands in its way."""
        contact, settings = self.ctx.contact, self._contact_settings(ud)
        end = self.ctx.clock.now() + SLIDING / max(0.1, self.ctx.arm.speed_scale())
        try:
            while self.ctx.clock.now() < end and not self._reached():
                away, event = off_grasp(self, ud.goal), contact.event()
                if away is None or away <= SEATED or (event is not None and event.margin >= FIRM):
                    return
                if event is not None:
                    self.await_pending(contact.arm("contact_in_motion", 1.0, settings), "arming of the detector", 1.0)
                self.pause(0.02)
        finally:
            contact.disarm()

    def _found(self, event: ContactEvent | None) -> str:
        self.ctx.journal.mark("contact")
        felt = "the fingers hold it" if event is None else f"contact by {event.source}, margin {event.margin:.1f}"
        self.reason = (event.message if event is not None else "") or felt
        return "succeeded"

    def _await_reach(self, near: Callable[[], bool]) -> None:
        """Until ``near()``. How far and how long it is, the motion itself knows: it tells in its first feedback."""
        arm = self.ctx.arm
        try:
            self.wait_for(lambda: self._reached() or arm.dmp_progress().primitive_id != "", "news of the reach", 2.0)
            told = arm.dmp_progress()
            asked = told.remaining_time + reach_time(arm.motion_limits(), told.remaining_distance)
            limit = float(self.ctx.config.get("reach_timeout", 6.0)) + asked
            self.allow(limit + 10.0)
            self.wait_for(near, "the end of the reach", limit, arm.speed_scale, ARM)
        except TimeLimit as error:
            progress = arm.dmp_progress()
            error.causes = error.causes or (
                f"the motion is {progress.state} with {progress.remaining_distance:.2f} m "
                f"to go{': ' if progress.reason else ''}{progress.reason}",
            )
            raise

    def _leave_approach_profile(self) -> None:
        """Back to the rigid profile, and wait until what the compliant one added is gone: contact is found in forces,
        which an arm that yields to them would not show."""
        if self._left or not str(self.ctx.config.get("approach_profile", "")):
            return
        self._left = True
        self.await_pending(self.ctx.arm.apply_profile("dmp"), "feedback profile 'dmp'", 2.0)
        try:
            self.wait_for(lambda: self.ctx.arm.profile_settled("dmp").ok, "the end of the approach's compliance", 2.0)
        except TimeLimit as limit:
            limit.causes = (self.ctx.arm.profile_settled("dmp").why,)
            raise

    def _settings(self, ud: Any) -> dict[str, Any]:
        """What the object's entry says about contact."""
        entry = ud.object_entry
        return {**entry.get("contact", {}), "mass": float(entry.get("mass", 0.0))}

    def _contact_settings(self, ud: Any) -> dict[str, Any]:
        """The same for an object that comes into the hand, with its grasp, at which it is looked for."""
        return {**self._settings(ud), **ud.goal.get("object", {})}

    def _reached(self) -> bool:
        progress, watch = self.ctx.arm.dmp_progress(), self._watched
        if self._grip is not None:
            self._grip.look()
        left = progress.state == "aborted" and progress.code == ReasonCode.GOAL_LEFT_REGION
        if left and watch is not None:
            # It may have been believed so for a moment only, or is held still there.
            self._pause(watch, *(OUTSIDE if watch.predicted else LEFT))
            return False
        if progress.state == "aborted":
            why, code = progress.reason or "the controller gave no reason", progress.code
            if code == ReasonCode.GOAL_FELL and self._grip is not None:
                code = self._grip.fell_or_withdrawn()
                why = why if code == ReasonCode.GOAL_FELL else LOWERED
            raise TimeLimit("the reach was aborted", (why,), code)
        if not (blocked := self.ctx.arm.motion_allowed()).ok:
            raise TimeLimit("the arm does not follow any more", (blocked.why,), blocked.code)
        there = progress.state == "reached"
        # What falls or is taken back ends the reach at its place, too, but for what the fingers close on.
        if watch is not None and not (there and self.ctx.closing is not None) and watch.doubted() and not there:
            self._pause(watch, *watch.doubt())
        return there
