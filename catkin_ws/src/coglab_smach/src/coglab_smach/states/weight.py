"""Taking an object over from a person: the arm takes the weight, the person feels that and lets go."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, TimeLimit


def hand_from_palm(state: CoglabState) -> float | None:
    """m from the person's hand to the robot's palm, None where either is not seen."""
    ctx = state.ctx
    here = ctx.arm.joint_positions()
    hand = str(ctx.config.get("perception.human_hand", "human_hand"))
    try:
        seen = state.await_pending(ctx.perception.locate_object(hand, 0.3), "sight of the person's hand", 0.5)
    except PortError:
        return None
    if here is None or seen.age > 0.5:
        return None
    return float(np.linalg.norm(np.array(seen.xyz) - default_arm().fk(np.asarray(here))[0]))


class TakeWeight(CoglabState):
    """Lift what the hand has closed on until the arm carries ``hand.load_share`` of it or the person's hand has left
    it; it has to leave it in the end. A person who does not let go gets the object back.

    The arm rises by ``hand.lift`` m at most, at ``hand.lift_speed`` m/s. ``hand_distance``: m, of the person's hand
    from the palm before the fingers closed; None where no tracker sees it, and then the weight alone counts.
    """

    default_time_limit = 16.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id", "object_entry", "hand_distance"])
        self._has_left: Callable[[], bool] = lambda: False

    def run(self, ud: Any) -> str:
        limit = float(self.ctx.config.get("hand.load_timeout", 5.0))
        end, seen = self.ctx.clock.now() + limit, ud.hand_distance is not None
        farther = (ud.hand_distance or 0.0) + float(self.ctx.config.get("hand.let_go", 0.04))
        self._has_left = lambda: seen and (hand_from_palm(self) or 0.0) > farther
        try:
            self._take(ud, limit)
            if seen:
                self.wait_for(self._has_left, "the person's letting go", end - self.ctx.clock.now())
        except TimeLimit as error:
            self.ctx.holding = ""
            raise PortError(
                f"the person did not let go of '{ud.object_id}' within {limit:.0f} s",
                (error.sentence,),
                ReasonCode.NOT_RELEASED,
            ) from None
        self.ctx.shared = False
        self.ctx.journal.mark("released")
        return "succeeded"

    def _take(self, ud: Any, limit: float) -> None:
        """Lift until the weight has come."""
        contact = self.ctx.contact
        settings = {
            "mass": float(ud.object_entry.get("mass", 0.0)),
            "load_share": float(self.ctx.config.get("hand.load_share", 0.5)),
        }
        self.await_pending(contact.arm("lift", limit, settings), "arming of the contact detector", 2.0)
        lift: Pending | None = None
        try:
            self.pause(float(self.ctx.config.get("hand.lift_after", 0.1)))
            lift = self._lift()
            self.wait_for(
                lambda: contact.event() is not None or self._has_left(), f"the weight of '{ud.object_id}'", limit
            )
        finally:
            contact.disarm()
            if lift is not None:
                lift.cancel()
        event = contact.event()
        if event is not None:
            self.ctx.journal.mark("loaded")
        self.reason = event.message if event is not None else "the person's hand has left it"

    def _lift(self) -> Pending | None:
        """Begin to rise, each joint as fast as its share of the way asks for; None where the posture is not known."""
        here = self.ctx.arm.joint_positions()
        if here is None:
            return None
        height = float(self.ctx.config.get("hand.lift", 0.03))
        speed = float(self.ctx.config.get("hand.lift_speed", 0.03))
        jacobian = default_arm().jacobian(np.asarray(here))
        up = np.array([0.0, 0.0, height, 0.0, 0.0, 0.0])
        way = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-4 * np.eye(6), up)
        velocity = np.maximum(np.abs(way) * speed / height, 1e-3)
        return self.ctx.arm.move_ptp((np.asarray(here) + way).tolist(), velocity.tolist())
