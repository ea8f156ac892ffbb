"""States that compute a goal from the object database and perception."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode, Say
from coglab_objects.database import ObjectError, checked_delivery
from coglab_py.pose import Pose, mean_pose

from coglab_smach.context.context import Context
from coglab_smach.context.grip import Grip
from coglab_smach.context.journal import Wait
from coglab_smach.kinematics.goals import approach_of, delivery_goal, grasp_goal, palm_at_grasp, place_goal, ranked
from coglab_smach.ports.pending import PortError
from coglab_smach.states.base import CoglabState
from coglab_smach.states.hand import closes_gently, firm_speed, gentle
from coglab_smach.states.hand_tracking import (
    HandoverRegion,
    ends_outside,
    hand_name,
    palm_at,
    person_at,
    stands_on_board,
    unless_withdrawn,
)

Goals = Callable[[Mapping[str, Any]], list[dict[str, Any]]]
"""returns the goals for a sight, best first"""


class InitVision(CoglabState):
    """coglab_init_vision: start the perception modules."""

    default_time_limit = 30.0

    def run(self, ud: Any) -> str:
        self.reason = str(
            self.await_pending(
                self.ctx.perception.init_vision(self.left()), "start of perception", code=ReasonCode.WAITS_FOR_SIGHT
            )
        )
        return "succeeded"


class QueryDatabase(CoglabState):
    """Read the object's entry. Its default grasp is stored in user data for all later states."""

    default_time_limit = 5.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id"], output_keys=["object_entry", "grasp", "grasp_name"])

    def run(self, ud: Any) -> str:
        with refused_as(ReasonCode.OBJECT_UNKNOWN):
            entry = self.await_pending(self.ctx.database.get_object(ud.object_id), f"entry of object '{ud.object_id}'")
        name = entry["default_grasp"]
        ud.object_entry = entry
        ud.grasp_name = name
        ud.grasp = entry["grasps"][name]
        return "succeeded"


class LocateOnBoard(CoglabState):
    """Locate the object on the board, averaged over several sights. User data receives its pose in the board frame.

    Board and object do not move. Therefore, the goal of the precise motion follows neither a single noisy sight nor an
    object that the hand pushes.
    """

    default_time_limit = 12.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id"], output_keys=["located"])

    def run(self, ud: Any) -> str:
        board = locate(self, self.ctx.config.text("perception.board"))
        count = self.ctx.config.get("take.sights")
        sights = []
        for i in range(max(1, count)):
            if i:
                self.pause(0.08)
            sights.append(Pose.from_dict(locate(self, ud.object_id)))
        on_board = Pose.from_dict(board).inverse() * mean_pose(sights)
        ud.located = {"frame": board["frame"], **on_board.to_dict()}
        return "succeeded"


@contextmanager
def refused_as(code: int) -> Iterator[None]:
    """A refusal inside the block gets this ReasonCode if the port has not set one."""
    try:
        yield
    except PortError as error:
        error.code = error.code or code
        raise


def locate(state: CoglabState, target: str) -> dict[str, Any]:
    """Wait until perception sees ``target`` (object id or 'human_hand'). Returns a plain dict for user data."""
    limit = state.ctx.config.number("perception.locate_timeout")
    with refused_as(ReasonCode.OBJECT_NOT_SEEN):
        found = state.await_pending(
            state.ctx.perception.locate_object(target, limit),
            f"sight of '{target}'",
            limit + 1.0,
            code=ReasonCode.WAITS_FOR_SIGHT,
        )
    oldest = state.ctx.config.number("perception.max_age")
    if found.age > oldest:
        raise PortError(
            f"'{target}' was last seen {found.age:.2f} s ago, expected at most {oldest} s",
            ("the tracker has lost it; bring it into view",),
            ReasonCode.OBJECT_NOT_SEEN,
        )
    return {
        "frame": found.frame,
        "parent": found.parent,
        "xyz": list(found.xyz),
        "quaternion": list(found.quaternion),
        "age": found.age,
    }


