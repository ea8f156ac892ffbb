"""States of the hand: calibration, preshape, closing on the object, opening."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from coglab_msgs.msg import ReasonCode, Say
from ih2_hand.grasps import CLOSING_MOTORS, LEVELS, levels_of

from coglab_smach.context.context import Context
from coglab_smach.context.wait_reasons import ARM, HAND
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.hand_tracking import AT_HAND, AWAY, HandLook, HandTrack, from_palm, hand_from_palm, palm_axis
from coglab_smach.states.motion import shift, shift_time
from coglab_smach.states.yield_to_pull import YieldToPull

LOOSE = 40  # counts of 254 that the fingers have opened when the palm begins to draw back
AT_END = 250  # counts of 254 from which a finger has closed past the object
FREE = 0.10  # m that the person's hand is farther away than it was when none of its fingers is at the object
FREE_FOR = 0.2  # s for which it has to be
GOES = 1.0  # s in which it has to go so far
DRAWING_BACK = 2.0  # s that drawing back may take beyond what limits and speed scale ask for


def gentle(grasp: Mapping[str, Any]) -> dict[str, Any]:
    """The hand of a grasp with the lowest force level that every dialect has for its mode: a person's fingers may be
    between the robot's."""
    return {**grasp["hand"], "level": levels_of(grasp["hand"]["mode"], "legacy")[0]}


def closes_gently(grasp: Mapping[str, Any]) -> bool:
    """Whether every hand can close by this grasp with the lowest force level: older hands have some modes only firm."""
    return bool(gentle(grasp)["level"] == LEVELS[0])


def firm_speed(ctx: Context, entry: Mapping[str, Any], grasp_name: str) -> int:
    """Wire speed, and with it the force, of closing as firmly as the object's entry asks for; 0 if gentle() does."""
    own = entry["grasps"][grasp_name]
    level = own["hand"]["level"]
    return 0 if level == gentle(own)["level"] else int(ctx.config.get(f"hand.tighten.{level}"))


def stopped_by_object(mode: str, positions: Sequence[int]) -> bool:
    """Whether the closed fingers stand around something: the thumb (motor 1), and one finger that opposes it if the
    mode closes any, have stopped before their closed ends. Otherwise they hold the object by an edge, and it falls.
    True for a hand that does not report ``positions`` (counts of 254)."""
    standing = [motor for motor in CLOSING_MOTORS[mode] if len(positions) <= motor or positions[motor] < AT_END]
    return 1 in standing and len(standing) >= min(2, len(CLOSING_MOTORS[mode]))


class CalibrateHand(CoglabState):
    """Calibrate the hand. Skipped if it is calibrated already (but see ``hand.calibrate_always``), and always if it
    holds something: calibrating opens the fingers."""

    default_time_limit = 30.0

    def run(self, ud: Any) -> str:
        state = self.ctx.hand.state()
        end = self.ctx.clock.now() + self.ctx.config.number("hand.settle_after_start")
        while state.connected and state.holding and self.ctx.clock.now() < end:
            self.pause(0.1)
            state = self.ctx.hand.state()
        if state.connected and state.holding:
            self.reason = "the hand holds an object: not calibrated, because that would open it"
            return "succeeded"
        if state.calibrated and not self.ctx.config.get("hand.calibrate_always"):
            self.reason = "the hand is calibrated already"
            return "succeeded"
        mode = self.ctx.config.text("hand.calibration")
        self.await_pending(self.ctx.hand.calibrate(mode), f"hand calibration '{mode}'", code=HAND)
        return "succeeded"


class HandPreshape(CoglabState):
    """Take the preshape of the object's grasp mode."""

    default_time_limit = 6.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["grasp"], io_keys=["grip"])

    def run(self, ud: Any) -> str:
        hand, ud.grip.preshaped = ud.grasp["hand"], False
        self.await_pending(self.ctx.hand.preshape(hand["mode"], hand["level"]), f"preshape '{hand['mode']}'", code=HAND)
        ud.grip.preshaped = True
        self.ctx.journal.mark("preshaped")
        return "succeeded"


