"""When an object counts as offered, predicted places, and the goals for them."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import Ahead, Located
from coglab_smach.ports.pending import PortError, Ready
from coglab_smach.states.base import CoglabState
from coglab_smach.states.hand_tracking import HandoverRegion
from coglab_smach.states.knowledge import (
    await_offer,
    believed,
    first_reachable,
    locate,
    paced,
    palm_of,
)
from coglab_trials.virtual_clock import using
from conftest import Trial

GOAL = {"frame": "", "offset": [0.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0], "primitive": "p", "dmp_ratio": 2.0}
INSIDE, LOW, HIGH = (0.6, 0.0, 0.4), [0.45, -0.50, 0.05], [0.86, 0.50, 0.85]
IDENTITY = (0.0, 0.0, 0.0, 1.0)


class Offers:
    """A state that waits for an offer of the mug, seen at ``at(s)`` (m) by sights of ``age`` s."""

    def __init__(self, at=lambda t: INSIDE, age=0.0, **settings):
        self.trial, self.age, self.at = Trial(**settings), age, at
        self.ctx = self.trial.ctx
        self.ahead = Ahead()
        self.ctx.perception.ahead = lambda: self.ahead
        self.ctx.perception.locate_object = self.locate
        self.state = CoglabState(self.ctx)
        self.state.allow(1e9)

    def locate(self, name, limit):
        if name == "board":
            return Ready(Located("board", "world", (0.45, -0.55, 0.05), IDENTITY, 0.0))
        self.asked = (name, limit)
        found = Located(f"object_{name}", "world", tuple(self.at(self.trial.clock.now())), IDENTITY, self.age)
        return Ready(found)

    def wait(self, target="mug", margin=0.0, goals=lambda seen: [GOAL]):
        """Returns the goal and the time (s) until it was found."""
        with using(self.trial.clock):
            goal = await_offer(self.state, target, goals, margin)
        return goal, self.trial.clock.now()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_the_region_is_10_cm_larger_for_a_still_object(axis, margin):
    for wall, out in ((LOW, -1.0), (HIGH, 1.0)):
        for beyond, moving, still in ((-0.001, True, True), (0.001, False, True), (0.099, False, True)):
            place = np.array(INSIDE)
            place[axis] = wall[axis] + out * (margin + beyond)
            goal, when = Offers(lambda t, place=place: place).wait(margin=margin)
            assert goal["frame"] == "object_mug" and (when == 0.0) == moving
            assert still and (moving or 0.3 < when < 0.4), "it has been still for 0.3 s"
        place[axis] = wall[axis] + out * (margin + 0.101)
        with pytest.raises(PortError) as error:
            Offers(lambda t, place=place: place).wait(margin=margin)
        assert error.value.code == ReasonCode.OBJECT_NOT_SEEN
        where = ", ".join(f"{v:.2f}" for v in place)
        assert f"({where})" in error.value.sentence


def test_an_object_that_stands_on_the_board_is_no_offer():
    for place in ((0.45, -0.55, 0.05), (0.40, -0.42, 0.12)):  # the second place is in the handover region
        with pytest.raises(PortError) as error:
            Offers(lambda t, place=place: place).wait()
        assert error.value.code == ReasonCode.OBJECT_NOT_SEEN and "take" in error.value.causes[0]
    goal, when = Offers(lambda t: (0.45, -0.42, 0.10 + 0.2 * min(max(t - 1.0, 0.0), 2.0))).wait()
    assert goal["frame"] == "object_mug" and 1.0 < when < 1.8, "it was picked up"


def test_an_unreachable_offer_is_reported_at_the_time_limit():
    offers = Offers()
    offers.ctx.reachable = lambda palm: False
    with pytest.raises(PortError) as error:
        offers.wait()
    assert error.value.code == ReasonCode.GOAL_UNREACHABLE and 8.0 < offers.trial.clock.now() < 8.1
    assert "(0.60, 0.00, 0.40)" in error.value.sentence


def ahead(offer=0.0, request=0.0, object_id="mug", place=INSIDE, frame="object_mug_ahead"):
    return Ahead(offer, request, object_id, frame, place, 0.02)


LOCATED = {"frame": "object_mug", "xyz": [1.3, 0.0, 0.4], "quaternion": list(IDENTITY)}


@pytest.mark.parametrize(
    ("seen", "person", "is_believed"),
    [
        (ahead(offer=0.85), False, True),
        (ahead(offer=0.84), False, False),
        (ahead(request=0.99), False, False),
        (ahead(offer=0.99, object_id="ball"), False, False),
        (ahead(request=0.9), True, True),
        (ahead(request=0.89), True, False),
        (ahead(offer=0.99), True, False),
        (ahead(request=0.95, object_id=""), True, True),
        (ahead(offer=0.99, frame=""), False, False),
        (ahead(offer=0.99, place=tuple(LOW)), False, True),
        (ahead(offer=0.99, place=tuple(HIGH)), False, True),
        (ahead(offer=0.99, place=(0.87, 0.0, 0.4)), False, False),
        (ahead(offer=0.99, place=(0.6, -0.51, 0.4)), False, False),
    ],
)
def test_a_predicted_place_counts_from_the_probability_of_the_timing(seen, person, is_believed):
    offers = Offers()
    offers.ahead, region = seen, HandoverRegion(offers.ctx)
    found = believed(offers.ctx, "mug", LOCATED, person, region)
    assert (found is not None) == is_believed
    if found is not None:
        assert found == {**LOCATED, "frame": seen.frame, "xyz": list(seen.place)}
    offers.ctx.config.set("handover.belief", 0.0)
    offers.ctx.config.set("handover.belief_request", 0.0)
    assert believed(offers.ctx, "mug", LOCATED, person, region) is None, "this timing ignores beliefs"


def test_a_reach_begins_on_a_belief_before_the_object_is_there():
    offers = Offers(lambda t: (1.3, 0.0, 0.4))
    offers.ahead = ahead(offer=0.95)
    goal, when = offers.wait()
    assert goal["frame"] == "object_mug_ahead" and when == 0.0


@pytest.mark.parametrize(("believed_end", "frame"), [(0.9, ""), (0.4, "object_mug_ahead")])
def test_an_object_passing_through_the_region_is_not_offered(believed_end, frame):
    """The object moves through the region at 0.8 m/s; its predicted end is outside or inside."""
    offers = Offers(lambda t: (0.7, min(-0.6 + 0.8 * t, 0.9), 0.4))
    offers.ahead = ahead(offer=0.99, place=(0.7, believed_end, 0.4))
    if frame:
        assert offers.wait()[0]["frame"] == frame
    else:
        with pytest.raises(PortError) as error:
            offers.wait()
        assert error.value.code == ReasonCode.OBJECT_NOT_SEEN


@pytest.mark.parametrize(("age", "good"), [(0.5, True), (0.51, False)])
def test_a_goal_needs_a_sight_not_older_than_half_a_second(age, good):
    offers = Offers(age=age)
    with using(offers.trial.clock):
        if good:
            found = locate(offers.state, "mug")
            wanted = ("object_mug", "world", list(INSIDE), list(IDENTITY), age)
            assert tuple(found[name] for name in ("frame", "parent", "xyz", "quaternion", "age")) == wanted
        else:
            with pytest.raises(PortError) as error:
                locate(offers.state, "mug")
            assert error.value.code == ReasonCode.OBJECT_NOT_SEEN
            assert "'mug'" in error.value.sentence and "0.51" in error.value.sentence
    assert offers.asked == ("mug", 5.0)


# --- limits of a reach ------------------------------------------------------------------------------------------------


def test_a_reach_has_the_pace_of_the_timing_and_arrives_slowly():
    ctx = Offers(timing="calm").ctx
    assert paced(ctx, GOAL)["dmp_ratio"] == pytest.approx(2.0 * 1.7) and paced(ctx, GOAL)["arrival_speed"] == 0.05
    assert paced(Offers(timing="natural").ctx, GOAL)["dmp_ratio"] == pytest.approx(2.0)


def test_the_first_reachable_goal_is_used_if_reach_is_checked():
    offers, asked = Offers(), []
    goals = [{**GOAL, "offset": [x, 0.0, 0.0]} for x in (0.1, 0.2, 0.3)]
    offers.ctx.reachable = lambda palm: asked.append(palm.position[0]) or palm.position[0] > 1.45
    seen = {**LOCATED, "frame": "f"}
    assert first_reachable(offers.ctx, seen, goals)["offset"][0] == 0.2 and asked == pytest.approx([1.4, 1.5])
    assert first_reachable(offers.ctx, seen, goals[:1]) is None
    assert palm_of(seen, goals[2]).position == pytest.approx([1.6, 0.0, 0.4])
    offers.ctx.config.set("handover.check_reach", False)
    assert first_reachable(offers.ctx, seen, goals)["offset"][0] == 0.1
