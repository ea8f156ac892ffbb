"""Moves a palm that has touched an object beside its grasp to that grasp, before the fingers close again."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.hand_tracking import palm_at, palm_axis, way_to_grasp
from coglab_smach.states.motion import shift, shift_time
from coglab_smach.states.reach import RETREAT_SPEED

FARTHEST = 0.05  # m, longest path of the palm to the grasp, apart from CLEAR
CLEAR = 0.10  # m, retreat before it: the open thumb reaches 0.09 m out of the palm
LEAST = 0.005  # m, a shorter path is not started
SPEED = 0.06  # m/s
PUSHES = 6.5  # N against the motion that count as an obstacle


class Regrasp(CoglabState):
    """Move the open hand to the grasp of the object that a person still holds, as it is seen now, at most FARTHEST m
    from where the palm is. A reach ends with the first touch, which may come beside the grasp. Another reach would
    detect the same touch at once. The hand first retreats: palm and thumb lie on the object and would drag it along. A
    push against a motion, a time limit or a limit of the arm ends it. Without a sight of the object nothing moves.
    """

    default_time_limit = 6.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["goal"])

    def run(self, ud: Any) -> str:
        way, palm, outward = way_to_grasp(self, ud.goal), palm_at(self.ctx), palm_axis(self.ctx)
        length = 0.0 if way is None else float(np.linalg.norm(way))
        if way is None or palm is None or outward is None or length < LEAST:
            self.reason = "the object is not seen" if way is None else "the palm is at its grasp"
            return "succeeded"
        self._move(-CLEAR * outward, RETREAT_SPEED)
        # The person's hand follows when the palm no longer presses: look again.
        seen, here = way_to_grasp(self, ud.goal), palm_at(self.ctx)
        if here is not None:
            way = way if seen is None else here + seen - palm
            way = way * min(1.0, FARTHEST / max(LEAST, float(np.linalg.norm(way))))
            self._move(palm + way - here, SPEED)
        return "succeeded"

    def _move(self, way: np.ndarray, speed: float) -> None:
        """Move the palm by ``way`` (m, base frame) at ``speed`` (m/s), or as far as it gets."""
        if float(np.linalg.norm(way)) < LEAST:
            return
        limit = shift_time(self.ctx, way, speed) + 1.0
        self.allow(limit + 3.0)
        motion = shift(self.ctx, way, speed)
        if motion is None:
            return
        over = partial(self._over, motion, way / float(np.linalg.norm(way)))
        try:
            self.wait_for(over, "the way to the grasp", limit, self.ctx.arm.speed_scale, ReasonCode.WAITS_FOR_ARM)
        except TimeLimit as error:
            # The object moves away as the palm comes: the fingers can close here too.
            self.reason = error.sentence
        try:
            self._end(motion)
        except PortError as error:
            if isinstance(error, TimeLimit) or not self.ctx.arm.motion_allowed().ok:
                raise
            self.reason = error.sentence  # beyond a limit of the arm

    def _over(self, motion: Pending, along: np.ndarray) -> bool:
        """True if the motion has ended or something is in the way. What the hand leaves pushes it on."""
        force = self.ctx.contact.force()
        return motion.done() or force is not None and float(-along @ np.asarray(force)) > PUSHES

    def _end(self, motion: Pending) -> None:
        if motion.done():
            motion.result()
        else:
            self.reason = self.reason or "something is in the way"
            self.await_pending(self.ctx.arm.cancel_motion(self.reason), "end of the way to the grasp", 2.0)
