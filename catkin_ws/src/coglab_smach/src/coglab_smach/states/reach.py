"""A reach: starting the motion, waiting for its end or for an object in the hand, and stopping it for a person."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.kinematics.motion_time import reach_time
from coglab_smach.ports.interfaces import ContactEvent, DmpProgress, DmpRequest
from coglab_smach.ports.pending import PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.hand_tracking import (
    GLANCE,
    HandLook,
    HandoverRegion,
    Sight,
    anything_believed,
    ends_outside,
    hand_name,
    jumped_from,
    off_grasp,
    palm_at,
    palm_axis,
    sight_of,
    sight_or_refusal,
)
from coglab_smach.states.motion import shift, shift_time

BUMPS = 2  # touches of other things after which the arm still tries again
RETREAT = 0.06  # m, retreat of the hand after such a touch
RETREAT_SPEED = 0.1  # m/s
RETREAT_TIMEOUT = 5.0  # s, added to the planned duration of the retreat
NEAR_GRASP = 0.03  # m, largest distance from the grasp at which the fingers may close at a touch
FIRM = 2.5  # margin of a contact that is more than brushing past
BETWEEN = 0.01  # m, added to ``handover.close_within``: an object within this distance is between the fingers
NEWS = 0.02  # s after which the arm reports a started motion
CAUGHT = 1.0  # s, time limit for fingers that closed on the way to stop on an object
SLIDING = 0.6  # s, limit for moving on to the grasp after a touch, at full speed scale

PERIOD = 0.03  # s between two looks at the target of the reach
DOUBT_TIME = 0.2  # s without belief before a reach pauses; after a gap in the sights, belief returns within this time
BACKWARD = 0.6  # share of the allowed retreat at which the arm waits to see whether the hand goes back
SLIPPED = 0.06  # m by which an object that has left the person's hand has sunk relative to it
TOGETHER = 0.05  # s, largest time between sights of hand and object that are compared
LOOK = 0.4  # s for which hand and object are compared

OUTSIDE = (int(ReasonCode.GOAL_AHEAD_OUTSIDE), "the person's reach seems to end outside the handover region")
LEFT = (int(ReasonCode.GOAL_LEFT_REGION), "it is outside the handover region")
LOWERED = "it was lowered with the hand that holds it"


def dmp_request(goal: dict[str, Any], primitive: str | None = None, ratio: float | None = None) -> DmpRequest:
    """Converts a goal from user data to a request."""
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
    """Start a reach. If the tracker has lost the goal, try again for ``goal_lost_time`` s, as in a running motion."""
    ctx = state.ctx
    end = ctx.clock.now() + ctx.config.number("goal_lost_time")
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


def target_of(goal: Mapping[str, Any]) -> str:
    """Returns perception's name of the object or the person's hand that a reach is for; '' for a place."""
    return str(goal["frame"]).removesuffix("_ahead").removeprefix("object_")


class ExecuteDmp(CoglabState):
    """Start the motion and end at once; wait_stop follows. The controller manager closes the loop."""

    default_time_limit = 5.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["goal"])

    def run(self, ud: Any) -> str:
        request = dmp_request(ud.goal)
        profile = self.ctx.config.text("approach_profile")
        if profile:
            self.await_pending(self.ctx.arm.apply_profile(profile), f"feedback profile '{profile}'", 2.0)
        start(self, request)
        self.ctx.journal.mark("motion_started")
        self.reason = f"primitive '{request.primitive_id}' toward {request.goal_frame}"
        return "succeeded"


class WaitStop(CoglabState):
    """wait_stop: wait for the end of the reach. Time limit: ``reach_timeout`` plus the duration from the primitive and
    the arm's limits."""

    default_time_limit = 20.0
    owns_motion = True

    def run(self, ud: Any) -> str:
        self.await_reach(self.arrived)
        self.ctx.journal.mark("motion_reached")
        return "succeeded"

    def arrived(self) -> bool:
        """True if the motion has reached its goal. TimeLimit if it has failed."""
        return self.has_reached(self.ctx.arm.dmp_progress())

    def has_reached(self, progress: DmpProgress) -> bool:
        """The same as arrived(), for a given progress."""
        if progress.state == "aborted":
            why = progress.reason or "the controller gave no reason"
            raise TimeLimit("the reach was aborted", (why,), progress.code)
        if not (blocked := self.ctx.arm.motion_allowed()).ok:
            raise TimeLimit("the arm does not follow any more", (blocked.why,), blocked.code)
        return progress.state == "reached"

    def await_reach(self, near: Callable[[], bool]) -> None:
        """Wait until ``near()``. The time limit is computed from the first feedback of the motion."""
        arm = self.ctx.arm
        try:
            self.wait_for(lambda: self.arrived() or arm.dmp_progress().primitive_id != "", "the reach's start", 2.0)
            begun = arm.dmp_progress()
            asked = begun.remaining_time + reach_time(arm.motion_limits(), begun.remaining_distance)
            limit = self.ctx.config.number("reach_timeout") + asked
            self.allow(limit + 10.0)
            self.wait_for(near, "the end of the reach", limit, arm.speed_scale, ReasonCode.WAITS_FOR_ARM)
        except TimeLimit as error:
            progress = arm.dmp_progress()
            error.causes = error.causes or (
                f"the motion is {progress.state} with {progress.remaining_distance:.2f} m "
                f"to go{': ' if progress.reason else ''}{progress.reason}",
            )
            raise

    def leave_approach_profile(self) -> None:
        """Return to the rigid profile, and wait until the correction of the compliant one has faded: contact is
        detected in forces, which a compliant arm would hide."""
        if not self.ctx.config.text("approach_profile"):
            return
        self.await_pending(self.ctx.arm.apply_profile("dmp"), "feedback profile 'dmp'", 2.0)
        try:
            self.wait_for(lambda: self.ctx.arm.profile_settled("dmp").ok, "the end of the approach's compliance", 2.0)
        except TimeLimit as limit:
            limit.causes = (self.ctx.arm.profile_settled("dmp").why,)
            raise


