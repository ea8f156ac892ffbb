"""Checks that the hand still holds its object while the arm moves with it."""

from __future__ import annotations

import math

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.hand import AT_END

NEAR = 0.20  # m between palm and object within which the object counts as carried
FARTHER = 0.15  # m, increase of that distance at which the object counts as lost
LOST_TIME = 0.3  # s for which the object must be seen that far away
LOOK = 0.8  # s for which a standing arm looks for a possibly lost object
OLDEST = 0.2  # s, oldest sight that counts
KEPT = 0.04  # m, limit for changes of a held object's distance from the palm
SETTLES = 0.1  # s in which a falling object moves by more than KEPT


class HeldObject:
    """Call check() repeatedly while the arm carries ``object_id``.

    The object is lost if the fingers are open or closed to their ends, or if the tracker sees it farther from the palm
    than at first, or too far away at the first sight. The fingers cannot detect an object that slides out.
    """

    def __init__(self, ctx: Context, object_id: str, grip: Grip) -> None:
        self._ctx, self._object_id, self._grip = ctx, object_id, grip
        self._sight: Pending | None = None
        self._above = 0.0  # m, height of the object above the palm
        self._carried: float | None = None
        self._height = self._before = self._taken = 0.0
        self.sunk = 0.0
        """m by which the object has sunk relative to the palm since the first sight, in both of the last two sights"""
        self.moved = False
        """True if the newest sight shows the object farther from or nearer to the palm than at first"""
        self._away_since: float | None = None
        self._kept_at = -math.inf
        """time (s) of the newest sight that shows the object as far from the palm as at first"""

    def check(self) -> None:
        """PortError if the object is lost; then nothing is held. Never waits."""
        hand = self._ctx.hand.state()
        if hand.connected and not hand.holding:
            self._lost(hand.message or "the fingers are open")
        if hand.connected and hand.positions and min(hand.positions[1:]) >= AT_END:
            self._lost("the fingers have closed past it")
        distance = self._distance()
        if distance is None:
            return
        if self._carried is None:
            self._carried = distance if distance < NEAR else None
            self._height = self._before = self._above
        self.sunk, self._before = self._height - max(self._above, self._before), self._above
        self.moved = self._carried is not None and abs(distance - self._carried) >= KEPT
        if self._carried is not None and not self.moved:
            self._kept_at = self._taken
        # An object that is far away already at the first sight was lost before the first check.
        if distance < (NEAR if self._carried is None else self._carried) + FARTHER:
            self._away_since = None
            return
        now = self._ctx.clock.now()
        self._away_since = now if self._away_since is None else self._away_since
        if now - self._away_since >= LOST_TIME:
            self._lost(f"it is seen {distance:.2f} m from the palm")

    def there(self) -> bool:
        """Check the object. False while it is undecided, because the last sight shows it away from the palm."""
        self.check()
        return self._away_since is None

    def seen_with_the_hand(self) -> bool:
        """True if a sight has shown the object near the palm, and no later one elsewhere."""
        return self._carried is not None and self._away_since is None

    def stays(self, since: float) -> bool:
        """Check the object. True if a sight from at least SETTLES after ``since`` (s) shows it as far from the palm as
        at first: then it neither falls nor slides out."""
        self.check()
        return self._kept_at >= since + SETTLES

    def _lost(self, why: str) -> None:
        self._ctx.holding = ""
        self._grip.release()
        raise PortError(f"'{self._object_id}' has left the hand on the way", (why,), ReasonCode.OBJECT_NOT_SEEN)

    def _distance(self) -> float | None:
        """Returns the distance (m) between palm and object if there is a new sight, else None."""
        if self._sight is None:
            self._sight = self._ctx.perception.locate_object(self._object_id, 0.2)
        if not self._sight.done():
            return None
        sight, self._sight = self._sight, None
        here = self._ctx.arm.joint_positions()
        try:
            seen = sight.result()
        except PortError:
            return None
        if here is None or seen.age > OLDEST:
            return None
        way = np.array(seen.xyz) - default_arm().fk(np.asarray(here))[0]
        self._above, self._taken = float(way[2]), self._ctx.clock.now() - seen.age
        return float(np.linalg.norm(way))