class HandClose(CoglabState):
    """Close the preshaped hand on the object and make sure that something is in it.

    With ``from_person`` the palm yields to a pull meanwhile. Outcomes missed and edge: the fingers have closed on
    nothing, or do not stand around it (stopped_by_object), for the first time in this action. The person still waits,
    so the arm may try once more.
    """

    default_time_limit = 12.0
    owns_motion = True

    def __init__(self, ctx: Context, from_person: bool) -> None:
        super().__init__(
            ctx,
            outcomes=["succeeded", "missed", "edge"] if from_person else ["succeeded"],
            input_keys=["object_id", "grasp"] if from_person else ["object_id"],
            output_keys=["hand_distance"] if from_person else [],
            io_keys=["grip"],
        )
        self.from_person = from_person
        self._before: float | None = None
        """m from the person's hand to the palm before the fingers had closed; None: not seen"""

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("closing")
        # From here on the hand may hold: a failure in the middle must not make the recovery drop the object.
        grip, self.ctx.holding = ud.grip, ud.object_id
        closing = (grip.take_closing() if self.from_person else None) or self.ctx.hand.close_on_object()
        grip.shared = self.from_person
        grip.firm = int(ud.grasp["hand"].get("firm", 0)) if self.from_person else 0
        if self.from_person:
            try:
                ud.hand_distance = self._before = from_palm(self, grip.hand)
                self._give_way(closing, HandLook(self.ctx, grip.hand))
            except (Interrupted, TimeLimit):
                closing.cancel()
                raise
        self.await_pending(closing, "closing of the hand", code=HAND)
        self.ctx.journal.mark("closed")
        end = self.ctx.clock.now() + self.ctx.config.number("hand.settle_after_close")
        while not self.ctx.hand.state().holding and self.ctx.clock.now() < end:
            self.pause(0.02)
        state = self.ctx.hand.state()
        around = not self.from_person or self._around(ud.grasp["hand"]["mode"], state.positions, grip.hand)
        if state.connected and not (state.holding and around):
            self.ctx.holding = ""
            grip.release()
            missed = "the hand holds it by an edge" if state.holding else "the hand closed on nothing"
            if self.from_person and not self.ctx.journal.marked("missed"):
                self.ctx.journal.mark("missed")
                grip.preshaped = False
                self.reason = f"{missed}: once more"
                return "edge" if state.holding else "missed"
            raise PortError(
                f"{missed}: motors at {list(state.positions)} of 254",
                (state.message,) if state.message else (),
                ReasonCode.OBJECT_NOT_SEEN,
            )
        return "succeeded"

    def _around(self, mode: str, positions: Sequence[int], hand: HandTrack) -> bool:
        """Whether the fingers stand around the object; or the person has gone, so that opening would let it fall."""
        if stopped_by_object(mode, positions):
            return True
        let_go = self.ctx.config.number("hand.let_go")
        gone = AT_HAND if self._before is None else min(AT_HAND, self._before + let_go)
        away = from_palm(self, hand, 0.3)
        # A hand that nobody sees may have gone, too, and so may one for which another one is seen.
        return away is None or away > gone

    def _give_way(self, closing: Pending, hand: HandLook) -> None:
        """Until the fingers have closed."""
        way = YieldToPull(self.ctx)

        def closed() -> bool:
            way.follow()
            hand.look()
            return closing.done()

        try:
            self.wait_for(closed, "closing of the hand", code=HAND)
        finally:
            way.stop()