class WaitForPerson(WaitStop):
    """A reach for an object that a person offers, or for their hand. If nobody seems to offer or request any more, the
    arm pauses and stands. It continues if the person continues within ``handover.pause`` s, else it
    gives up."""

    def __init__(self, ctx: Context, keys: Sequence[str]) -> None:
        super().__init__(ctx, input_keys=keys, io_keys=["grip"])
        self._grip = Grip()
        self._watch: ReachWatch | None = None
        self._persons_grip: PersonsGrip | None = None

    def watch_person(self, goal: dict[str, Any], target: str = "") -> None:
        """Watch the person from now on. ``target``: the object that the person holds."""
        self._persons_grip = PersonsGrip(self, target) if target else None
        self._watch = ReachWatch(self, goal, self._persons_grip, self._closes) if "watch" in goal else None

    def has_reached(self, progress: DmpProgress) -> bool:
        watch, grip = self._watch, self._persons_grip
        if grip is not None:
            grip.look()
        if progress.state == "aborted":
            if progress.code == ReasonCode.GOAL_LEFT_REGION and watch is not None:
                # The belief may have been wrong for a moment, or the object is held still there.
                self._paused_for_person(watch, *(OUTSIDE if watch.predicted else LEFT))
                return False
            if progress.code == ReasonCode.GOAL_FELL and grip is not None:
                code = grip.fell_or_withdrawn()
                why = progress.reason if code == ReasonCode.GOAL_FELL else LOWERED
                raise TimeLimit("the reach was aborted", (why or "the controller gave no reason",), code)
        there = super().has_reached(progress)
        # Falling or taking back also ends a reach at its goal, unless the fingers close on the object.
        if watch is not None and not (there and self._closes()) and watch.doubted() and not there:
            self._paused_for_person(watch, *watch.doubt())
        return there

    def _paused_for_person(self, watch: ReachWatch, code: int, why: str) -> None:
        """Pause for the person; possible in every phase. ``code``, ``why``: the reason if the arm gives up."""
        limit = self.ctx.config.number("handover.pause")
        self.allow(limit + 8.0)
        resting = self.ctx.arm.cancel_motion("the arm waits: nobody offers or requests")
        self.await_pending(resting, "rest of the arm", 3.0, code=ReasonCode.WAITS_FOR_ARM)
        self.ctx.journal.mark("paused")
        try:
            self.wait_for(
                watch.hopeful, "a new offer or request of the person", limit, code=ReasonCode.WAITS_FOR_PERSON
            )
        except TimeLimit as error:
            if error.code != ReasonCode.TIME_LIMIT:
                raise
            raise TimeLimit("the reach was given up", (why,), code) from None
        if self._has_it():
            return
        self._open_again()
        watch.forgive()
        self._begin_again(watch.goal_now())

    def _closes(self) -> bool:
        """True if the fingers close on the object."""
        return False

    def _has_it(self) -> bool:
        """True if the object has come into the hand during a pause."""
        return False

    def _open_again(self) -> None:
        """Open fingers that have started to close."""

    def _begin_again(self, goal: dict[str, Any]) -> None:
        """Start the reach again. A target that is now in a forbidden place has fallen, or was taken there."""
        try:
            start(self, dmp_request(goal))
            self.pause(NEWS)  # until then the arm reports the end of the previous motion
        except PortError as error:
            if error.code != ReasonCode.GOAL_OUTSIDE_WORKSPACE or self._persons_grip is None:
                raise
            code = self._persons_grip.fell_or_withdrawn()
            raise TimeLimit("the reach was given up", (error.sentence,), code) from None


