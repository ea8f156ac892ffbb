"""States of the hand: calibration, preshape, closing on the object, opening."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from coglab_msgs.msg import ReasonCode, Say
from ih2_hand.grasps import CLOSING_MOTORS, LEVELS, levels_of

from coglab_smach.context.context import Context
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.hand_tracking import AT_HAND, AWAY, HandLook, HandTrack, from_palm, hand_from_palm, palm_axis
from coglab_smach.states.motion import shift, shift_time
from coglab_smach.states.yield_to_pull import YieldToPull

LOOSE = 40  # counts of 254 by which the fingers must open before the palm draws back
AT_END = 250  # counts of 254: a finger at or above has closed past the object
FREE = 0.10  # m, increase of the hand's distance from the palm at which no finger of the person is at the object
FREE_FOR = 0.2  # s for which the hand must stay that far away
GOES = 1.0  # s, time limit for the hand to move that far away
DRAWING_BACK = 2.0  # s, added to the planned duration of drawing back


def gentle(grasp: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the hand settings of a grasp with the lowest force level that all firmware dialects support for its mode:
    a person's fingers may be between the robot's."""
    return {**grasp["hand"], "level": levels_of(grasp["hand"]["mode"], "legacy")[0]}


def closes_gently(grasp: Mapping[str, Any]) -> bool:
    """True if every hand can close this grasp with the lowest force level. Older hands have some modes only as firm."""
    return bool(gentle(grasp)["level"] == LEVELS[0])


def firm_speed(ctx: Context, entry: Mapping[str, Any], grasp_name: str) -> int:
    """Returns the wire speed (and thus force) of the firm grip in the object's entry; 0 if gentle() gives the same."""
    own = entry["grasps"][grasp_name]
    level = own["hand"]["level"]
    return 0 if level == gentle(own)["level"] else int(ctx.config.get(f"hand.tighten.{level}"))


def stopped_by_object(mode: str, positions: Sequence[int]) -> bool:
    """Returns whether the closed fingers stand around an object. Then the thumb (motor 1) has stopped before its closed
    end, and so has one opposing finger if the mode closes any. Otherwise they hold the object by an edge, and it falls.
    ``positions``: counts of 254. True for a hand that does not report them."""
    standing = [motor for motor in CLOSING_MOTORS[mode] if len(positions) <= motor or positions[motor] < AT_END]
    return 1 in standing and len(standing) >= min(2, len(CLOSING_MOTORS[mode]))


class CalibrateHand(CoglabState):
    """Calibrate the hand. Skipped if it is calibrated (but see ``hand.calibrate_always``). Always skipped if it holds
    an object: calibration opens the fingers."""

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
        self.await_pending(self.ctx.hand.calibrate(mode), f"hand calibration '{mode}'", code=ReasonCode.WAITS_FOR_HAND)
        return "succeeded"


class HandPreshape(CoglabState):
    """Move the hand to the preshape of the object's grasp mode."""

    default_time_limit = 6.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["grasp"], io_keys=["grip"])

    def run(self, ud: Any) -> str:
        hand, ud.grip.preshaped = ud.grasp["hand"], False
        self.await_pending(
            self.ctx.hand.preshape(hand["mode"], hand["level"]),
            f"preshape '{hand['mode']}'",
            code=ReasonCode.WAITS_FOR_HAND,
        )
        ud.grip.preshaped = True
        self.ctx.journal.mark("preshaped")
        return "succeeded"


class HandClose(CoglabState):
    """Close the preshaped hand on the object and check that it holds it.

    With ``from_person``, the palm yields to a pull meanwhile. Outcomes for the first failure in this action: missed
    (the fingers have closed on nothing) and edge (they do not stand around the object, see stopped_by_object). The
    person still waits, so the arm may try once more.
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
        """distance (m) from the person's hand to the palm before closing; None: not seen"""

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("closing")
        # From here on the hand may hold the object: after a failure, the recovery must not drop it.
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
        self.await_pending(closing, "closing of the hand", code=ReasonCode.WAITS_FOR_HAND)
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
        """True if the fingers stand around the object, or if the person has gone: opening would then drop it."""
        if stopped_by_object(mode, positions):
            return True
        let_go = self.ctx.config.number("hand.let_go")
        gone = AT_HAND if self._before is None else min(AT_HAND, self._before + let_go)
        away = from_palm(self, hand, 0.3)
        # An unseen hand may have gone, and so may a hand that the tracker has confused with another one.
        return away is None or away > gone

    def _give_way(self, closing: Pending, hand: HandLook) -> None:
        """Yield to pulls until the fingers have closed."""
        way = YieldToPull(self.ctx)

        def closed() -> bool:
            way.follow()
            hand.look()
            return closing.done()

        try:
            self.wait_for(closed, "closing of the hand", code=ReasonCode.WAITS_FOR_HAND)
        finally:
            way.stop()


