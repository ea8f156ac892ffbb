"""States of the hand: calibration, preshape, closing on the object, opening."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coglab_msgs.msg import ReasonCode, Say
from ih2_hand.grasps import levels_of

from coglab_smach.context.awaited import ARM, HAND
from coglab_smach.context.config import Config
from coglab_smach.context.context import Context
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, Interrupted, TimeLimit
from coglab_smach.states.motion import shift, shift_time
from coglab_smach.states.where import hand_from_palm, palm_axis
from coglab_smach.states.yielding import GivesWay

GRAVITY, SIDES = 9.81, 2
"""m/s^2; an object is pressed from two sides, and each bears its share by friction"""
LOOSE = 40
"""counts of 254 that the fingers have opened when the palm begins to draw back"""
PULLED = 0.01
"""s for which closing fingers are pulled at too strongly before they loosen"""
LOOSE_PULLED = 8
"""counts of 254 by which they do at most"""
MOST_LOOSENED = 3
"""how often they do, before they open for good"""
CALM, PULL_ENDS = 0.2, 2.0
"""s without a pull until they close again, and s for which that is waited for"""
DRAWING_BACK = 2.0
"""s that drawing back may take beyond what limits and speed scale ask for"""


def gentle(entry: Mapping[str, Any], grasp: Mapping[str, Any], config: Config) -> dict[str, Any]:
    """The hand of a grasp as it closes beside a person, whose fingers may be between its own: with the lowest force
    level that every dialect has for its mode and that bears the object's weight by friction, ``hand.safety`` times.
    Where none does it is the grasp's own level."""
    hand: dict[str, Any] = dict(grasp["hand"])
    weight = float(entry.get("mass", 0.0)) * GRAVITY
    needed = float(config.get("hand.safety", 2.0)) * weight / (SIDES * float(entry.get("friction", 1.0)))
    for level in levels_of(hand["mode"], "legacy"):
        if level == hand["level"] or float(config.get(f"hand.force.{level}", 0.0)) >= needed:
            return {**hand, "level": level}
    return hand


def opened_by(ctx: Context, closed: tuple[int, ...], counts: int) -> bool:
    """Whether a finger has opened by so many counts since the motors stood at ``closed``."""
    now = ctx.hand.state().positions
    return len(now) == len(closed) > 0 and max(c - n for c, n in zip(closed[1:], now[1:], strict=True)) >= counts


class CalibrateHand(CoglabState):
    """Calibration order to the hand; skipped, with a sentence, if it is calibrated and the configuration
    does not insist, and always if the hand holds something: calibrating opens the fingers."""

    default_time_limit = 30.0

    def run(self, ud: Any) -> str:
        state = self.ctx.hand.state()
        end = self.ctx.clock.now() + float(self.ctx.config.get("hand.settle_after_start", 2.0))
        while state.connected and state.holding and self.ctx.clock.now() < end:
            self.pause(0.1)
            state = self.ctx.hand.state()
        if state.connected and state.holding:
            self.reason = "the hand holds an object: not calibrated, because that would open it"
            return "succeeded"
        if state.calibrated and not bool(self.ctx.config.get("hand.calibrate_always", False)):
            self.reason = "the hand is calibrated already"
            return "succeeded"
        mode = str(self.ctx.config.get("hand.calibration", "fast"))
        self.await_pending(self.ctx.hand.calibrate(mode), f"hand calibration '{mode}'", code=HAND)
        return "succeeded"


class HandPreshape(CoglabState):
    """Take the preshape of the object's grasp mode."""

    default_time_limit = 6.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["grasp"])

    def run(self, ud: Any) -> str:
        hand, self.ctx.preshaped = ud.grasp["hand"], False
        self.await_pending(self.ctx.hand.preshape(hand["mode"], hand["level"]), f"preshape '{hand['mode']}'", code=HAND)
        self.ctx.preshaped = True
        self.ctx.journal.mark("preshaped")
        return "succeeded"