class Phase(Enum):
    """Phases of WaitContact; each ends with the next phase. The reach can pause in any of them (WaitForPerson)."""

    REACH = "the hand goes to the object"
    NEAR_GOAL = "contact is watched for, the fingers may start to close, and a hand without contact moves on"
    TOUCHED = "the hand slides on to the grasp, if it has brushed the object on its way past"
    BUMPED = "something else was touched: retreat and reach again"
    HELD = "the object is between the fingers"


class WaitContact(WaitForPerson):
    """Wait until the offered object is in the hand: during the reach, at its end, or when the person brings it to the
    waiting arm. Contact is detected within the last ``contact_within`` m of the reach. A touch while the object is
    elsewhere is a touch of something else."""

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, ["object_entry", "goal", "grasp"])
        self._goal: dict[str, Any] = {}
        self._hand: dict[str, Any] = {}  # hand settings of the grasp
        self._contact_settings: dict[str, Any] = {}  # from the object's entry, and the place where the object is sought
        self._reset()

    def _reset(self) -> None:
        """Reset for each reach."""
        self._phase = Phase.REACH
        self._bumps = 0
        self._arrived: float | None = None  # s, time of the first arrival at the goal
        self._went_on = False  # the hand has moved on from the goal
        self._caught = False  # the fingers have closed on something while the arm paused
        self._look: HandLook | None = None  # follows the person's hand, once the fingers have started to close

    def run(self, ud: Any) -> str:
        entry = ud.object_entry
        self._grip, self._goal, self._hand = ud.grip, ud.goal, ud.grasp["hand"]
        mass = float(entry.get("mass", 0.0))
        self._contact_settings = {**entry.get("contact", {}), "mass": mass, **ud.goal.get("object", {})}
        self._reset()
        target = target_of(ud.goal)
        self._grip.reach_for(target, mass, int(self._hand.get("firm", 0)))
        self.watch_person(ud.goal, target)
        phases = {
            Phase.REACH: self._reach,
            Phase.NEAR_GOAL: self._near_goal,
            Phase.TOUCHED: self._touched,
            Phase.BUMPED: self._bumped,
        }
        try:
            while self._phase is not Phase.HELD:
                self._phase = phases[self._phase]()
        except Interrupted:
            # STOP or the end of the action: stop fingers that close on a person's object at once.
            self._grip.stop()
            raise
        return "succeeded"

    def _reach(self) -> Phase:
        within = self.ctx.config.number("contact_within")
        self.await_reach(lambda: self.arrived() or self._is_within(within))
        return Phase.NEAR_GOAL

    def _is_within(self, distance: float) -> bool:
        return 0.0 < self.ctx.arm.dmp_progress().remaining_distance < distance

    def _near_goal(self) -> Phase:
        settings = self._contact_settings
        limit = float(settings.get("timeout", self.ctx.config.get("contact_timeout")))
        self.allow(limit + 5.0)
        arming = self.ctx.contact.arm("contact_in_motion", limit, settings)
        self.await_pending(arming, "arming of the contact detector", 2.0)
        try:
            self.wait_for(
                self._feels_something, "contact of an object with the hand", limit, code=ReasonCode.WAITS_FOR_CONTACT
            )
        except TimeLimit as error:
            error.code = error.code if error.code != ReasonCode.TIME_LIMIT else ReasonCode.NO_CONTACT
            raise
        finally:
            self.ctx.contact.disarm()
        return Phase.TOUCHED

    def _feels_something(self) -> bool:
        if self.ctx.contact.event() is not None or self._caught:
            return True
        self._close_on_the_way()
        if self._look is not None:
            self._look.look()
        if self.arrived():
            now = self.ctx.clock.now()
            if self._arrived is None:
                self._arrived = now
                self.ctx.journal.mark("motion_reached")
                self.leave_approach_profile()
            if not self._went_on and now - self._arrived >= self.ctx.config.number("handover.feel"):
                self._go_on()
        return False

    def _close_on_the_way(self) -> None:
        """Closing takes as long as the last part of the path, and people release a light object at the first touch.
        Therefore, the fingers start to close as soon as the object is seen between them."""
        grip, within = self._grip, self.ctx.config.number("handover.close_within")
        if grip.closing is not None or not grip.preshaped or not self._is_within(within):
            return
        away = off_grasp(self, self._goal)
        if away is not None and away < within + BETWEEN:
            grip.close(self.ctx.hand)
            self._look = HandLook(self.ctx, grip.hand)
            self.ctx.journal.mark("closing_on_the_way")

    def _go_on(self) -> None:
        """No contact at the goal: tracker error, or a light touch. The hand moves on along the grasp's axis."""
        self._went_on = True
        goal = self._watch.goal_now() if self._watch is not None else self._goal
        axis = np.array(goal.get("approach", np.zeros(3)))
        length = float(np.linalg.norm(axis))
        if length > 0.0:
            offset = np.array(goal["offset"]) + self.ctx.config.number("handover.deeper") / length * axis
            request = dmp_request({**goal, "offset": offset.tolist(), "approach": np.zeros(3).tolist()})
            try:
                self.await_pending(self.ctx.arm.execute_dmp(request), "the rest of the way", 3.0)
                self.ctx.journal.mark("went_on")
            except TimeLimit:
                raise
            except PortError as error:
                self.reason = error.sentence  # the arm waits at the goal

    def _touched(self) -> Phase:
        away, event = off_grasp(self, self._goal), self.ctx.contact.event()
        if away is not None and away >= self.ctx.config.number("contact_near"):
            self.ctx.journal.mark("bumped")
            if self._bumps == BUMPS:
                raise PortError(
                    f"something touches the hand, and the object is {away:.2f} m from where it would be held",
                    ("something is in the way, or somebody pushes the arm",),
                    ReasonCode.NO_CONTACT,
                )
            return Phase.BUMPED
        if event is not None and away is not None and away > NEAR_GRASP and event.margin < FIRM:
            self._slide_in()
        self._report_contact(event)
        return Phase.HELD

    def _report_contact(self, event: ContactEvent | None) -> None:
        self.ctx.journal.mark("contact")
        felt = "the fingers hold it" if event is None else f"contact by {event.source}, margin {event.margin:.1f}"
        self.reason = (event.message if event is not None else "") or felt

    def _slide_in(self) -> None:
        """Fingers that close while they brush past an object would hold its edge. Continue the reach until the palm is
        at its grasp, unless something blocks it."""
        contact = self.ctx.contact
        end = self.ctx.clock.now() + SLIDING / max(0.1, self.ctx.arm.speed_scale())
        try:
            while self.ctx.clock.now() < end and not self.arrived():
                away, event = off_grasp(self, self._goal), contact.event()
                if away is None or away <= NEAR_GRASP or (event is not None and event.margin >= FIRM):
                    return
                if event is not None:
                    arming = contact.arm("contact_in_motion", 1.0, self._contact_settings)
                    self.await_pending(arming, "arming of the detector", 1.0)
                self.pause(0.02)
        finally:
            contact.disarm()

    def _bumped(self) -> Phase:
        """Retreat against the palm's outward axis with the hand open, and start the reach again."""
        arm = self.ctx.arm
        self._bumps += 1
        self.allow(20.0)
        # Stop the arm first: a motion that starts while the arm moves inherits its speed and brakes later.
        self.await_pending(
            arm.cancel_motion("something touches the hand"), "rest of the arm", 3.0, code=ReasonCode.WAITS_FOR_ARM
        )
        self.await_pending(arm.switch_controller("ptp"), "switching to 'ptp'", 3.0)
        self._open_again()
        outward = palm_axis(self.ctx)
        if outward is not None:
            limit = RETREAT_TIMEOUT + shift_time(self.ctx, -RETREAT * outward, RETREAT_SPEED)
            self.allow(limit + 10.0)
            motion = shift(self.ctx, -RETREAT * outward, RETREAT_SPEED)
            if motion is not None:
                try:
                    self.await_pending(motion, "drawing back", limit, arm.speed_scale, ReasonCode.WAITS_FOR_ARM)
                except PortError as error:
                    self.reason = error.sentence  # an incomplete retreat is enough
        self.await_pending(arm.switch_controller("dmp"), "switching to controller 'dmp'", 3.0)
        watch = self._watch
        if watch is None:
            self._begin_again(self._goal)
        elif watch.hopeful():
            watch.forgive()
            # The prediction is only valid until the end of the person's reach.
            self._begin_again(watch.goal_now())
        else:
            self._paused_for_person(watch, *watch.doubt())
        return Phase.REACH

    def _closes(self) -> bool:
        return self._grip.closing is not None

    def _has_it(self) -> bool:
        if self._phase is Phase.NEAR_GOAL and self.ctx.contact.event() is not None:
            return True  # an object has come into the standing hand
        self._caught = self._has_caught()
        return self._caught

    def _has_caught(self) -> bool:
        """True if fingers that closed on the way hold an object. Then they do not open when a person is merely seen."""
        closing, hand = self._grip.closing, self.ctx.hand
        if closing is None:
            return False
        end = self.ctx.clock.now() + CAUGHT
        # The hand reports its grip shortly after the end of the closing order.
        while not (closing.done() and hand.state().holding) and self.ctx.clock.now() < end:
            self.pause(NEWS)
        return hand.state().holding

    def _open_again(self) -> None:
        """Open fingers that have started to close: otherwise the hand would arrive as a fist."""
        self._caught = False
        closing, self._look = self._grip.take_closing(), None
        if closing is None:
            return
        closing.cancel()
        opening = self.ctx.hand.preshape(self._hand["mode"], self._hand["level"])
        self.await_pending(opening, "the hand's opening", 5.0, code=ReasonCode.WAITS_FOR_HAND)
        self._grip.shared = False


