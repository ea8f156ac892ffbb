"""Whether the hand still holds what it carries, for states in which the arm moves with it."""

from __future__ import annotations

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_smach.context.context import Context
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError

NEAR, FARTHER = 0.20, 0.15
"""m between palm and object in which the object counts as carried, and by which it is farther when it is not"""
LOST_TIME = 0.3
"""s for which it is seen there"""
LOOK = 0.8
"""s for which an arm that stands looks for what its hand may have lost"""
OLDEST = 0.2
"""s, older sights do not tell"""


class HeldObject:
    """Ask it again and again while the arm carries ``object_id``.

    Two things tell that it is gone: the hand, whose fingers are open, and the tracker, which sees it away from the palm
    it was at when the asking began, or too far from it at once. Fingers that stand where they closed do not feel what
    slides out of them.
    """

    def __init__(self, ctx: Context, object_id: str) -> None:
        self._ctx, self._object_id = ctx, object_id
        self._sight: Pending | None = None
        self._above = 0.0
        """m of the object over the palm"""
        self._carried: float | None = None
        self._height = self._before = 0.0
        self.sunk = 0.0
        """m by which the object is lower against the palm than it was at first, in both of its last two sights"""
        self._away_since: float | None = None

    def check(self) -> None:
        """PortError, and an empty hand in the context, where the object is gone. It never waits."""
        hand = self._ctx.hand.state()
        if hand.connected and not hand.holding:
            self._lost(hand.message or "the fingers are open")
        distance = self._distance()
        if distance is None:
            return
        if self._carried is None:
            self._carried = distance if distance < NEAR else None
            self._height = self._before = self._above
        self.sunk, self._before = self._height - max(self._above, self._before), self._above
        # What is far away at the first sight already was lost before anybody asked.
        if distance < (NEAR if self._carried is None else self._carried) + FARTHER:
            self._away_since = None
            return
        now = self._ctx.clock.now()
        self._away_since = now if self._away_since is None else self._away_since
        if now - self._away_since >= LOST_TIME:
            self._lost(f"it is seen {distance:.2f} m from the palm")

    def there(self) -> bool:
        """Check it; False while it is not decided, because it was seen away from the palm last."""
        self.check()
        return self._away_since is None

    def seen_with_the_hand(self) -> bool:
        """Whether one sight at least has shown it near the palm, and none has since shown it elsewhere."""
        return self._carried is not None and self._away_since is None

    def _lost(self, why: str) -> None:
        self._ctx.holding, self._ctx.shared = "", False
        raise PortError(f"'{self._object_id}' has left the hand on the way", (why,), ReasonCode.OBJECT_NOT_SEEN)

    def _distance(self) -> float | None:
        """m between the palm and the object, where a new sight has come; else None."""
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
        self._above = float(way[2])
        return float(np.linalg.norm(way))