class HandTighten(CoglabState):
    """Tighten the grip on an object that the person has let go of, to the force of the object's entry. The fingers
    close from their present positions with wire speed Grip.firm. The arm does not wait until they stand still: they
    reach the force within ``hand.settle_after_close`` s.

    No fingers of a person may be in between. The person's hand must be tracked without a gap until it is FREE farther
    away than before, for FREE_FOR. Otherwise the grip is tightened ``at_home``, if no hand is seen near the palm."""

    default_time_limit = 5.0

    def __init__(self, ctx: Context, at_home: bool = False) -> None:
        super().__init__(ctx, input_keys=[] if at_home else ["hand_distance", "hand_seen_away"], io_keys=["grip"])
        self.at_home = at_home

    def run(self, ud: Any) -> str:
        speed = ud.grip.firm if self.ctx.holding else 0
        if speed == 0:
            self.reason = "the grip already has the force of its grasp"
            return "succeeded"
        if self.at_home:
            away = hand_from_palm(self)
            if away is not None and away < AT_HAND:
                self.reason = f"the grip stays gentle: the person's hand is {away:.2f} m from the palm"
                return "succeeded"
        elif not (ud.hand_seen_away and self._is_free(ud.hand_distance, ud.grip.hand)):
            self.reason = "the person's hand was not seen to leave: the grip is tightened at home"
            return "succeeded"
        closing, end = self.ctx.hand.close(speed), self.ctx.config.number("hand.settle_after_close")
        # The closing continues while the arm moves. A STOP ends it then (EndMotion).
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
        """True if the person's hand, ``before`` m from the palm at first, is seen to move away from the object."""
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
    """Open the hand. Afterwards it holds nothing."""

    default_time_limit = 8.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, io_keys=["grip"])

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("opening")
        self.await_pending(
            self.ctx.hand.open(self.ctx.config.get("hand.open_speed")),
            "opening of the hand",
            code=ReasonCode.WAITS_FOR_HAND,
        )
        self.ctx.holding = ""
        ud.grip.release()
        return "succeeded"


class LetGo(CoglabState):
    """Open the hand for the person who has taken the object, and inform them.

    The hand opens to its preshape, in which the object came in. Meanwhile the palm draws back from the object by
    ``give.draw_back`` m: people leave at once, and fingers beside the object would tear it from them.
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
            self.wait_for(
                lambda: opening.done() or self._open_by(closed), "opening of the hand", code=ReasonCode.WAITS_FOR_HAND
            )
        except TimeLimit:
            # At STOP the fingers continue to open: the person has the object.
            opening.cancel()
            raise
        if opening.done():
            opening.result()  # raises if the fingers are stuck: drawing back would drag the object
        axis, way, limit = palm_axis(self.ctx), self.ctx.config.number("give.draw_back"), DRAWING_BACK
        if axis is not None and way > 0.0:
            speed = self.ctx.config.number("give.draw_back_speed")
            limit += shift_time(self.ctx, -way * axis, speed)
            back = shift(self.ctx, -way * axis, speed)
        self.await_pending(opening, "opening of the hand", code=ReasonCode.WAITS_FOR_HAND)
        self.ctx.holding = ""
        ud.grip.release()
        # Not earlier: the person leaves after this message, and half-open fingers would keep the object.
        self.ctx.say(Say.YOU_HAVE_IT, "You have it.")
        if back is not None:
            self.allow(limit + 1.0)
            try:
                self.await_pending(back, "drawing back", limit, self.ctx.arm.speed_scale, ReasonCode.WAITS_FOR_ARM)
            except PortError as error:
                self.reason = error.sentence  # an incomplete retreat is enough; the motion home goes on from there
        return "succeeded"

    def _open_by(self, closed: tuple[int, ...]) -> bool:
        """True if a finger has opened by LOOSE counts."""
        now = self.ctx.hand.state().positions
        return len(now) == len(closed) > 0 and max(c - n for c, n in zip(closed[1:], now[1:], strict=True)) >= LOOSE
