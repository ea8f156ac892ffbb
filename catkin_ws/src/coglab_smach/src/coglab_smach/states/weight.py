"""Taking an object from a person: the arm takes the weight; the person notices that and lets go."""

from __future__ import annotations

import math
from typing import Any

from coglab_msgs.msg import ReasonCode, Say

from coglab_smach.context.context import Context
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.hand_tracking import AT_HAND, AWAY, HandTrack, from_palm, hand_name, palm_at, sight_of
from coglab_smach.states.held_object import HeldObject
from coglab_smach.states.motion import await_rest, rise
from coglab_smach.states.yield_to_pull import LEAST_WAY, YieldToPull

GRAVITY = 9.81  # m/s^2
MOST_RISES = 8  # rises: the first one, and continuations after the weight or a pull has ended one

FOLLOWS = 0.25  # s, shortest time between two closing orders to the fingers
UNSEEN = 0.4  # s after the person's hand has gone: an unseen object then counts as still in the fingers
WITH_HAND = 0.2  # m, largest distance between the person's hand and an object that they have taken back
FALL_TIME = 0.4  # s, time in which a falling object gets far below its place
SEARCH_TIME = 0.4  # s after that, time in which the person's hand and the object are looked for
RECENT = 0.15  # s, oldest sight that counts in this search
SINKING = 3.0  # s, time limit for sinking with the object, and for rising again
SETTLING_TIME = 0.3  # s, pause before the torques of the resting arm are measured
SHARE_LIMIT = 1.0  # s, time limit for the contact detector to report the share of the weight
LIFTS = 0.8  # N, least load change that counts as "the person holds it": a soft hand (35 N/m) moved by 3 cm gives 1 N
IN_MOTION = 1.6  # N, largest difference between the weight measured in slow motion and at rest


def person_holds(state: CoglabState, settings: dict[str, Any]) -> bool | None:
    """True if the person holds the object. At rest the torque signal is too weak for light objects. Therefore, the arm
    sinks with the object and rises again. A person who holds it takes weight at the bottom and returns it at the top. A
    hand that is merely there, or a pull that has ended, does not. None if it is uncertain or cannot be measured.
    ``settings``: mass (kg) and load_share of the object. Only with controller 'ptp'."""
    contact, lift = state.ctx.contact, state.ctx.config.number("hand.lift")
    state.allow(2.0 * SINKING + 16.0)
    await_rest(state.ctx, state.check)
    try:
        watch = 2.0 * SINKING / max(0.1, state.ctx.arm.speed_scale()) + 10.0
        state.await_pending(contact.arm("release", watch, settings), "arming of the contact detector", 2.0)
        least = min(float(settings["load_share"]), LIFTS / (GRAVITY * float(settings["mass"])))
        before, top = _share_at_rest(state), palm_at(state.ctx)
        # Sink no longer than necessary to measure: otherwise the object presses on the person's hand.
        whole = _shifts(state, -lift, before + least + IN_MOTION / (GRAVITY * float(settings["mass"])))
        sunk, bottom = _share_at_rest(state), palm_at(state.ctx)
        if sunk - before < least:
            return False if whole and before < least else None
        _shifts(state, lift if top is None or bottom is None else max(LEAST_WAY, float(top[2] - bottom[2])))
        return True if sunk - _share_at_rest(state) >= 0.5 * least else None
    except PortError:
        # A dead detector, or one without data, finds nobody either.
        return None
    finally:
        contact.disarm()


def _shifts(state: CoglabState, up: float, enough: float = math.inf) -> bool:
    """Rise by ``up`` m (negative: sink) until the share ``enough`` of the weight has gone, and come to rest. Returns
    whether the arm has moved the whole way. PortError if it does not move."""
    ctx = state.ctx
    motion = rise(ctx, up, ctx.config.number("give.lower_speed"))
    if motion is None:
        raise PortError("the posture of the arm is not known")
    done = motion.done

    def over() -> bool:
        share = ctx.contact.share_gone()
        return done() or (share is not None and share >= enough)

    try:
        state.wait_for(over, "the motion with the object", SINKING, ctx.arm.speed_scale)
        if whole := done():
            motion.result()
    finally:
        if not done():
            motion.cancel()
    await_rest(ctx, state.check)
    return whole


def person_has_it(state: CoglabState, track: HandTrack, settings: dict[str, Any]) -> bool:
    """Like person_holds, but the person's hand must be at the object before and after."""

    def at_hand() -> bool:
        away = from_palm(state, track, 0.3)
        return away is not None and away <= AT_HAND

    return at_hand() and person_holds(state, settings) is True and at_hand()


