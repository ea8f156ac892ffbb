"""What ends a reach, and makes it wait, at the edges of its figures: what is doubted, what jumped, what fell, what is
hidden."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import Ahead, Located
from coglab_smach.states import reach_watch
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.reach_watch import PersonsGrip, ReachWatch, target_of
from early_goal import GOAL, HIGH, IDENTITY, LOW, REGION


class Early:
    """A ReachWatch of a palm at the origin; the test says what is seen and believed, and what time it is."""

    def __init__(self, monkeypatch, grip=None, frame="object_mug_ahead"):
        self.t, self.place, self.ahead = 0.0, (0.4, 0.0, 0.4), Ahead(1.0, 0.0, "mug", "object_mug_ahead", (0.4, 0, 0.4))
        monkeypatch.setattr(reach_watch, "sight_or_refusal", lambda state, target, limit: self.seen())
        monkeypatch.setattr(reach_watch, "palm_at", lambda ctx: np.zeros(3))
        ctx = SimpleNamespace(
            clock=SimpleNamespace(now=lambda: self.t),
            perception=SimpleNamespace(ahead=lambda: self.ahead),
            config=REGION,
        )
        self.reach = ReachWatch(SimpleNamespace(ctx=ctx), {**GOAL, "frame": frame}, grip)

    def seen(self):
        return None if self.place is None else Located("mug", "world", tuple(self.place), IDENTITY, 0.0)

    def look(self, *place, after=1.0 / 30.0):
        self.t += after
        self.place = place or self.place
        return self.reach.hopeful()


def test_the_thing_that_a_reach_is_for():
    names = {"object_mug_ahead": "mug", "object_mug": "mug", "human_hand_ahead": "human_hand", "board": "board"}
    assert {frame: target_of({"frame": frame}) for frame in names} == names


@pytest.mark.parametrize(("belief", "hopeful"), [(0.1, True), (0.09, False)])
@pytest.mark.parametrize("who", ["offer", "request"])
def test_a_tenth_of_a_belief_is_enough_to_go_on(monkeypatch, belief, hopeful, who):
    early = Early(monkeypatch)
    early.ahead, early.place = Ahead(**{who: belief}), None
    assert early.look() == hopeful


def test_doubt_takes_a_fifth_of_a_second_and_looks_every_30_ms(monkeypatch):
    early, looks = Early(monkeypatch), []
    seen = early.seen
    early.seen = lambda: looks.append(early.t) or seen()
    early.ahead, early.place = Ahead(), None
    doubted = []
    for k in range(1, 45):
        early.t = 0.01 * k
        doubted.append(early.reach.doubted())
    assert doubted.index(True) == 20, "more than 0.2 s after it was believed last"
    assert np.diff(looks) == pytest.approx([0.03] * (len(looks) - 1), abs=0.011) and len(looks) > 10
    early.reach.forgive()
    assert not early.reach.doubted()


@pytest.mark.parametrize("beyond", [-0.001, 0.001])
@pytest.mark.parametrize("deviation", [0.0, 0.2])
def test_a_predicted_place_may_not_be_outside_however_unsure_it_is(monkeypatch, deviation, beyond):
    for axis, wall, out in ((0, HIGH, 1.0), (2, LOW, -1.0)):
        early, place = Early(monkeypatch), [0.4, 0.0, 0.4]
        place[axis] = wall[axis] + out * beyond
        early.ahead = Ahead(1.0, 0.0, "mug", "object_mug_ahead", tuple(place), deviation)
        early.place = (2.3, 0.0, 0.4)
        assert early.look() == (beyond < 0.0)
        assert early.reach.doubt()[0] == (ReasonCode.GOAL_WITHDRAWN if beyond < 0.0 else ReasonCode.GOAL_AHEAD_OUTSIDE)


@pytest.mark.parametrize(("beyond", "offered"), [(0.099, True), (0.101, False)])
@pytest.mark.parametrize("believed", [False, True])
def test_what_is_held_still_outside_is_offered_as_it_would_be_before_a_reach(monkeypatch, believed, beyond, offered):
    early, place = Early(monkeypatch), (HIGH[0] + beyond, 0.0, 0.4)
    early.ahead = Ahead(1.0, 0.0, "mug", "object_mug_ahead", (HIGH[0] + 0.2, 0.0, 0.4)) if believed else Ahead()
    looks = [early.look(*place) for _ in range(12)]
    assert looks[:9] == [False] * 9, "it has to be held for 0.3 s"
    assert looks[-1] == offered
    goal = early.reach.goal_now()
    assert goal["frame"] == "object_mug"
    assert goal["limits"]["goal_region_high"] == pytest.approx(np.array(HIGH) + 0.1)
    assert (goal["limits"]["goal_retreat"], goal["limits"]["goal_drop"]) == (0.10, 0.08)


def test_what_is_seen_outside_and_moves_is_not_offered_where_no_place_is_told(monkeypatch):
    early = Early(monkeypatch)
    early.ahead = Ahead(1.0, 0.0, "mug")
    assert early.look(HIGH[0] - 0.01, 0.0, 0.4) and not early.look(HIGH[0] + 0.01, 0.0, 0.4)
    assert early.reach.doubt()[0] == ReasonCode.GOAL_LEFT_REGION
    early.place = None
    assert early.look(), "of what is hidden, and believed, nothing is said"


def test_a_reach_toward_what_is_seen_goes_on_without_a_belief_and_stops_for_one_that_leads_outside(monkeypatch):
    seen = Early(monkeypatch, frame="object_mug")
    assert not seen.reach.predicted
    seen.ahead, seen.place = Ahead(), None
    assert seen.look(), "it is merely hidden; for how long, the controller minds"
    assert seen.look(0.4, 0.0, 0.4)
    seen.ahead = Ahead(1.0, 0.0, "mug", "object_mug_ahead", (0.4, 0.0, 0.4))
    assert seen.look(0.42, 0.0, 0.4) and seen.reach.goal_now()["frame"] == "object_mug"
    seen.ahead = Ahead(1.0, 0.0, "mug", "object_mug_ahead", (0.4, 1.2, 0.4))
    assert not seen.look(0.45, 0.05, 0.4) and seen.reach.doubt()[0] == ReasonCode.GOAL_AHEAD_OUTSIDE
    seen.ahead = Ahead(0.0, 1.0, "", "human_hand_ahead", (0.4, 1.2, 0.4))
    assert seen.look(0.45, 0.08, 0.4), "another thing's place says nothing of this one"


def test_a_belief_in_an_end_inside_does_not_lead_a_reach_toward_what_is_seen_outside(monkeypatch):
    seen = Early(monkeypatch, frame="object_mug")
    seen.ahead = Ahead(0.5, 0.0, "mug", "object_mug_ahead", (0.4, 0.0, 0.4))
    assert seen.look(0.4, 0.9, 0.4) and not seen.look(0.4, 1.01, 0.4)
    assert seen.reach.doubt()[0] == ReasonCode.GOAL_LEFT_REGION
    early = Early(monkeypatch)
    assert early.look(0.4, 1.01, 0.4), "one toward the predicted place goes there"


def test_an_old_sight_that_is_told_again_and_again_is_not_held_still(monkeypatch):
    early = Early(monkeypatch)
    early.ahead, early.place = Ahead(1.0, 0.0, "mug", "object_mug_ahead", (0.4, 1.2, 0.4)), (0.4, 0.9, 0.4)
    begin = early.t
    early.seen = lambda: Located("mug", "world", early.place, IDENTITY, early.t - begin)
    assert not any(early.look() for _ in range(14))


def test_who_goes_back_a_little_and_holds_it_there_is_met(monkeypatch):
    early = Early(monkeypatch)
    early.look(0.6, 0.0, 0.0)
    early.look(0.6, 0.0, 0.0)
    assert not early.look(0.68, 0.0, 0.0)
    looks = [early.look(0.68, 0.0, 0.0) for _ in range(12)]
    assert not any(looks[:8]) and looks[-1]
    with pytest.raises(TimeLimit) as end:  # 0.11 m from where it was nearest
        early.look(0.71, 0.0, 0.0)
    assert end.value.code == ReasonCode.GOAL_WITHDRAWN


@pytest.mark.parametrize("closing", [False, True])
def test_a_hand_that_takes_back_what_it_hides_has_withdrawn_it(monkeypatch, closing):
    hand, grip = [0.5], SimpleNamespace()
    early = Early(monkeypatch, grip=grip, frame="object_mug")
    early.reach.state.ctx.closing = object() if closing else None
    monkeypatch.setattr(
        reach_watch,
        "sight_of",
        lambda state, name, limit=0.3: Located(name, "world", (hand[0], 0.0, 0.4), IDENTITY, 0.0),
    )
    early.ahead = Ahead()
    for _ in range(3):
        early.look(0.4, 0.0, 0.4)
    early.place, begin = None, hand[0]
    for k in range(1, 5):
        hand[0] = begin + 0.02 * k
        assert early.look(), "hidden, and no farther away than a hand may go"
    hand[0] = begin + 0.13
    if closing:
        assert early.look(), "who lets go goes away, too"
        return
    with pytest.raises(TimeLimit) as end:
        early.look()
    assert end.value.code == ReasonCode.GOAL_WITHDRAWN and "as the hand that hides it" in end.value.sentence


@pytest.mark.parametrize(("back", "waits"), [(0.055, False), (0.065, True)])
def test_the_arm_waits_for_a_hand_that_has_gone_back_by_six_tenths_of_what_it_may(monkeypatch, back, waits):
    early = Early(monkeypatch)
    early.look(0.6, 0.0, 0.0)
    early.look(0.5, 0.0, 0.0)
    early.look(0.5, 0.0, 0.0)
    assert early.look(0.5 + back, 0.0, 0.0) is not waits and early.reach.doubted() == waits


def test_goals_once_the_prediction_is_over_are_watched_by_the_motion(monkeypatch):
    early = Early(monkeypatch)
    assert early.reach.goal_now() == GOAL
    early.ahead = Ahead()
    now = early.reach.goal_now()
    assert now["frame"] == "object_mug" and now["limits"] == {**GOAL["limits"], "goal_retreat": 0.10, "goal_drop": 0.08}


@pytest.mark.parametrize(("jump", "jumped"), [(0.119, False), (0.121, True)])
def test_a_jump_of_12_cm_is_another_thing_unless_it_stays_there_for_a_fifth_of_a_second(monkeypatch, jump, jumped):
    early = Early(monkeypatch)
    early.look(0.6, 0.0, 0.0)
    early.look(0.6, 0.0, 0.0)
    early.look(0.6 - jump, 0.0, 0.0)
    assert early.reach._nearest == pytest.approx(0.6 if jumped else 0.6 - jump)
    for after, nearest in ((0.1, 0.6), (0.2, 0.6 - jump)):
        early.look(0.6 - jump, 0.0, 0.0, after=after - early.t + 2 / 30)
        assert early.reach._nearest == pytest.approx(nearest if jumped else 0.6 - jump)


class Grip:
    """A person's hand ``above`` the object (m), and how old the two sights are (s)."""

    def __init__(self, monkeypatch, above=0.05):
        self.t, self.above, self.ages, self.asked = 0.0, above, (0.0, 0.0), 0
        self.first: list[float] = []
        monkeypatch.setattr(reach_watch, "sight_of", self.sight)
        ctx = SimpleNamespace(clock=SimpleNamespace(now=lambda: self.t), config={})
        self.grip = PersonsGrip(SimpleNamespace(ctx=ctx, pause=self.pause), "mug")

    def pause(self, duration):
        assert duration == 0.03
        self.t += duration

    def sight(self, state, name, limit=0.3):
        self.asked += 1
        if self.above is None:
            return None
        thing = name == "mug"
        above = self.first.pop() if self.first and not thing else self.above
        return Located(name, "world", (0.0, 0.0, 0.0 if thing else above), IDENTITY, self.ages[thing])