def await_offer(state: CoglabState, target: str, goals: Goals, margin: float = 0.0) -> dict[str, Any]:
    """Wait for an offer. ``target`` must be inside the handover region, so that the arm does not chase a resting hand.
    The arm must have a posture for one of ``goals``, so that the hand does not hit the person. Both must hold for
    ``handover.start_after`` s. Returns that goal.

    An object that stands on the board is not offered. One that is held still slightly outside the region counts too.
    ``margin`` (m) widens the region: a hand is behind the object that it holds or requests. PortError if nobody comes
    within ``handover.offer_timeout`` s; the arm has not moved then.
    """
    config = state.ctx.config
    region = HandoverRegion(state.ctx, margin)
    limit = config.number("handover.offer_timeout")
    end = state.ctx.clock.now() + limit
    since: float | None = None
    person = target == hand_name(state.ctx)
    offer = "the person's hand within reach" if person else f"'{target}' on offer"
    with state.ctx.journal.waiting(
        f"{state.path()}/{state.label}/offer", Wait(offer, end, ReasonCode.WAITS_FOR_PERSON)
    ):
        while True:
            located = locate(state, target)
            now, place = state.ctx.clock.now(), np.array(located["xyz"])
            passes = ends_outside(state.ctx, region, located["frame"])
            offered = region.offers(now - located["age"], place, moving=not passes)
            stands = offered and not person and stands_on_board(state, place)
            offered = offered and not stands
            early = believed(state.ctx, target, located, person, region)
            candidates = goals(located)
            goal = first_reachable(state.ctx, located, candidates) if offered else None
            if goal is None and early is not None:
                goal = first_reachable(state.ctx, early, candidates)
            since = None if goal is None else now if since is None else since
            if goal is not None and since is not None:
                state.ctx.journal.mark("offered")
                if now - since >= config.number("handover.start_after"):
                    return goal
            if now > end and offered and goal is None:
                raise PortError(*out_of_reach(target, located, candidates[0]), ReasonCode.GOAL_UNREACHABLE)
            if now > end and stands:
                raise PortError(
                    f"'{target}' was not offered within {limit:.0f} s: it stands on the board",
                    ("nobody holds it out; hold it out to the robot, or request take",),
                    ReasonCode.OBJECT_NOT_SEEN,
                )
            if now > end and goal is None:
                where = ", ".join(f"{v:.2f}" for v in place)
                raise PortError(
                    f"'{target}' was not offered within {limit:.0f} s: it stayed at ({where}) m, outside the "
                    "handover region",
                    ("nobody reaches toward the robot",),
                    ReasonCode.OBJECT_NOT_SEEN,
                )
            state.pause(0.03)


def believed(
    ctx: Context, target: str, located: Mapping[str, Any], person: bool, region: HandoverRegion
) -> dict[str, Any] | None:
    """Returns the predicted place of ``target`` in a handover that is believed to have begun: its predicted frame, with
    the orientation as seen now. None if there is no belief, or if the place is outside the handover region."""
    level = ctx.config.number("handover.belief")
    if person:
        # A requesting hand carries nothing: only its motion distinguishes it from a pointing hand.
        request = ctx.config.get("handover.belief_request")
        level = level if request is None else float(request)
    ahead = ctx.perception.ahead()
    mine = (ahead.request if person else ahead.offer) >= level and (person or ahead.object_id == target)
    if level <= 0.0 or not (mine and ahead.frame and region.holds(ahead.place)):
        return None
    return {**located, "frame": ahead.frame, "xyz": list(ahead.place)}


def palm_of(seen: Mapping[str, Any], goal: Mapping[str, Any]) -> Pose:
    """Returns the pose of the palm in the base frame, for the goal's frame as it was seen."""
    return Pose.from_dict(seen) * Pose.from_dict({"xyz": goal["offset"], "quaternion": goal["orientation"]})


