"""Taking an object over from a person: the arm takes the weight, the person feels that and lets go."""

from __future__ import annotations

import math
from typing import Any

from coglab_msgs.msg import ReasonCode, Say

from coglab_smach.context.context import Context
from coglab_smach.context.wait_reasons import PERSON
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.hand_tracking import AT_HAND, AWAY, HandTrack, from_palm, hand_name, palm_at, sight_of
from coglab_smach.states.held_object import HeldObject
from coglab_smach.states.motion import await_rest, rise
from coglab_smach.states.yield_to_pull import LEAST_WAY, YieldToPull

GRAVITY = 9.81
MOST_RISES = 8  # the first one, and those that go on where the weight or somebody's pull has ended one

FOLLOWS = 0.25  # s from one closing of the fingers to the next at least
UNSEEN = 0.4  # s after the person's hand has gone, when an object that nobody sees has stayed in the fingers
WITH_HAND = 0.2  # m between the person's hand and an object that they have taken along, at most
FALLS = 0.4  # s after which a falling object is far below where it was lost, and for which it is looked for then
RECENT = 0.15  # s, oldest sight that counts there
SINKING = 3.0  # s in which the arm has sunk with the object, or is back
SETTLES = 0.3  # s before and after, for torques at rest
TELLS = 1.0  # s in which the contact detector tells the share of the weight, once it is armed
LIFTS = 0.8  # N, least load change that counts as "the person holds it": a soft hand (35 N/m) moved by 3 cm gives 1 N
IN_MOTION = 1.6  # N by which the weight that a slow arm tells differs from what it tells at rest, at most


def person_holds(state: CoglabState, settings: dict[str, Any]) -> bool | None:
    """True if the person holds the object. At rest the torque signal is too weak for light objects, so the arm sinks
    with it and rises again: a person who holds it takes weight below and gives it back above, a hand that is merely
    there or a pull that has ended does not. None if it is not sure, or cannot be felt. ``settings``: mass (kg) and
    load_share of the object. Only with controller 'ptp'."""
    contact, lift = state.ctx.contact, state.ctx.config.number("hand.lift")
    state.allow(2.0 * SINKING + 16.0)
    await_rest(state.ctx, state.check)
    try:
        watch = 2.0 * SINKING / max(0.1, state.ctx.arm.speed_scale()) + 10.0
        state.await_pending(contact.arm("release", watch, settings), "arming of the contact detector", 2.0)
        least = min(float(settings["load_share"]), LIFTS / (GRAVITY * float(settings["mass"])))
        before, top = _share_at_rest(state), palm_at(state.ctx)
        # Nobody is pressed down for longer than it takes to feel them.
        whole = _shifts(state, -lift, before + least + IN_MOTION / (GRAVITY * float(settings["mass"])))
        sunk, bottom = _share_at_rest(state), palm_at(state.ctx)
        if sunk - before < least:
            return False if whole and before < least else None
        _shifts(state, lift if top is None or bottom is None else max(LEAST_WAY, float(top[2] - bottom[2])))
        return True if sunk - _share_at_rest(state) >= 0.5 * least else None
    except PortError:
        # A detector that is dead, or that nobody tells anything, finds nobody either.
        return None
    finally:
        contact.disarm()


def _shifts(state: CoglabState, up: float, enough: float = math.inf) -> bool:
    """Rise by ``up`` m (sink if negative) until ``enough`` of the weight has gone, and come to rest. Whether the arm
    has gone the whole way; PortError if it does not move."""
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
    """The same, with the person's hand at the object before and after."""

    def at_hand() -> bool:
        away = from_palm(state, track, 0.3)
        return away is not None and away <= AT_HAND

    return at_hand() and person_holds(state, settings) is True and at_hand()


def _share_at_rest(state: CoglabState) -> float:
    """Share of the weight that has gone from a resting palm. TimeLimit if the detector does not report it."""
    shares: list[float] = []

    def has_come() -> bool:
        share = state.ctx.contact.share_gone()
        shares.extend([] if share is None else [share])
        return bool(shares)

    state.pause(SETTLES)
    state.wait_for(has_come, "the share of the weight that the contact detector tells", TELLS)
    return shares[0]


