"""Where the robot's palm and the person's hand are now, in the base frame; None where that is not known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from coglab_smach.context.awaited import SIGHT
from coglab_smach.context.context import Context
from coglab_smach.context.hand_track import JUMP, HandTrack, Sight
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import Located
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState

NEARER = 0.02
"""m by which what a person has missed is brought nearer than it was offered"""
AT_HAND = 0.3
"""m from the palm in which a person's hand may reach what is in it"""
AWAY = 0.5
"""m from the palm: a person's hand that is seen there holds nothing that is in the robot's"""
GLANCE = 0.05
"""s that a look may take beside which something else is waited for"""
OLDEST = 0.5
"""s, an older sight does not tell where the hand is"""
SWAPPED = 0.2
"""s for which sights stay where nothing goes from one to the next (JUMP), until they are believed"""


def palm_at(ctx: Context) -> np.ndarray | None:
    """m."""
    here = ctx.arm.joint_positions()
    return None if here is None else np.asarray(default_arm().fk(np.asarray(here))[0])


def palm_axis(ctx: Context) -> np.ndarray | None:
    """Unit vector, out of the palm."""
    here = ctx.arm.joint_positions()
    return None if here is None else Pose(*default_arm().fk(np.asarray(here))).axis(0)


def off_grasp(state: CoglabState, goal: Mapping[str, Any]) -> float | None:
    """m from the palm to where it would hold the object that a reach is for; None where the goal names no object."""
    way = way_to_grasp(state, goal)
    return None if way is None else float(np.linalg.norm(way))


def way_to_grasp(state: CoglabState, goal: Mapping[str, Any]) -> np.ndarray | None:
    """off_grasp() as a vector (m, base frame)."""
    thing, here = goal.get("object", {}), state.ctx.arm.joint_positions()
    if not thing or here is None:
        return None
    name = str(thing["frame"]).removeprefix("object_")
    seen = sight_of(state, name, GLANCE)
    if seen is None:
        return None
    grasp = Pose(np.array(seen.xyz), np.array(seen.quaternion)) * Pose.from_dict(thing["grasp"])
    return np.asarray(grasp.position - default_arm().fk(np.asarray(here))[0])


def person_at(state: CoglabState) -> np.ndarray | None:
    """m."""
    return seen_at(state, hand_name(state.ctx))


def hand_name(ctx: Context) -> str:
    """Of the person's hand, as perception names it."""
    return str(ctx.config.get("perception.human_hand", "human_hand"))


def sight_or_refusal(state: CoglabState, target: str, limit: float = 0.3) -> Located | PortError | None:
    """Of an object or of the person's hand as perception names it, OLDEST s old at most; perception's own words where
    it has none within ``limit`` s."""
    try:
        seen: Located = state.await_pending(
            state.ctx.perception.locate_object(target, limit), f"sight of '{target}'", limit + 0.2, code=SIGHT
        )
    except PortError as error:
        return error
    return seen if seen.age <= OLDEST else None


def sight_of(state: CoglabState, target: str, limit: float = 0.3) -> Located | None:
    """The same, None for a refusal."""
    seen = sight_or_refusal(state, target, limit)
    return None if isinstance(seen, PortError) else seen


def seen_at(state: CoglabState, target: str) -> np.ndarray | None:
    """m, of an object or of the person's hand as perception names it."""
    seen = sight_of(state, target)
    return None if seen is None else np.array(seen.xyz)


def hand_from_palm(state: CoglabState) -> float | None:
    """m from the person's hand to the palm."""
    person, palm = person_at(state), palm_at(state.ctx)
    return None if person is None or palm is None else float(np.linalg.norm(person - palm))


def jumped_from(last: Sight | None, now: float, place: np.ndarray) -> tuple[bool, Sight | None]:
    """Whether a sight is of something else than the last one that was no jump, and the one that is now."""
    if last is not None and float(np.linalg.norm(place - last[1])) > JUMP and now - last[0] < SWAPPED:
        return True, last
    return False, (now, place)


class HandLook:
    """Follows the person's hand from sight to sight, without waiting for one."""

    def __init__(self, ctx: Context, track: HandTrack) -> None:
        self._ctx, self._track = ctx, track
        self._sight: Pending | None = None

    def look(self) -> None:
        """Call it again and again."""
        if self._sight is None:
            self._sight = self._ctx.perception.locate_object(hand_name(self._ctx), GLANCE)
        if not self._sight.done():
            return
        sight, self._sight = self._sight, None
        try:
            seen: Located = sight.result()
        except PortError:
            return
        palm = palm_at(self._ctx)
        if seen.age <= OLDEST and palm is not None:
            _follow(self._ctx, self._track, seen, palm)


def _follow(ctx: Context, track: HandTrack, seen: Located, palm: np.ndarray) -> float:
    """m from the hand to the palm."""
    place = np.array(seen.xyz)
    away = float(np.linalg.norm(place - palm))
    track.follow(ctx.clock.now() - seen.age, place, away <= AT_HAND)
    return away


def from_palm(state: CoglabState, track: HandTrack, limit: float = GLANCE) -> float | None:
    """m from the hand that is followed to the palm, by one more sight within ``limit`` s; None where that is not known,
    or where the sight is another hand's."""
    seen, palm = sight_of(state, hand_name(state.ctx), limit), palm_at(state.ctx)
    if seen is None or palm is None:
        return None
    away = _follow(state.ctx, track, seen, palm)
    return away if track.is_one else None


def way_to_hand(state: CoglabState, object_id: str, delivery: Mapping[str, Any]) -> np.ndarray | None:
    """m, base frame: from where the object is seen to NEARER than where the delivery offers it to the person's hand as
    that is seen now. None where one of them is not."""
    hand = hand_name(state.ctx)
    thing = seen_at(state, object_id)
    try:
        seen = state.await_pending(state.ctx.perception.locate_object(hand, 0.3), f"sight of '{hand}'", 0.5, code=SIGHT)
    except PortError:
        return None
    if thing is None or seen.age > OLDEST:
        return None
    x, y, z = delivery["pose"]["xyz"]
    nearer = max(0.0, 1.0 - NEARER / max(NEARER, math.hypot(x, y)))
    offered = Pose(np.array(seen.xyz), np.array(seen.quaternion)).apply(np.array([nearer * x, nearer * y, z]))
    return np.asarray(offered) - thing
