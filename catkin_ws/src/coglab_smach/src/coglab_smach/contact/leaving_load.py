"""How much of an object's weight has left the hand: the person's share of the load while the robot gives it.

Counted in N on the palm, from the residual of the moving arm's model (momentum_observer), so that an arm that sways or
sinks meanwhile does not begin anew. Where touch tells how much has gone, both count, and while the arm is too fast for
its torques to tell, touch alone does.
"""

from __future__ import annotations

import math

import numpy as np

from coglab_smach.contact.grip_and_load import Felt, Joints, together

GRAVITY = 9.81
SETTLING = 0.10
"""s after arming over which the weight is averaged"""
CONFIRMED = 0.05
"""s for which the load has to be gone"""
SAME, FAR = 0.5, 0.2
"""N by which the weight that is told in one posture may seem to differ from that in another, and by how much (rad) a
joint has turned there, at most, where it may: the model is that good"""
PART = 1.0 / 3.0
"""of the weight that may seem to have gone or come by that, at most: who takes more has begun to take it"""


class LeavingLoad:
    """The share that is gone, and the moment from which it has been enough for long enough.

    It is counted from what was carried before the last motion, and once the arm stands, from what hangs on the palm
    then: unless that is more different than another posture explains, because somebody has been lifting or pulling
    already. An arm that turns its joints by half of FAR meanwhile, and stands, asks itself that again. What weighs less
    than SAME the torques alone do not tell from nothing: such an object is given with touch.
    """

    def __init__(self, mass: float, needed: float, until: float, carried: float | None = None) -> None:
        """``mass``: kg, of the object; ``needed``: share of its weight; ``until``: s, when the watch ends by itself;
        ``carried``: N on the palm before the last motion, None where that is not known. ValueError for what is no
        mass."""
        if not mass > 0.0:
            raise ValueError(f"release needs the mass of the object in kg, got {mass}")
        self.weight, self._asked, self.until = mass * GRAVITY, needed, until
        self.share: float | None = None
        """1: all of it; None until enough was seen to count from"""
        self.told = False
        self._from = carried
        """N, that the share is counted from"""
        self._posture: Joints = ()
        """rad, of the newest sample"""
        self._counted: Joints | None = None
        """the posture in which that weight hung on the palm; None: another one"""
        self._looked: Joints | None = None
        """the posture in which it was last asked what hangs there"""
        self._doubt = SAME
        """N of what is gone that the posture alone may explain"""
        self._sum, self._count = 0.0, 0
        self._begun = 0.0
        self._since: float | None = None

    @property
    def needed(self) -> float:
        """Share that has to be gone: what was asked for, and half of that for sure."""
        return max(self._asked, 0.5 * self._asked + self._doubt / self.weight)

    @property
    def margin(self) -> float:
        """Share that is gone over the one that is needed."""
        return (self.share or 0.0) / self.needed

    @property
    def sure(self) -> float | None:
        """The share less what is told by another posture alone, which no grip may follow: half of what a light object
        weighs. None as above."""
        if self.share is None:
            return None
        return math.copysign(max(0.0, abs(self.share) - self._doubt / self.weight), self.share)

    def feed(
        self,
        stamp: float,
        weight: float | None,
        still: bool,
        fresh: bool,
        felt: Felt | None = None,
        posture: Joints = (),
    ) -> bool:
        """One sample: s, and N on the palm, None while the arm moves too fast to tell; ``still``: the arm stands;
        ``fresh``: nothing is known of the time before; ``felt``: the share by touch, None where that does not tell;
        ``posture``: rad, of all joints. Whether enough is gone now, said once. Where nothing tells, the share stays as
        it was, but for a fresh one, and what seemed gone has to be so anew."""
        self._posture = posture
        if fresh:
            self.share, self._count, self._since = None, 0, None
        if weight is not None and (still or self._from is None) and self._turned(self._looked) > 0.5 * FAR:
            self._settle(stamp, weight)
        torques = None if weight is None or self._from is None else (self._from - weight) / self.weight
        share = together(torques, SAME / self.weight, felt)
        if share is None:
            self._since = None
            return False
        self.share = share
        self._doubt = 0.0 if felt is not None else SAME * min(1.0, self._turned(self._counted) / FAR)
        self._since = None if share < self.needed else stamp if self._since is None else self._since
        if self.told or self._since is None or stamp - self._since < CONFIRMED:
            return False
        self.told = True
        return True

    def clock_was_set(self, step: float) -> None:
        """By so many s: the watch keeps the time that it had, and what seemed gone has to be so anew."""
        self.until += step
        self._since, self._count = None, 0

    def _turned(self, since: Joints | None) -> float:
        """rad by which the joint that has turned most has turned since; inf where it is not known since when."""
        if since is None:
            return math.inf
        return float(np.max(np.abs(np.subtract(self._posture, since)), initial=0.0))

    def _settle(self, stamp: float, weight: float) -> None:
        """Average what hangs on the palm, and then decide what is counted from."""
        if self._count == 0 or stamp < self._begun:
            self._begun, self._sum, self._count = stamp, 0.0, 0
        self._sum, self._count = self._sum + weight, self._count + 1
        if stamp - self._begun < SETTLING:
            return
        now, self._looked, self._count = self._sum / self._count, self._posture, 0
        if self._from is None or abs(now - self._from) < min(SAME, PART * self.weight):
            self._from, self._counted = now, self._posture