class PersonsGrip:
    """Distinguishes a falling object from one that is lowered fast: is the person's hand still at it?"""

    def __init__(self, state: CoglabState, target: str) -> None:
        self._state, self._target = state, target
        self._at_first: float | None = None
        self.look()

    def look(self) -> None:
        """Measure the distance of hand and object before a fall, once both are seen at the same time."""
        if self._at_first is None:
            self._at_first = self._apart()

    def _apart(self) -> float | None:
        """Returns the height (m) of the person's hand above the object. None unless the two sights are at most TOGETHER
        apart: otherwise a fast hand would seem apart from its object."""
        at, thing = sight_of(self._state, hand_name(self._state.ctx)), sight_of(self._state, self._target)
        if at is None or thing is None or abs(at.age - thing.age) > TOGETHER:
            return None
        return float(at.xyz[2] - thing.xyz[2])

    def fell_or_withdrawn(self) -> int:
        """Returns the ReasonCode of an object that has moved down. A fallen object is soon far below the hand; a
        lowered one seems so only for one or two sights."""
        clock, found = self._state.ctx.clock, []
        end = clock.now() + LOOK
        while clock.now() < end:
            apart = self._apart()
            found += [] if apart is None else [apart]
            self._state.pause(PERIOD)
        if self._at_first is None or not found or float(np.median(found)) > self._at_first + SLIPPED:
            return int(ReasonCode.GOAL_FELL)
        return int(ReasonCode.GOAL_WITHDRAWN)


