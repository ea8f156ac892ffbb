"""Whether the hand still holds what it carries, for states in which the arm moves with it."""

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
FARTHER = 0.15  # m by which it is farther away when it is not carried
LOST_TIME = 0.3  # s for which it is seen there
LOOK = 0.8  # s for which an arm that stands looks for what its hand may have lost
OLDEST = 0.2  # s, older sights do not tell
KEPT = 0.04  # m by which the distance of a held object from the palm changes at most
SETTLES = 0.1  # s in which a falling object moves by more


class HeldObject:
    """Call check() again and again while the arm carries ``object_id``.

    The object is gone if the fingers are open or closed to their ends, or if the tracker sees it farther from the palm
    than at first, or too far away at once: fingers do not feel what slides out of them.
    """

    def __init__(self, ctx: Context, object_id: str, grip: Grip) -> None:
        self._ctx, self._object_id, self._grip = ctx, object_id, grip
        self._sight: Pending | None = None
        self._above = 0.0  # m of the object over the palm
        self._carried: float | None = None
        self._height = self._before = self._taken = 0.0
        self.sunk = 0.0
        """m by which the object is lower against the palm than it was at first, in both of its last two sights"""
        self.moved = False
        """whether the newest sight has shown it farther from the palm, or nearer, than at first"""
        self._away_since: float | None = None
        self._kept_at = -math.inf
        """s, when the newest sight was taken that has shown it as far from the palm as the first one"""

    def check(self) -> None:
        """PortError, and nothing held any more, if the object is gone. It never waits."""
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
        """Whether a sight has shown it near the palm, and none since then elsewhere."""
        return self._carried is not None and self._away_since is None

    def stays(self, since: float) -> bool:
        """Check it; whether a sight of SETTLES after ``since`` (s) or later shows it as far from the palm as at first:
        since then it neither falls nor slides out."""
        self.check()
        return self._kept_at >= since + SETTLES

    def _lost(self, why: str) -> None:
        self._ctx.holding = ""
        self._grip.release()
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
        self._above, self._taken = float(way[2]), self._ctx.clock.now() - seen.age
        return float(np.linalg.norm(way))
