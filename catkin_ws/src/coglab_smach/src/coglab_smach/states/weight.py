"""Taking an object over from a person: the arm takes the weight, the person feels that and lets go."""

from __future__ import annotations

from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, TimeLimit


class TakeWeight(CoglabState):
    """Lift what the hand has closed on until the arm carries ``hand.load_share`` of it, then wait until the person's
    hand has left it; a person who does not let go gets the object back.

    The arm rises by ``hand.lift`` m at most, at ``hand.lift_speed`` m/s. Where no tracker sees the person's hand, the
    weight alone counts.
    """

    default_time_limit = 16.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id", "object_entry"])

    def run(self, ud: Any) -> str:
        limit = float(self.ctx.config.get("hand.load_timeout", 5.0))
        end = self.ctx.clock.now() + limit
        near = self._hand_from_palm()
        try:
            self._take(ud, limit)
            self.ctx.journal.mark("loaded")
            if near is not None:
                away = float(self.ctx.config.get("hand.let_go", 0.04))
                self.wait_for(lambda: self._has_left(near + away), "the person's letting go", end - self.ctx.clock.now())
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
            self.wait_for(lambda: contact.event() is not None, f"the weight of '{ud.object_id}'", limit)
        finally:
            contact.disarm()
            if lift is not None:
                lift.cancel()
        event = contact.event()
        self.reason = event.message if event is not None else ""

    def _lift(self) -> Pending | None:
        """Begin to rise, each joint as fast as its share of the way asks for; None where the arm's posture is not known."""
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

    def _hand_from_palm(self) -> float | None:
        """m from the person's hand to the robot's palm, None where either is not seen."""
        here = self.ctx.arm.joint_positions()
        hand = str(self.ctx.config.get("perception.human_hand", "human_hand"))
        try:
            seen = self.await_pending(self.ctx.perception.locate_object(hand, 0.3), "sight of the person's hand", 0.5)
        except PortError:
            return None
        if here is None or seen.age > 0.5:
            return None
        return float(np.linalg.norm(np.array(seen.xyz) - default_arm().fk(np.asarray(here))[0]))

    def _has_left(self, farther: float) -> bool:
        now = self._hand_from_palm()
        return now is not None and now > farther
