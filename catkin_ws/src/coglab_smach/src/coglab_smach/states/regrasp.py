"""Moves a palm that has touched an object beside its grasp to that grasp, before the fingers close again."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.ports.pending import Pending
from coglab_smach.states.base import CoglabState, TimeLimit
from coglab_smach.states.hand_tracking import way_to_grasp
from coglab_smach.states.motion import shift, shift_time

FARTHEST = 0.05  # m, longest path of the palm
LEAST = 0.005  # m, a shorter path is not started
SPEED = 0.06  # m/s
PUSHES = 6.5  # N on the palm that count as an obstacle


class Regrasp(CoglabState):
    """Move the open hand straight to the grasp of the object that a person still holds, as it is seen now, by FARTHEST
    m at most. A reach ends with the first touch, which may come beside the grasp. Another reach would detect the same
    touch at once. The motion ends at a push or a time limit. Without a sight of the object nothing moves.
    """

    default_time_limit = 6.0
    owns_motion = True

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["goal"])

    def run(self, ud: Any) -> str:
        way = way_to_grasp(self, ud.goal)
        length = 0.0 if way is None else float(np.linalg.norm(way))
        if way is None or length < LEAST:
            self.reason = "the object is not seen" if way is None else "the palm is at its grasp"
            return "succeeded"
        way = way * min(1.0, FARTHEST / length)
        limit = shift_time(self.ctx, way, SPEED) + 1.0
        self.allow(limit + 3.0)
        motion = shift(self.ctx, way, SPEED)
        if motion is not None:
            over = partial(self._over, motion)
            try:
                self.wait_for(over, "the way to the grasp", limit, self.ctx.arm.speed_scale, ReasonCode.WAITS_FOR_ARM)
            except TimeLimit as error:
                # The object moves away as the palm comes: the fingers can close here too.
                self.reason = error.sentence
            self._end(motion)
        return "succeeded"

    def _over(self, motion: Pending) -> bool:
        return motion.done() or self._pushes()

    def _pushes(self) -> bool:
        force = self.ctx.contact.force()
        return force is not None and float(np.linalg.norm(force)) > PUSHES

    def _end(self, motion: Pending) -> None:
        if motion.done():
            motion.result()
        else:
            self.reason = self.reason or "something is in the way"
            self.await_pending(self.ctx.arm.cancel_motion(self.reason), "end of the way to the grasp", 2.0)