class ReachWatch:
    """Watches the target of a reach: an offered object or the person's hand. It must not go back or fall
    (cc.GoalLimits, as in the controller, but over several motions). It must be seen, or predicted, in the handover
    region. And somebody must continue to offer it."""

    def __init__(
        self,
        state: CoglabState,
        goal: Mapping[str, Any],
        grip: PersonsGrip | None,
        closes: Callable[[], bool] = lambda: False,
    ) -> None:
        """``grip``: the person's grip on the target. ``closes``: returns whether the robot's fingers close on it."""
        self.state, self.goal, self.limits, self.may = state, goal, goal["limits"], goal["watch"]
        self._closes = closes
        self.target, self._grip = target_of(goal), grip
        self._frame = str(goal["frame"]).removesuffix("_ahead")
        self.predicted = self._began_on_belief = self._frame != goal["frame"]
        """True if the arm moves to the predicted place of the target, not to the seen one"""
        self._watch: cc.GoalLimits | None = None
        self._sure = state.ctx.clock.now()  # s, time of the last belief
        self._looked = self._sure - PERIOD
        self._last: Sight | None = None  # newest sight without a jump
        self._from: np.ndarray | None = None  # m, position of the palm at the start of the reach
        self._nearest, self._back = np.inf, 0.0
        """nearest: m, smallest distance of the target from there; back: m by which the target has gone back since"""
        self._hand: cc.GoalLimits | None = None  # watches the person's hand, for a hidden object
        self._hand_last: Sight | None = None  # newest sight of the hand without a jump
        self._seen_at = 0.0  # s, time of the newest sight of the target
        self._region = HandoverRegion(state.ctx, self.may["margin"])
        self._outside: tuple[int, str] | None = None
        """ReasonCode and sentence of an offer or request outside the region"""
        self._untold: PortError | None = None  # reason why perception cannot identify the hand at the target

    def doubt(self) -> tuple[int, str]:
        """Returns ReasonCode and sentence of the doubt."""
        if self._outside is not None:
            return self._outside
        if self._untold is not None:
            return int(ReasonCode.NOT_PERCEIVED), self._untold.sentence
        return int(ReasonCode.GOAL_WITHDRAWN), "the person does not offer or request any more"

    def doubted(self) -> bool:
        """Returns True if nobody has offered or requested for DOUBT_TIME, or if the target goes back. TimeLimit, which
        ends the reach, if the target went back too far or fell."""
        now = self.state.ctx.clock.now()
        if now - self._looked >= PERIOD and self.hopeful():
            self._sure = now
        return now - self._sure > DOUBT_TIME or self._goes_back()

    def _goes_back(self) -> bool:
        return self._back > BACKWARD * self.may["retreat"] > 0.0

    def hopeful(self) -> bool:
        """True if somebody offers or requests now within the region, believed or seen. TimeLimit as in doubted()."""
        ctx = self.state.ctx
        now = ctx.clock.now()
        passed, self._looked = max(0.0, now - self._looked), now
        place = self._look()
        if place is not None:
            self._follow(place, passed)
        self._follow_hand(passed, hidden=place is None)
        held = place is not None and self._region.offers(self._seen_at, place, moving=False)
        if self._goes_back() and held:
            # The target is offered there: from now on, it may go back by less.
            self._nearest, self._back = self._nearest + self._back, 0.0
        if self._goes_back():
            return False
        hope, outside = anything_believed(ctx), ends_outside(ctx, self._region, self._frame)
        # A target that passes through the region on its way out is not offered.
        offered = held or (place is not None and not outside and self._region.holds(place))
        if not offered and not outside:
            # If the reach began on a belief and the belief is gone, a hidden target may have been taken back.
            hidden = place is None and (hope or not self._began_on_belief)
            ahead = self._began_on_belief and hope and ctx.perception.ahead().frame == self.goal["frame"]
            offered = hidden or ahead
        self._outside = None
        if not offered and place is not None:
            self._outside = OUTSIDE if outside else None if self._region.holds(place) else LEFT
        elif outside:
            self._outside = OUTSIDE
        return offered

    def goal_now(self) -> dict[str, Any]:
        """Returns the goal: at the predicted place while it is believed, else at the seen one."""
        ahead = self.state.ctx.perception.ahead()
        self.predicted = ahead.frame == self.goal["frame"] and self._region.holds(ahead.place)
        if self.predicted:
            return dict(self.goal)
        watched = {"goal_retreat": self.may["retreat"], "goal_drop": self.may["drop"]}
        limits = self.limits if self._last is None else self._region.limits(self._last[1])
        return {**self.goal, "frame": self._frame, "limits": {**limits, **watched}}

    def forgive(self) -> None:
        """End the doubt."""
        self._sure = self.state.ctx.clock.now()

    def _look(self) -> np.ndarray | None:
        """Returns the seen position (m) of the target. None if it is not seen: a hand that goes back may hide it."""
        seen = sight_or_refusal(self.state, self.target, GLANCE)
        self._untold = None
        if isinstance(seen, PortError):
            self._untold = seen if seen.code == ReasonCode.NOT_PERCEIVED else None
            return None
        if seen is None:
            return None
        self._seen_at = self.state.ctx.clock.now() - seen.age
        return np.array(seen.xyz)

    def _follow_hand(self, passed: float, hidden: bool) -> None:
        """A hand that takes an object back may hide it. A hand that leaves while the fingers close has let go."""
        if self._grip is None or self._from is None:
            return
        seen = sight_of(self.state, hand_name(self.state.ctx), GLANCE)
        if seen is None:
            return
        place = np.array(seen.xyz)
        jumped, self._hand_last = jumped_from(self._hand_last, self.state.ctx.clock.now(), place)
        if jumped:
            return
        if self._hand is None:
            nowhere = np.zeros(3)
            self._hand = cc.GoalLimits(nowhere, nowhere, self.may["retreat"], 0.0, self._from, place)
        code, sentence = self._hand.update(passed, place)
        if code and hidden and not self._closes():
            raise TimeLimit(f"the reach was given up: the hand that hides the object moved ({sentence})", (), code)

    def _follow(self, place: np.ndarray, passed: float) -> None:
        jumped, self._last = jumped_from(self._last, self.state.ctx.clock.now(), place)
        if jumped:
            return
        if self._watch is None or self._from is None:
            palm = self._from = palm_at(self.state.ctx)
            if palm is not None:
                nowhere = np.zeros(3)
                self._watch = cc.GoalLimits(nowhere, nowhere, self.may["retreat"], self.may["drop"], palm, place)
            return
        distance = float(np.linalg.norm(place - self._from))
        self._nearest = min(self._nearest, distance)
        self._back = distance - self._nearest
        code, sentence = self._watch.update(passed, place)
        if code == ReasonCode.GOAL_FELL and self._grip is not None:
            # The arm stops while this is decided.
            resting = self.state.ctx.arm.cancel_motion(sentence)
            self.state.await_pending(resting, "rest of the arm", 3.0, code=ReasonCode.WAITS_FOR_ARM)
            code = self._grip.fell_or_withdrawn()
            sentence = sentence if code == ReasonCode.GOAL_FELL else LOWERED
        if code:
            raise TimeLimit(f"the reach was given up: {sentence}", (), code)
