"""How much of an object's weight has left the hand: the person's share of the load while the robot gives it.

Counted in N on the palm, from the residual of the moving arm's model (momentum_observer), so that an arm that sways or
sinks meanwhile does not begin anew. Where touch tells how much has gone, both count, and while the arm is too fast for
its torques to tell, touch alone does.
"""

from __future__ import annotations

import math

from coglab_smach.contact.grip_and_load import Felt, together

GRAVITY = 9.81
SETTLING = 0.10
"""s after arming over which the weight is averaged"""
CONFIRMED = 0.05
"""s for which the load has to be gone"""
SAME = 0.5
"""N by which the weight that was carried before the motion may seem to differ from that after it, for the posture's
sake: the model is that good"""


class LeavingLoad:
    """The share that is gone, and the moment from which it has been enough for long enough.

    It is counted from what was carried before the last motion, and once the arm stands, from what hangs on the palm
    then: unless that is more than SAME different, because somebody has been lifting or pulling already.
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
        self._doubt = SAME
        """N of what is gone that the posture alone may explain"""
        self._settled = self._here = False
        """it is final, and of the posture that the arm has"""
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

    def feed(self, stamp: float, weight: float | None, still: bool, fresh: bool, felt: Felt | None = None) -> bool:
        """One sample: s, and N on the palm, None while the arm moves too fast to tell; ``still``: the arm stands;
        ``fresh``: the samples before it do not count; ``felt``: the share by touch, None where that does not tell.
        Whether enough is gone now, said once. Where nothing tells, the share stays as it was, and what seemed gone has
        to be so anew."""
        if fresh:
            self._from, self._settled, self._count, self._since = None, False, 0, None
            self._here = False
        if weight is not None and not self._settled and (still or self._from is None):
            self._settle(stamp, weight)
        torques = None if weight is None or self._from is None else (self._from - weight) / self.weight
        share = together(torques, SAME / self.weight, felt)
        if share is None:
            self._since = None
            return False
        self.share = share
        self._doubt = 0.0 if self._here or felt is not None else SAME
        self._since = None if share < self.needed else stamp if self._since is None else self._since
        if self.told or self._since is None or stamp - self._since < CONFIRMED:
            return False
        self.told = True
        return True

    def _settle(self, stamp: float, weight: float) -> None:
        """Average what hangs on the palm, and then decide what is counted from."""
        if self._count == 0 or stamp < self._begun:
            self._begun, self._sum, self._count = stamp, 0.0, 0
        self._sum, self._count = self._sum + weight, self._count + 1
        if stamp - self._begun < SETTLING:
            return
        now, self._settled = self._sum / self._count, True
        if self._from is None or abs(now - self._from) < SAME:
            self._from, self._here = now, True