class HandTighten(CoglabState):
    """Hold what the person has let go of as firmly as the object's entry asks for: the fingers close from where they
    are, at the wire speed Grip.firm. The arm does not wait until they stand: they press within
    ``hand.settle_after_close`` s.

    No person's fingers may be between: the person's hand has to be seen all the way until it is FREE farther away than
    it was, for FREE_FOR. If it was not seen to go, the object is held firmly ``at_home``, if no hand is seen near the
    palm there."""

    default_time_limit = 5.0

    def __init__(self, ctx: Context, at_home: bool = False) -> None:
        super().__init__(ctx, input_keys=[] if at_home else ["hand_distance", "hand_seen_away"], io_keys=["grip"])
        self.at_home = at_home

    def run(self, ud: Any) -> str:
        speed = ud.grip.firm if self.ctx.holding else 0
        if speed == 0:
            self.reason = "nothing is held more gently than its grasp asks for"
            return "succeeded"
        if self.at_home:
            away = hand_from_palm(self)
            if away is not None and away < AT_HAND:
                self.reason = f"it stays held gently: the person's hand is {away:.2f} m from the palm"
                return "succeeded"
        elif not (ud.hand_seen_away and self._is_free(ud.hand_distance, ud.grip.hand)):
            self.reason = "the person's hand was not seen to go: at home"
            return "succeeded"
        closing, end = self.ctx.hand.close(speed), self.ctx.config.number("hand.settle_after_close")
        # It goes on while the arm does: a STOP ends it then as well (EndMotion).
        ud.grip.tightening = closing
        end += self.ctx.clock.now()
        while not closing.done() and self.ctx.clock.now() < end:
            self.pause(0.02)
        if closing.done():
            closing.result()
        ud.grip.firm = 0
        self.reason = f"the fingers close to the force of wire speed {speed}"
        self.ctx.journal.mark("tightened")
        return "succeeded"

    def _is_free(self, before: float | None, hand: HandTrack) -> bool:
        """Whether the person's hand, which was ``before`` m from the palm, is seen away from the object."""
        free, since = AWAY if before is None else before + FREE, None
        end = self.ctx.clock.now() + GOES
        while self.ctx.clock.now() < end:
            if (from_palm(self, hand) or 0.0) <= free or not hand.is_sure:
                since = None
            else:
                since = self.ctx.clock.now() if since is None else since
                if self.ctx.clock.now() - since >= FREE_FOR:
                    return True
            self.pause(0.02)
        return False


class HandOpen(CoglabState):
    """Open the hand; afterwards nothing is held."""

    default_time_limit = 8.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, io_keys=["grip"])

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("opening")
        self.await_pending(self.ctx.hand.open(self.ctx.config.get("hand.open_speed")), "opening of the hand", code=HAND)
        self.ctx.holding = ""
        ud.grip.release()
        return "succeeded"


class LetGo(CoglabState):
    """Open the hand for the person who has taken the object, and tell them.

    It opens as far as its preshape, in which the object came in. Meanwhile the palm draws back from the object by
    ``give.draw_back`` m: a person who has an object goes at once, and fingers beside it would tear it away.
    """

    default_time_limit = 8.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["grasp"], io_keys=["grip"])

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("opening")
        hand, closed = ud.grasp["hand"], self.ctx.hand.state().positions
        opening, back = self.ctx.hand.preshape(hand["mode"], hand["level"]), None
        try:
            self.wait_for(lambda: opening.done() or self._open_by(closed), "opening of the hand", code=HAND)
        except TimeLimit:
            # STOP lets the fingers open: the person has what is between them.
            opening.cancel()
            raise
        if opening.done():
            opening.result()  # fingers that are stuck would drag what the person holds
        axis, way, limit = palm_axis(self.ctx), self.ctx.config.number("give.draw_back"), DRAWING_BACK
        if axis is not None and way > 0.0:
            speed = self.ctx.config.number("give.draw_back_speed")
            limit += shift_time(self.ctx, -way * axis, speed)
            back = shift(self.ctx, -way * axis, speed)
        self.await_pending(opening, "opening of the hand", code=HAND)
        self.ctx.holding = ""
        ud.grip.release()
        # Not earlier: who is told so goes, and fingers that are half open would keep the object.
        self.ctx.say(Say.YOU_HAVE_IT, "You have it.")
        if back is not None:
            self.allow(limit + 1.0)
            try:
                self.await_pending(back, "drawing back", limit, self.ctx.arm.speed_scale, ARM)
            except PortError as error:
                self.reason = error.sentence  # as far as it goes; the way home goes on from there
        return "succeeded"

    def _open_by(self, closed: tuple[int, ...]) -> bool:
        """Whether a finger has opened by LOOSE counts since."""
        now = self.ctx.hand.state().positions
        return len(now) == len(closed) > 0 and max(c - n for c, n in zip(closed[1:], now[1:], strict=True)) >= LOOSE
