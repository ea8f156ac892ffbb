"""Positions of the robot's palm, the object and the person's hand; identity of the hand; the handover region.

Positions are in the base frame, in m, shape (3,); None if unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose

from coglab_smach.context.context import Context
from coglab_smach.context.grip import JUMP, HandTrack, Sight, far
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import Located
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.states.base import CoglabState

NEARER = 0.02  # m by which a missed object is brought nearer to the person than it was offered
AT_HAND = 0.3  # m from the palm: a person's hand within this distance may reach the object in the robot's hand
AWAY = 0.5  # m from the palm: a person's hand beyond this distance does not hold the object in the robot's hand
GLANCE = 0.05  # s, time limit of a sight during another wait
OLDEST = 0.5  # s, oldest sight that shows the position of the hand
SWAPPED = 0.2  # s after which a sight beyond JUMP is accepted
LATELY = 0.4  # s, time window for judging whether something is held still
STILL = 0.025  # m, limit of motion of something that is held still
STILL_TIME = 0.3  # s, shortest time for which it is held still
BOARD_RADIUS = 0.35  # m around the middle of the storage board
BOARD_HEIGHT = 0.15  # m above the board; the frame of a standing object is lower


def jumped_from(last: Sight | None, now: float, place: np.ndarray) -> tuple[bool, Sight | None]:
    """Returns (True if this sight jumped, i.e. shows something else; the last sight without a jump)."""
    if last is not None and far(place, last[1]) > JUMP and now - last[0] < SWAPPED:
        return True, last
    return False, (now, place)


def palm_at(ctx: Context) -> np.ndarray | None:
    """Returns the position of the palm."""
    here = ctx.arm.joint_positions()
    return None if here is None else np.asarray(default_arm().fk(np.asarray(here))[0])


def palm_axis(ctx: Context) -> np.ndarray | None:
    """Returns the unit vector out of the palm."""
    here = ctx.arm.joint_positions()
    return None if here is None else Pose(*default_arm().fk(np.asarray(here))).axis(0)


def hand_name(ctx: Context) -> str:
    """Returns perception's name of the person's hand."""
    return ctx.config.text("perception.human_hand")


def sight_or_refusal(state: CoglabState, target: str, limit: float = 0.3) -> Located | PortError | None:
    """Returns the sight of an object or of the person's hand within ``limit`` s, or perception's refusal. None if the
    sight is older than OLDEST."""
    try:
        seen: Located = state.await_pending(
            state.ctx.perception.locate_object(target, limit),
            f"sight of '{target}'",
            limit + 0.2,
            code=ReasonCode.WAITS_FOR_SIGHT,
        )
    except PortError as error:
        return error
    return seen if seen.age <= OLDEST else None


def sight_of(state: CoglabState, target: str, limit: float = 0.3) -> Located | None:
    """The same as sight_or_refusal, but None for a refusal."""
    seen = sight_or_refusal(state, target, limit)
    return None if isinstance(seen, PortError) else seen


def seen_at(state: CoglabState, target: str) -> np.ndarray | None:
    """Returns the position of an object or of the person's hand."""
    seen = sight_of(state, target)
    return None if seen is None else np.array(seen.xyz)


def person_at(state: CoglabState) -> np.ndarray | None:
    """Returns the position of the person's hand."""
    return seen_at(state, hand_name(state.ctx))


def hand_from_palm(state: CoglabState) -> float | None:
    """Returns the distance of the person's hand from the palm."""
    person, palm = person_at(state), palm_at(state.ctx)
    return None if person is None or palm is None else far(person, palm)


def way_to_grasp(state: CoglabState, goal: Mapping[str, Any]) -> np.ndarray | None:
    """Returns the vector from the palm to its grasp of the object of ``goal``; None if the goal names no object."""
    thing, here = goal.get("object", {}), state.ctx.arm.joint_positions()
    if not thing or here is None:
        return None
    seen = sight_of(state, str(thing["frame"]).removeprefix("object_"), GLANCE)
    if seen is None:
        return None
    grasp = Pose(np.array(seen.xyz), np.array(seen.quaternion)) * Pose.from_dict(thing["grasp"])
    return np.asarray(grasp.position - default_arm().fk(np.asarray(here))[0])


def off_grasp(state: CoglabState, goal: Mapping[str, Any]) -> float | None:
    """Returns the length of way_to_grasp()."""
    way = way_to_grasp(state, goal)
    return None if way is None else float(np.linalg.norm(way))


def way_to_hand(state: CoglabState, object_id: str, delivery: Mapping[str, Any]) -> np.ndarray | None:
    """Returns the vector from the object to the delivery's place at the hand as seen now, but NEARER to the person."""
    hand, thing = hand_name(state.ctx), seen_at(state, object_id)
    try:
        seen = state.await_pending(
            state.ctx.perception.locate_object(hand, 0.3), f"sight of '{hand}'", 0.5, code=ReasonCode.WAITS_FOR_SIGHT
        )
    except PortError:
        return None
    if thing is None or seen.age > OLDEST:
        return None
    x, y, z = delivery["pose"]["xyz"]
    nearer = max(0.0, 1.0 - NEARER / max(NEARER, math.hypot(x, y)))
    offered = Pose(np.array(seen.xyz), np.array(seen.quaternion)).apply(np.array([nearer * x, nearer * y, z]))
    return np.asarray(offered) - thing