class HandClose(CoglabState):
    """Close the preshaped hand on the object and make sure that something is in it; with ``from_person`` say so.

    Outcome missed, with ``from_person``: the fingers have closed on nothing for the first time in this action; a person
    who offers waits, so the arm may try once more. Meanwhile the palm goes along with who pulls (GivesWay), and from
    ``pull.limit`` N on the fingers loosen until nobody pulls any more, and then close again; who pulls at them again
    and again gets the object back.
    """

    default_time_limit = 12.0
    owns_motion = True

    def __init__(self, ctx: Context, from_person: bool) -> None:
        super().__init__(
            ctx,
            outcomes=["succeeded", "missed"] if from_person else ["succeeded"],
            input_keys=["object_id", "object_entry"] if from_person else ["object_id"],
            output_keys=["hand_distance"] if from_person else [],
        )
        self.from_person = from_person

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("closing")
        # From here on the hand may hold: a failure in the middle must not make the recovery drop the object.
        self.ctx.holding, self.ctx.shared = ud.object_id, self.from_person
        closing = self.ctx.closing or self.ctx.hand.close_on_object()
        self.ctx.closing = None
        if self.from_person:
            ud.hand_distance = hand_from_palm(self)
            if self._pulled_at(closing, float(ud.object_entry.get("mass", 0.0))):
                self._give_back(ud.object_id)
        else:
            self.await_pending(closing, "closing of the hand", code=HAND)
        self.ctx.journal.mark("closed")
        end = self.ctx.clock.now() + float(self.ctx.config.get("hand.settle_after_close", 0.3))
        while not self.ctx.hand.state().holding and self.ctx.clock.now() < end:
            self.pause(0.02)
        state = self.ctx.hand.state()
        if state.connected and not state.holding:
            self.ctx.holding, self.ctx.shared = "", False
            if self.from_person and not self.ctx.journal.marked("missed"):
                self.ctx.journal.mark("missed")
                self.reason = "the hand closed on nothing: once more"
                return "missed"
            raise PortError(
                f"the hand closed on nothing: motors at {list(state.positions)} of 254",
                (state.message,) if state.message else (),
                ReasonCode.OBJECT_NOT_SEEN,
            )
        if self.from_person:
            self.ctx.say(Say.I_HAVE_IT, "I have it.")
        return "succeeded"

    def _pulled_at(self, closing: Pending, mass: float) -> bool:
        """Give way until the hand has closed. Closing fingers that are pulled at loosen, and close again when the pull
        is over; whether they have to loosen for good."""
        way, loosened = GivesWay(self.ctx, mass), 0

        def over() -> bool:
            way.follow()
            return closing.done() or way.too_strong(PULLED)

        try:
            while True:
                self.wait_for(over, "closing of the hand", code=HAND)
                if closing.done() or loosened == MOST_LOOSENED:
                    break
                loosened += 1
                closing.cancel()
                self._loosen(way)
                closing = self.ctx.hand.close(int(self.ctx.config.get("pull.close_speed", 100)))
        except (Interrupted, TimeLimit):
            closing.cancel()
            raise
        finally:
            way.stop()
        if not closing.done():
            closing.cancel()
            return True
        closing.result()
        return False

    def _loosen(self, way: GivesWay) -> None:
        """Open the fingers until nobody pulls, a little at most, and wait for the end of the pull."""
        self.ctx.journal.mark("pulled")
        closed, least = self.ctx.hand.state().positions, float(self.ctx.config.get("pull.ends", 3.0))
        opening = self.ctx.hand.open(int(self.ctx.config.get("hand.open_speed", 400)))
        end = self.ctx.clock.now() + PULL_ENDS

        def loose() -> bool:
            way.follow()
            return way.strength() < least or opened_by(self.ctx, closed, LOOSE_PULLED) or opening.done()

        self.wait_for(loose, "that the fingers loosen", code=HAND)
        opening.cancel()
        calm = self.ctx.clock.now()
        while self.ctx.clock.now() < min(end, calm + CALM):
            way.follow()
            if way.strength() >= least:
                calm = self.ctx.clock.now()
            self.pause(0.01)

    def _give_back(self, object_id: str) -> None:
        """The fingers open around what is pulled at, which is the person's; always a PortError."""
        opening = self.ctx.hand.open(int(self.ctx.config.get("hand.open_speed", 400)))
        self.await_pending(opening, "opening of the hand", code=HAND)
        self.ctx.holding, self.ctx.shared = "", False
        sentence = f"the person pulled at '{object_id}' again and again while the hand closed, and has it back"
        raise PortError(sentence, (), ReasonCode.NOT_RELEASED)


