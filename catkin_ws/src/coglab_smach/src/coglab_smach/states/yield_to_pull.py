"""Yielding to a person who pulls at the object in the robot's hand."""

from __future__ import annotations

import numpy as np

from coglab_smach.context.context import Context
from coglab_smach.ports.pending import Pending
from coglab_smach.states.hand_tracking import palm_at, palm_axis
from coglab_smach.states.motion import shift

LEAST_WAY = 0.005  # m, a shorter path is not started


class YieldToPull:
    """Coordinates the motions of an arm beside a person. The state starts its motion with ``begin``. When somebody
    pulls, the palm moves along with the pull (``follow``, called repeatedly), by at most ``pull.way`` m in total.

    Each motion ends, and the set-point stands still, before the next one starts. The pull is the measured contact force
    without its vertical part (the object's weight and the lift) and without its part into the palm (a person who gives
    the object presses).
    """

    def __init__(self, ctx: Context) -> None:
        self._ctx = ctx
        self._motion: Pending | None = None
        self._ending: Pending | None = None
        self._from: np.ndarray | None = None  # m, position of the palm at the start of yielding; None: not yielding
        self._went = np.zeros(3)  # m, total yielding so far
        self._since: float | None = None  # s, start of the pull

    def _number(self, name: str) -> float:
        return self._ctx.config.number(f"pull.{name}")

    def pull(self) -> np.ndarray:
        """Returns the horizontal pull (N, base frame); zero if the force is unknown."""
        force = self._ctx.contact.force()
        outward = palm_axis(self._ctx)
        if force is None or outward is None:
            return np.zeros(3)
        pull = np.array(force) - min(0.0, float(outward @ force)) * outward
        return pull * (1.0, 1.0, 0.0)

    def begin(self, motion: Pending | None) -> None:
        """Set the motion of the state. Only while no other motion runs."""
        self._motion = motion

    def halt(self, why: str) -> None:
        """End the motion of the state. A yielding palm continues."""
        if self._from is None and self._ending is None and not self.idle():
            self._end(why)

    def idle(self) -> bool:
        """True if no motion runs, not even to its end."""
        if self._ending is not None and self._ending.done():
            self._ending = self._motion = None
        if self._motion is not None and self._from is None and self._ending is None and self._motion.done():
            self._motion = None
        return self._motion is None and self._ending is None

    def follow(self) -> None:
        """Start, continue or end yielding, depending on the pull."""
        pull, now = self.pull(), self._ctx.clock.now()
        size = float(np.linalg.norm(pull))
        if self._from is not None:
            assert self._motion is not None
            if size < self._number("ends") or self._motion.done():
                self._end("the pull is over")
            return
        self._since = None if size <= self._number("begins") else now if self._since is None else self._since
        if self._since is None or now - self._since < self._number("time"):
            return
        way = self._way(pull / size)
        if way is None:
            return
        if not self.idle():
            if self._ending is None:
                self._end("somebody pulls")
            return
        self._from = palm_at(self._ctx)
        self._motion = shift(self._ctx, way, self._number("speed")) if self._from is not None else None
        self._from = self._from if self._motion is not None else None
        self._ctx.journal.mark("gave_way")

    def _way(self, direction: np.ndarray) -> np.ndarray | None:
        """Returns the vector (m) by which the palm may still yield; None if it has yielded far enough."""
        most = self._number("way")
        there = self._went + most * direction
        way = there * min(1.0, most / max(float(np.linalg.norm(there)), 1e-9)) - self._went
        return way if float(np.linalg.norm(way)) > LEAST_WAY else None

    def _end(self, why: str) -> None:
        """End the motion. The next one must wait until the set-point stands still."""
        here = palm_at(self._ctx)
        if self._from is not None and here is not None:
            self._went = self._went + here - self._from
        self._from = None
        self._ending = self._ctx.arm.cancel_motion(why)

    def stop(self) -> None:
        """End all motion."""
        if not self.idle() and self._ending is None:
            self._end("no pull is to be followed any more")