class HandLook:
    """Follows the person's hand from sight to sight, without waiting for one."""

    def __init__(self, ctx: Context, track: HandTrack) -> None:
        self._ctx, self._track = ctx, track
        self._sight: Pending | None = None

    def look(self) -> None:
        """Process a new sight, if there is one. Call this repeatedly."""
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
    """Add a sight to the track. Returns the distance of the hand from the palm, m."""
    place = np.array(seen.xyz)
    away = far(place, palm)
    track.follow(ctx.clock.now() - seen.age, place, away <= AT_HAND)
    return away


def from_palm(state: CoglabState, track: HandTrack, limit: float = GLANCE) -> float | None:
    """Returns the distance (m) of the tracked hand from the palm, from a new sight within ``limit`` s. None if the
    sight shows another hand."""
    seen, palm = sight_of(state, hand_name(state.ctx), limit), palm_at(state.ctx)
    if seen is None or palm is None:
        return None
    away = _follow(state.ctx, track, seen, palm)
    return away if track.is_one else None


def stands_on_board(state: CoglabState, place: np.ndarray) -> bool:
    """True if an object at this place (m, base frame) stands on the storage board. False if no board is in sight."""
    board = sight_of(state, state.ctx.config.text("perception.board"), 0.05)
    if board is None:
        return False
    x, y, z = (Pose(np.array(board.xyz), np.array(board.quaternion)).inverse() * Pose(place)).position
    return bool(np.hypot(x, y) <= BOARD_RADIUS and z <= BOARD_HEIGHT)


class HandoverRegion:
    """The handover region, a box in the base frame, and recent sights there. An object that is held still counts as
    offered up to ``handover.still_margin`` m outside. A moving or predicted one must be inside."""

    def __init__(self, ctx: Context, margin: float = 0.0) -> None:
        """``margin`` (m) widens the region on all sides: a hand is behind the object that it holds or requests."""
        config = ctx.config
        self.low = np.array(config.get("handover.region_low"), dtype=float) - margin
        self.high = np.array(config.get("handover.region_high"), dtype=float) + margin
        self._still_margin = config.number("handover.still_margin")
        self._seen: list[tuple[float, np.ndarray]] = []

    def holds(self, place: Sequence[float] | np.ndarray, wider: float = 0.0) -> bool:
        """True if a place is inside the region, or at most ``wider`` m outside."""
        return bool(np.all(place >= self.low - wider) and np.all(place <= self.high + wider))

    def offers(self, now: float, place: np.ndarray, moving: bool = True) -> bool:
        """Returns whether something seen at ``place`` at time ``now`` (s) is offered. Call this for each sight. If not
        ``moving``, only things that are held still count."""
        self._seen = [(t, p) for t, p in self._seen if now - t <= LATELY] + [(now, place)]
        since, first = self._seen[0]
        still = now - since > STILL_TIME and far(place, first) < STILL
        return (moving or still) and self.holds(place, self._still_margin if still else 0.0)

    def limits(self, place: Sequence[float] | np.ndarray) -> dict[str, Any]:
        """Returns the region for the goal of a reach to ``place``. If the place is outside, the object was held still
        there: the region is widened by the margin of such objects."""
        wider = 0.0 if self.holds(place) else self._still_margin
        return {
            "goal_region_low": (self.low - wider).tolist(),
            "goal_region_high": (self.high + wider).tolist(),
        }


def anything_believed(ctx: Context) -> bool:
    """True if the person seems to offer or to request something."""
    ahead = ctx.perception.ahead()
    return max(ahead.offer, ahead.request) >= ctx.config.number("handover.doubt")


def ends_outside(ctx: Context, region: HandoverRegion, frame: str) -> bool:
    """True if the person's reach with ``frame`` is predicted to end outside the region."""
    ahead = ctx.perception.ahead()
    return anything_believed(ctx) and ahead.frame == f"{frame}_ahead" and not region.holds(ahead.place)


def unless_withdrawn(
    ctx: Context, goal: Mapping[str, Any], margin: float = 0.0, may_fall: bool = True
) -> dict[str, Any]:
    """Returns the goal with the limits at which its motion ends by itself: the goal leaves the region, goes back or,
    with ``may_fall``, falls. ``goal`` contains the position (m) of its frame when it was offered."""
    margins = {
        "goal_retreat": ctx.config.number("handover.retreat"),
        "goal_drop": ctx.config.number("handover.drop") if may_fall else 0.0,
    }
    limits = HandoverRegion(ctx, margin).limits(goal["place"])
    watch = {"retreat": margins["goal_retreat"], "drop": margins["goal_drop"], "margin": margin}
    # A predicted place moves with each correction of the prediction. Therefore, the state that waits for the reach
    # checks the sights for going back and falling.
    predicted = str(goal["frame"]).endswith("_ahead")
    return {**goal, "limits": {**limits, **(dict.fromkeys(margins, 0.0) if predicted else margins)}, "watch": watch}