@pytest.mark.parametrize(
    ("above", "ages", "fell"),
    [
        (0.109, (0.0, 0.0), False),
        (0.111, (0.0, 0.0), True),
        (0.05, (0.05, 0.0), False),
        (0.05, (0.0, 0.06), True),
        (None, (0.0, 0.0), True),
        ([0.2] * 6, (0.0, 0.0), False),
        ([0.05] * 6, (0.0, 0.0), True),
    ],
)
def test_an_object_has_fallen_that_is_6_cm_lower_against_the_hand_than_at_first(monkeypatch, above, ages, fell):
    """By most sights of 0.4 s that are within 50 ms of each other: a few that belie the others do not decide."""
    person = Grip(monkeypatch)
    person.first = above if isinstance(above, list) else []
    person.above, person.ages = 0.111 if fell and person.first else 0.05 if person.first else above, ages
    found = person.grip.fell_or_withdrawn()
    assert found == (ReasonCode.GOAL_FELL if fell else ReasonCode.GOAL_WITHDRAWN)
    assert person.t == pytest.approx(0.42, abs=0.001)


def test_at_first_nobody_waits_for_a_pair_of_sights_and_looks_again_later(monkeypatch):
    person = Grip(monkeypatch, None)
    assert person.t == 0.0 and person.asked == 2
    person.above = 0.05
    assert person.grip.fell_or_withdrawn() == ReasonCode.GOAL_FELL, "nobody has held it"
    person.grip.look()
    assert person.grip.fell_or_withdrawn() == ReasonCode.GOAL_WITHDRAWN
    person.above = 0.111
    person.grip.look()
    assert person.grip.fell_or_withdrawn() == ReasonCode.GOAL_FELL, "the first look counts"