class TakeWeight(CoglabState):
    """Lift the object until the person's hand has left it, by ``hand.lift`` m at most. A person who does not let go
    gets the object back if they really hold it.

    The rise stops when ``hand.load_share`` of the weight has come: the person feels that, is told so, and an arm that
    went on would draw gentle fingers along the object. But the weight is counted from the closing of the fingers, when
    a person often still presses: if they hold on for ``hand.lift_pause`` s the arm rises on by ``hand.lift_step`` m,
    again and again.

    The person has let go when their hand has gone from where it held the object (``hand_distance``, m from the palm
    before the fingers closed, or where it is seen at the object first) and the object has stayed. If the hand is seen
    nowhere, the weight has to have come by the end of the rise; if it was hidden on its way, the weight has to have
    come, too, since another hand may be seen now. At the time limit, if the hand may have gone, the arm feels whether
    the person holds the object. If that is not sure, nothing is opened and the arm stays.

    The palm yields to a pull (YieldToPull), and the rise goes on afterwards. The fingers close again and again with the
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
        """For each object that is taken over."""
        self._top: float | None = None  # m, height to which the palm rises
        self._rises = 0
        self._told = self._seen_away = False
        self._farther: float | None = None  # m from the palm from which on the person's hand has left the object
        self._gone: float | None = None  # s, since when it has
        self._on: float | None = None  # s, when it rises on with the weight; None: the weight has not come
        self._closing: Pending | None = None  # of the fingers, once more
        self._closes = 0.0  # s, from when they may do so again

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
            self.wait_for(self._has_let_go, "the person's letting go", end - self.ctx.clock.now(), code=PERSON)
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
            if self._closing is not None:  # fingers that went on closing would press out what they hold
                self._closing.cancel()
        event = contact.event()
        self.reason = event.message if event is not None else "the person's hand has left it"
        ud.grip.shared, ud.hand_seen_away = False, self._seen_away
        self._tell()
        self.ctx.journal.mark("released")
        return "succeeded"

    def _count_from(self, distance: float | None) -> None:
        """The person's hand was seen so far from the palm (m). A hand that is not at the object does not count: it has
        left already, or is another one."""
        if distance is not None and distance <= AT_HAND:
            self._farther = distance + self.ctx.config.number("hand.let_go")

    def _has_let_go(self) -> bool:
        """Whether the person has; meanwhile rise until the weight has come, or give way."""
        carried = self.ctx.contact.event() is not None
        if not (blocked := self.ctx.arm.motion_allowed()).ok:
            raise TimeLimit("the arm does not follow any more", (blocked.why,), blocked.code)
        self._held.check()
        self._follow()
        if carried:
            self.ctx.journal.mark("loaded")
            self._tell()
        # Before and after the look, which waits for a sight.
        self._way.follow()
        away = from_palm(self, self._hand)
        if self._farther is None:
            self._count_from(away)
        if self._has_gone(away, carried):
            # The other one of two hands may hold on where the first is seen to go.
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
        """Whether the person's hand, ``away`` m from the palm, has left the object, and the object has stayed. If the
        hand was not seen all the way the weight has to be ``carried``, too."""
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
        """With the weight, in steps, while the person holds on."""
        now = self.ctx.clock.now()
        if self._on is None:
            self._way.halt("the weight has come")
            self._on = now + self.ctx.config.number("hand.lift_pause")
        elif now >= self._on and self._way.idle():
            step, speed = (self.ctx.config.number(f"hand.{name}") for name in ("lift_step", "lift_speed"))
            self._on = now + step / speed + self.ctx.config.number("hand.lift_pause")
            self._rise(step)

    def _follow(self) -> None:
        """Close again and again with the lowest force: as the person lets go the object shifts between the fingers."""
        now = self.ctx.clock.now()
        if now >= self._closes and (self._closing is None or self._closing.done()):
            self._closes = now + FOLLOWS
            self._closing = self.ctx.hand.close(self.ctx.config.get("give.close_speed"))

    def _tell(self) -> None:
        """Once: the robot carries the object."""
        if not self._told:
            self._told = True
            self.ctx.say(Say.I_HAVE_IT, "I have it.")

    def _rise(self, most: float = math.inf) -> None:
        """Up to the end of the first rise, by ``most`` m."""
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
        """The failure; "taken back" if the object has gone with the person's hand."""
        if error.code == ReasonCode.OBJECT_NOT_SEEN and not self.ctx.holding:
            self._way.stop()
            self.pause(FALLS)
            end = self.ctx.clock.now() + FALLS
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
        """Whether a hand is seen far from the object, or none while the weight has come, and nobody holds it."""
        self._way.stop()
        away, loaded = from_palm(self, self._hand, 0.3), self.ctx.contact.event() is not None
        gone = loaded if away is None else away > (AT_HAND if loaded else AWAY)
        return gone and person_holds(self, settings) is False

    def _not_released(self, object_id: str, limit: float, error: TimeLimit, settings: dict[str, Any]) -> PortError:
        """The failure. A person who holds the object gets it; else the robot keeps it."""
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