def first_reachable(ctx: Context, seen: Mapping[str, Any], goals: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Returns the first goal for which the arm has a posture, relative to the sight. If ``handover.check_reach`` is
    false, returns the first one."""
    unchecked = not ctx.config.get("handover.check_reach")
    for goal in goals:
        if unchecked or ctx.reachable(palm_of(seen, goal)):
            return {**goal, "frame": seen["frame"], "place": list(seen["xyz"])}
    return None


def out_of_reach(target: str, seen: Mapping[str, Any], goal: Mapping[str, Any]) -> tuple[str, tuple[str, ...]]:
    """Returns sentence and cause for an offer that the arm cannot reach."""
    where = ", ".join(f"{v:.2f}" for v in palm_of(seen, goal).position)
    return (
        f"'{target}' cannot be reached: the arm has no posture for the hand at ({where}) m turned like that",
        ("it is too far, or turned so that the grasp points away from the robot; turn or move it",),
    )


def paced(ctx: Context, goal: dict[str, Any]) -> dict[str, Any]:
    """Returns the goal at a person's pace: ``handover.reach_ratio`` times the object's own dmp_ratio, and a low arrival
    speed, so that a touch is light."""
    ratio = goal["dmp_ratio"] * ctx.config.number("handover.reach_ratio")
    return {**goal, "dmp_ratio": ratio, "arrival_speed": ctx.config.number("handover.arrival_speed")}


class SetGraspGoal(CoglabState):
    """DMP goal from the best of the object's grasps, or from its nominal one (``grasp.choice``): the palm
    relative to the tracked object frame, ``handover.standoff`` m in front of it. Meanwhile the hand moves to the
    preshape of that grasp, so that it is open on arrival.

    Ends when the object is offered, i.e. inside the handover region: the arm must not chase an object that rests with
    the person. If nobody offers it within the limit, the state fails. The arm has not moved then.
    """

    default_time_limit = 20.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(
            ctx,
            input_keys=["object_id", "object_entry"],
            output_keys=["goal", "grasp", "grasp_name"],
            io_keys=["grip"],
        )
        self._grasp_name = ""

    def run(self, ud: Any) -> str:
        self.ctx.say(Say.READY_TO_RECEIVE, f"Please hand me the object '{ud.object_id}'.")
        entry, self._grasp_name = ud.object_entry, ""
        goal = await_offer(self, ud.object_id, lambda seen: self._goals(entry, seen, ud.grip))
        name = goal.pop("grasp_name")
        grasp = entry["grasps"][name]
        hand = {**gentle(grasp), "firm": firm_speed(self.ctx, entry, name)}
        ud.grasp_name, ud.grasp = name, {**grasp, "hand": hand}
        self.reason = f"grasp '{name}'"
        # The detector checks whether the object is in the palm, for seen and predicted goals.
        grasped = {"frame": goal["frame"].removesuffix("_ahead"), "grasp": palm_at_grasp(grasp, 0.0).to_dict()}
        ud.goal = unless_withdrawn(self.ctx, {**goal, "object": grasped})
        return "succeeded"

    def _goals(self, entry: Mapping[str, Any], seen: Mapping[str, Any], grip: Grip) -> list[dict[str, Any]]:
        """Returns one goal for each grasp of the object as it was seen, best first."""
        config = self.ctx.config
        if config.text("grasp.choice") == "nominal":
            names = [entry["default_grasp"]]
        else:
            names = ranked(entry, Pose.from_dict(seen), person_at(self), palm_at(self.ctx), self._grasp_name)
            # Modes that some hands have only as firm are used only for objects without another mode.
            names = [name for name in names if closes_gently(entry["grasps"][name])] or names
        if names[0] != self._grasp_name:
            self._grasp_name, hand = names[0], gentle(entry["grasps"][names[0]])
            grip.preshaped = False
            self.ctx.hand.preshape(hand["mode"], hand["level"])  # awaited in the approach
        goals = []
        for name in names:
            grasp = entry["grasps"][name]
            standoff = config.number("handover.standoff")
            goal = paced(self.ctx, grasp_goal(entry, grasp, "", "receive", standoff))
            approach = approach_of(grasp, config.number("handover.approach"))
            goals.append({**goal, "approach": approach, "grasp_name": name})
        return goals


def off_the_board(state: CoglabState, goal: dict[str, Any]) -> dict[str, Any]:
    """Returns the goal in the board frame, raised so that hand and forearm stay ``board.room`` m above the board. This
    corrects objects that are seen slightly tilted or low. PortError if the lift exceeds ``board.lift`` m."""
    config = state.ctx.config
    board = Pose.from_dict(locate(state, config.text("perception.board")))
    room, most = config.number("board.room"), config.number("board.lift")
    offset = Pose.from_dict({"xyz": goal["offset"], "quaternion": goal["orientation"]})
    lift, palm = state.ctx.raised(board, board * offset, room, most)
    if palm is None:
        raise PortError(
            f"hand or forearm would run into the board: the goal would have to rise by at least {1000 * lift:.0f} mm "
            f"to keep {1000 * room:.0f} mm off it, expected at most {1000 * most:.0f} mm",
            ("the object lies, or is seen tilted or too low; stand it up, or check where the board is seen",),
            ReasonCode.GOAL_AT_BOARD,
        )
    if lift == 0.0:
        return goal
    state.reason = f"raised by {1000 * lift:.1f} mm, off the board"
    return {**goal, "offset": (board.inverse() * palm).to_dict()["xyz"]}


class SetTakeGoal(CoglabState):
    """DMP goal in the board frame, from detection and database, with a small clearance between palm and object. The
    last part of the path follows the grasp's approach axis."""

    default_time_limit = 8.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_entry", "grasp", "located"], output_keys=["goal"])

    def run(self, ud: Any) -> str:
        clearance = self.ctx.config.number("take.clearance")
        goal = off_the_board(self, place_goal(ud.object_entry, ud.grasp, ud.located, "take", clearance))
        # From above, the fingers would land on objects that are wider than the opening of the hand.
        way = approach_of(ud.grasp, self.ctx.config.number("take.approach"))
        ud.goal = {**goal, "approach": Pose.from_dict(ud.located).rotation.apply(way).tolist()}
        return "succeeded"


class SetDeliveryGoal(CoglabState):
    """DMP goal from the delivery mode: the pose of the palm, relative to the person's hand, that offers the object.
    The request names the delivery, or it is the object's default.

    Ends when the person's hand is in the handover region: before, nobody requests the object.
    """

    default_time_limit = 20.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(
            ctx,
            input_keys=["object_entry", "grasp"],
            output_keys=["goal", "delivery"],
            io_keys=["delivery_name"],
        )

    def run(self, ud: Any) -> str:
        entry, grasp = ud.object_entry, ud.grasp
        self.ctx.say(Say.READY_TO_GIVE, "Please take the object out of my hand.")
        name = ud.delivery_name or entry["default_delivery"]
        self.reason = f"delivery '{name}'"
        self.ctx.journal.delivers(name)

        def goals(seen: Mapping[str, Any]) -> list[dict[str, Any]]:
            ud.delivery = delivery = self._delivery(name, entry, seen)
            return [paced(self.ctx, delivery_goal(entry, grasp, delivery, ""))]

        margin = self.ctx.config.number("handover.hand_margin")
        hand = hand_name(self.ctx)
        # A hand does not fall. A sinking hand has moved lower and is followed, or has gone back.
        asked = await_offer(self, hand, goals, margin)
        goal = unless_withdrawn(self.ctx, asked, margin, may_fall=False)
        ud.delivery_name = name
        ud.goal = goal
        return "succeeded"

    def _delivery(self, name: str, entry: Mapping[str, Any], seen: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns a delivery of the object's file, or the user's one for the hand as it is seen. PortError if there is
        none of that name, or if the user's is no delivery."""
        mine = self.ctx.parts.deliveries.get(name)
        if mine is None:
            if name not in entry["deliveries"]:
                raise PortError(
                    f"'{entry['id']}' has no delivery '{name}'; it has: {', '.join(entry['deliveries'])}",
                    code=ReasonCode.UNKNOWN_NAME,
                )
            return entry["deliveries"][name]
        try:
            return checked_delivery(mine(entry, Pose.from_dict(seen)), f"deliveries.{name}")
        except ObjectError as error:
            raise PortError(str(error), code=ReasonCode.BAD_FILE) from None


class FindPlace(CoglabState):
    """Request a free place on the board from perception (Figure 8)."""

    default_time_limit = 8.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_id"], output_keys=["place"])

    def run(self, ud: Any) -> str:
        limit = self.ctx.config.number("perception.locate_timeout")
        places = self.await_pending(
            self.ctx.perception.free_places(ud.object_id, limit),
            "a free place on the board",
            limit + 1.0,
            code=ReasonCode.WAITS_FOR_SIGHT,
        )
        if not places:
            raise PortError("perception names no free place on the board; clear one", code=ReasonCode.NO_FREE_PLACE)
        best = places[0]
        ud.place = {"frame": best.parent, "xyz": list(best.xyz), "quaternion": list(best.quaternion)}
        return "succeeded"


class SetPlaceGoal(CoglabState):
    """DMP goal from a free place: the pose of the palm that puts the held object there."""

    default_time_limit = 8.0

    def __init__(self, ctx: Context) -> None:
        super().__init__(ctx, input_keys=["object_entry", "grasp", "place"], output_keys=["goal"])

    def run(self, ud: Any) -> str:
        ud.goal = off_the_board(self, place_goal(ud.object_entry, ud.grasp, ud.place, "put"))
        return "succeeded"