def _share_at_rest(state: CoglabState) -> float:
    """Returns the share of the weight that has left the resting palm. TimeLimit if the detector does not report it."""
    shares: list[float] = []

    def has_come() -> bool:
        share = state.ctx.contact.share_gone()
        shares.extend([] if share is None else [share])
        return bool(shares)

    state.pause(SETTLING_TIME)
    state.wait_for(has_come, "the weight share from the contact detector", SHARE_LIMIT)
    return shares[0]


class TakeWeight(CoglabState):
    """Lift the object by at most ``hand.lift`` m until the person's hand has left it. A person who does not let go gets
    the object back if they really hold it.

    The rise stops when the arm carries ``hand.load_share`` of the weight. The person feels that and is informed; a
    further rise would pull gentle fingers along the object. But the weight is counted from the closing of the fingers,
    when a person often still presses. If they hold on for ``hand.lift_pause`` s, the arm rises by another
    ``hand.lift_step`` m, repeatedly.

    The person has let go when their hand has left its place at the object and the object has stayed. The place is
    ``hand_distance`` (m from the palm before the fingers closed), or the first sight at the object. If the hand is not
    seen, the arm must carry the weight at the end of the rise. If the hand was hidden on its way, the arm must carry
    the weight too, because the tracker may now see another hand. At the time limit, if the hand may have gone, the arm
    measures whether the person holds the object. If that is uncertain, nothing opens and the arm stays.

    The palm yields to a pull (YieldToPull), and the rise continues afterwards. The fingers close repeatedly with the
    lowest force (``give.close_speed``).
    """

    default_time_limit = 16.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(
            ctx,
            input_keys=["object_id", "object_entry", "hand_distance"],
            output_keys=["hand_seen_away"],
            io_keys=["grip"],
        )
        self._way: YieldToPull
        self._hand: HandTrack
        self._held: HeldObject
        self._reset()

    def _reset(self) -> None:
        """Reset for each object."""
        self._top: float | None = None  # m, target height of the palm
        self._rises = 0
        self._said = self._seen_away = False
        self._farther: float | None = None  # m from the palm beyond which the person's hand has left the object
        self._gone: float | None = None  # s, time when the hand left
        self._on: float | None = None  # s, time of the next rise with the weight; None: the arm does not carry it yet
        self._closing: Pending | None = None  # repeated closing order to the fingers
        self._closes = 0.0  # s, time of the next closing order

    def run(self, ud: Any) -> str:
        limit, contact = self.ctx.config.number("hand.load_timeout"), self.ctx.contact
        end = self.ctx.clock.now() + limit
        self._hand, self._held = ud.grip.hand, HeldObject(self.ctx, ud.object_id, ud.grip)
        self._reset()
        self._count_from(ud.hand_distance)
        settings = {
            "mass": float(ud.object_entry.get("mass", 0.0)),
            "load_share": self.ctx.config.number("hand.load_share"),
        }
        self._way = YieldToPull(self.ctx)
        self.await_pending(contact.arm("lift", limit, settings), "arming of the contact detector", 2.0)
        try:
            self.pause(self.ctx.config.number("hand.lift_after"))
            self._rise()
            self.wait_for(
                self._has_let_go,
                "the person's letting go",
                end - self.ctx.clock.now(),
                code=ReasonCode.WAITS_FOR_PERSON,
            )
        except TimeLimit as error:
            if error.code != ReasonCode.TIME_LIMIT:
                raise
            if not self._is_left(settings):
                raise self._not_released(ud.object_id, limit, error, settings) from None
        except PortError as error:
            raise self._taken_back(ud.object_id, error) from None
        finally:
            contact.disarm()
            self._way.stop()
            if self._closing is not None:  # fingers that continue to close would squeeze out the object
                self._closing.cancel()
        event = contact.event()
        self.reason = event.message if event is not None else "the person's hand has left it"
        ud.grip.shared, ud.hand_seen_away = False, self._seen_away
        self._say_i_have_it()
        self.ctx.journal.mark("released")
        return "succeeded"

    def _count_from(self, distance: float | None) -> None:
        """Set the reference distance (m) of the person's hand from the palm. A hand that is not at the object does not
        count: it has already left, or is another one."""
        if distance is not None and distance <= AT_HAND:
            self._farther = distance + self.ctx.config.number("hand.let_go")

    def _has_let_go(self) -> bool:
        """True if the person has let go. Until then: rise until the arm carries the weight, or yield."""
        carried = self.ctx.contact.event() is not None
        if not (blocked := self.ctx.arm.motion_allowed()).ok:
            raise TimeLimit("the arm does not follow any more", (blocked.why,), blocked.code)
        self._held.check()
        self._follow()
        if carried:
            self.ctx.journal.mark("loaded")
            self._say_i_have_it()
        # Before and after from_palm(), which waits for a sight.
        self._way.follow()
        away = from_palm(self, self._hand)
        if self._farther is None:
            self._count_from(away)
        if self._has_gone(away, carried):
            # The other one of two hands may hold on while the first is seen to leave.
            self._seen_away = self._hand.is_sure and carried
            return True
        self._way.follow()
        if self._farther is None or not carried:
            if not carried and self._way.idle():
                self._rise()
            return carried and self._way.idle()
        self._rise_on()
        return False

    def _has_gone(self, away: float | None, carried: bool) -> bool:
        """True if the person's hand, ``away`` m from the palm, has left the object and the object has stayed. If the
        hand was not tracked all the way, the weight must be ``carried`` too."""
        gone = away is not None and away > (AWAY if self._farther is None else self._farther)
        if away is None or not gone or not (carried or self._hand.is_sure):
            self._gone = None
            return False
        now = self.ctx.clock.now()
        self._gone = now if self._gone is None else self._gone
        if self._held.stays(self._gone):
            return True
        hidden = now - self._gone >= UNSEEN and not self._held.moved
        return self._held.there() and (away > AT_HAND or hidden)

    def _rise_on(self) -> None:
        """Rise with the weight, in steps, while the person holds on."""
        now = self.ctx.clock.now()
        if self._on is None:
            self._way.halt("the weight has come")
            self._on = now + self.ctx.config.number("hand.lift_pause")
        elif now >= self._on and self._way.idle():
            step, speed = (self.ctx.config.number(f"hand.{name}") for name in ("lift_step", "lift_speed"))
            self._on = now + step / speed + self.ctx.config.number("hand.lift_pause")
            self._rise(step)

    def _follow(self) -> None:
        """Close repeatedly with the lowest force: when the person lets go, the object shifts between the fingers."""
        now = self.ctx.clock.now()
        if now >= self._closes and (self._closing is None or self._closing.done()):
            self._closes = now + FOLLOWS
            self._closing = self.ctx.hand.close(self.ctx.config.get("give.close_speed"))

    def _say_i_have_it(self) -> None:
        """Inform the person once that the robot carries the object."""
        if not self._said:
            self._said = True
            self.ctx.say(Say.I_HAVE_IT, "I have it.")

    def _rise(self, most: float = math.inf) -> None:
        """Rise by at most ``most`` m, up to the target height of the first rise."""
        palm, speed = palm_at(self.ctx), self.ctx.config.number("hand.lift_speed")
        if palm is None or self._rises >= MOST_RISES:
            return
        if self._rises == 0:
            self._top = float(palm[2]) + self.ctx.config.number("hand.lift")
        assert self._top is not None
        left = min(most, self._top - float(palm[2]))
        if left > LEAST_WAY:
            self._rises += 1
            self._way.begin(rise(self.ctx, left, speed))

    def _taken_back(self, object_id: str, error: PortError) -> PortError:
        """Returns the failure: "taken back" if the object has moved away with the person's hand."""
        if error.code == ReasonCode.OBJECT_NOT_SEEN and not self.ctx.holding:
            self._way.stop()
            self.pause(FALL_TIME)
            end = self.ctx.clock.now() + SEARCH_TIME
            while self.ctx.clock.now() < end:
                hand, thing = sight_of(self, hand_name(self.ctx)), sight_of(self, object_id)
                if hand is not None and thing is not None and max(hand.age, thing.age) <= RECENT:
                    if math.dist(hand.xyz, thing.xyz) >= WITH_HAND:
                        break
                    causes = (error.sentence, *error.causes)
                    return PortError(f"the person took '{object_id}' back", causes, ReasonCode.GOAL_WITHDRAWN)
                self.pause(RECENT / 3)
        return error

    def _is_left(self, settings: dict[str, Any]) -> bool:
        """True if nobody holds the object, and a hand is seen far from it or (with the weight carried) none is seen."""
        self._way.stop()
        away, loaded = from_palm(self, self._hand, 0.3), self.ctx.contact.event() is not None
        gone = loaded if away is None else away > (AT_HAND if loaded else AWAY)
        return gone and person_holds(self, settings) is False

    def _not_released(self, object_id: str, limit: float, error: TimeLimit, settings: dict[str, Any]) -> PortError:
        """Returns the failure. A person who holds the object gets it; otherwise the robot keeps it."""
        causes: tuple[str, ...] = (error.sentence,)
        loaded, away = self.ctx.journal.marked("loaded"), from_palm(self, self._hand)
        if person_has_it(self, self._hand, settings):
            self.ctx.holding = ""
        else:
            carried = "its weight is carried" if loaded else "its weight has not come"
            where = "seen elsewhere" if away is not None and away > AT_HAND else "there, and does not hold it"
            causes += (f"{carried}, and the person's hand is {'not seen any more' if away is None else where}",)
        return PortError(
            f"the person did not let go of '{object_id}' within {limit:.0f} s", causes, ReasonCode.NOT_RELEASED
        )