class HandTighten(CoglabState):
    """Hold what the person has let go of as firmly as the object's entry says: the fingers close from where they are,
    at the wire speed, and with it the force, of ``hand.tighten`` for the grasp's level.

    The arm need not wait until the hand is sure that they stand: they press within ``hand.settle_after_close`` s."""

    default_time_limit = 5.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_entry", "grasp", "grasp_name"])

    def run(self, ud: Any) -> str:
        level = ud.object_entry["grasps"][ud.grasp_name]["hand"]["level"]
        if level == ud.grasp["hand"]["level"]:
            self.reason = f"it is held with the force of level '{level}'"
            return "succeeded"
        speed = int(self.ctx.config.get(f"hand.tighten.{level}", 200))
        closing, end = self.ctx.hand.close(speed), float(self.ctx.config.get("hand.settle_after_close", 0.3))
        end += self.ctx.clock.now()
        while not closing.done() and self.ctx.clock.now() < end:
            self.pause(0.02)
        if closing.done():
            closing.result()
        self.reason = f"the fingers close to the force of level '{level}'"
        self.ctx.journal.mark("tightened")
        return "succeeded"


class HandOpen(CoglabState):
    """Open the hand; afterwards nothing is held."""

    default_time_limit = 8.0

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("opening")
        self.await_pending(
            self.ctx.hand.open(int(self.ctx.config.get("hand.open_speed", 400))), "opening of the hand", code=HAND
        )
        self.ctx.holding, self.ctx.shared = "", False
        return "succeeded"


class LetGo(CoglabState):
    """Open the hand for the person who has taken the object, and tell them.

    It opens as far as its preshape, in which the object came in, and meanwhile the palm draws back from the object,
    outward by ``give.draw_back`` m: who has an object goes with it at once, and fingers beside it would tear it away.
    """

    default_time_limit = 8.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["grasp"])

    def run(self, ud: Any) -> str:
        self.ctx.journal.mark("opening")
        hand, closed = ud.grasp["hand"], self.ctx.hand.state().positions
        opening, back = self.ctx.hand.preshape(hand["mode"], hand["level"]), None
        while not opening.done() and not opened_by(self.ctx, closed, LOOSE):
            self.pause(0.01)
        if opening.done():
            opening.result()  # fingers that are stuck would drag what the person holds
        axis, way, limit = palm_axis(self.ctx), float(self.ctx.config.get("give.draw_back", 0.06)), DRAWING_BACK
        if axis is not None and way > 0.0:
            speed = float(self.ctx.config.get("give.draw_back_speed", 0.25))
            limit += shift_time(self.ctx, -way * axis, speed)
            back = shift(self.ctx, -way * axis, speed)
        self.await_pending(opening, "opening of the hand", code=HAND)
        self.ctx.holding, self.ctx.shared = "", False
        # Not earlier: who is told so goes, and fingers that are half open would keep the object.
        self.ctx.say(Say.YOU_HAVE_IT, "You have it.")
        if back is not None:
            self.allow(limit + 1.0)
            try:
                self.await_pending(back, "drawing back", limit, self.ctx.arm.speed_scale, ARM)
            except PortError as error:
                self.reason = error.sentence  # as far as it goes; the way home goes on from there
        return "succeeded"
