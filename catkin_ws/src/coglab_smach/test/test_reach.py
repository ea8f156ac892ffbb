"""A reach for a person: reasons to end or pause it, and when the hand closes, goes deeper or tries again."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.context.config import Config
from coglab_smach.ports.interfaces import Ahead, ContactEvent, DmpProgress, Located, Verdict
from coglab_smach.ports.pending import PortError, Ready
from coglab_smach.states import reach
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.hand_tracking import SWAPPED
from coglab_smach.states.reach import PersonsGrip, ReachWatch, WaitContact, dmp_request, target_of
from coglab_trials.virtual_clock import using
from conftest import Trial

LOW, HIGH = [-1.0, -1.0, -1.0], [2.0, 1.0, 2.0]
REGION = Config({"handover": {"region_low": LOW, "region_high": HIGH}})
IDENTITY = (0.0, 0.0, 0.0, 1.0)
FRAME = 1.0 / 30.0
GOAL = {
    "primitive": "reach_human",
    "frame": "object_mug_ahead",
    "offset": [0.0, 0.0, 0.1],
    "orientation": [0.0, 0.0, 0.0, 1.0],
    "dmp_ratio": 1.5,
    "limits": {"goal_retreat": 0.0, "goal_drop": 0.0, "goal_region_low": LOW, "goal_region_high": HIGH},
    "watch": {"retreat": 0.10, "drop": 0.08, "margin": 0.0},
}
HERE = (0.4, 0.0, 0.4)


def test_a_request_contains_the_fields_of_its_goal():
    plain = dmp_request({"primitive": "p", "frame": "f", "offset": (1, 2, 3)})
    assert not plain.orientation_control and plain.goal_approach == (0.0, 0.0, 0.0)
    whole = dmp_request({**GOAL, "approach": [0.0, 0.05, 0.0], "arrival_speed": 0.05}, "q")
    assert (whole.primitive_id, whole.dmp_ratio, whole.orientation_control) == ("q", 1.5, True)
    assert (whole.goal_approach, whole.arrival_speed, whole.goal_region_high) == ([0.0, 0.05, 0.0], 0.05, HIGH)
    assert target_of(GOAL) == "mug" and target_of({"frame": "human_hand_ahead"}) == "human_hand"


# --- sights and beliefs -----------------------------------------------------------------------------------------------


class Watched:
    """A ReachWatch with the palm at the origin. The test sets the sight (``place``) and the belief (``ahead``)."""

    def __init__(self, monkeypatch, grip=None, frame="object_mug_ahead", closes=False):
        self.t, self.place, self.refusal = 0.0, HERE, None
        self.ahead = Ahead(1.0, 0.0, "mug", "object_mug_ahead", HERE)
        monkeypatch.setattr(reach, "sight_or_refusal", lambda state, target, limit: self.refusal or self.seen())
        monkeypatch.setattr(reach, "palm_at", lambda ctx: np.zeros(3))
        clock, perception = SimpleNamespace(now=lambda: self.t), SimpleNamespace(ahead=lambda: self.ahead)
        ctx = SimpleNamespace(clock=clock, perception=perception, config=REGION)
        self.reach = ReachWatch(SimpleNamespace(ctx=ctx), {**GOAL, "frame": frame}, grip, lambda: closes)

    def seen(self):
        return None if self.place is None else Located("mug", "world", tuple(self.place), IDENTITY, 0.0)

    def look(self, *place, after=FRAME):
        self.t += after
        self.place = place or self.place
        return self.reach.hopeful()


def test_doubt_begins_after_its_delay_and_can_end(monkeypatch):
    early = Watched(monkeypatch)
    early.ahead, early.place = Ahead(), None
    doubted = []
    for k in range(1, 45):
        early.t = 0.01 * k
        doubted.append(early.reach.doubted())
    assert 0.01 * doubted.index(True) == pytest.approx(reach.DOUBT_TIME, abs=0.02)
    early.reach.forgive()
    assert not early.reach.doubted()


@pytest.mark.parametrize("beyond", [-0.001, 0.001])
def test_a_predicted_place_outside_the_region_is_not_followed(monkeypatch, beyond):
    for axis, wall, out in ((0, HIGH, 1.0), (2, LOW, -1.0)):
        early, place = Watched(monkeypatch), list(HERE)
        place[axis] = wall[axis] + out * beyond
        early.ahead, early.place = Ahead(1.0, 0.0, "mug", "object_mug_ahead", tuple(place), 0.2), (2.3, 0.0, 0.4)
        assert early.look() == (beyond < 0.0)
        assert early.reach.doubt()[0] == (ReasonCode.GOAL_WITHDRAWN if beyond < 0.0 else ReasonCode.GOAL_AHEAD_OUTSIDE)


@pytest.mark.parametrize(("beyond", "offered"), [(0.099, True), (0.101, False)])
def test_an_object_held_still_slightly_outside_is_offered(monkeypatch, beyond, offered):
    early, place = Watched(monkeypatch), (HIGH[0] + beyond, 0.0, 0.4)
    early.ahead = Ahead()
    looks = [early.look(*place) for _ in range(12)]
    assert not any(looks[:9]) and looks[-1] == offered
    goal = early.reach.goal_now()
    assert goal["frame"] == "object_mug" and goal["limits"]["goal_region_high"] == pytest.approx(np.array(HIGH) + 0.1)
    assert (goal["limits"]["goal_retreat"], goal["limits"]["goal_drop"]) == (0.10, 0.08)


def test_a_repeated_old_sight_does_not_count_as_held_still(monkeypatch):
    early = Watched(monkeypatch)
    early.ahead, early.place = Ahead(1.0, 0.0, "mug", "object_mug_ahead", (0.4, 1.2, 0.4)), (0.4, 0.9, 0.4)
    begin = early.t
    early.seen = lambda: Located("mug", "world", early.place, IDENTITY, early.t - begin)
    assert not any(early.look() for _ in range(14))


def test_reach_toward_a_seen_target_stays_in_the_region(monkeypatch):
    seen = Watched(monkeypatch, frame="object_mug")
    seen.ahead, seen.place = Ahead(), None
    assert not seen.reach.predicted and seen.look() and seen.look(*HERE)
    seen.ahead = Ahead(1.0, 0.0, "mug", "object_mug_ahead", (0.4, 1.2, 0.4))
    assert not seen.look(0.45, 0.05, 0.4) and seen.reach.doubt()[0] == ReasonCode.GOAL_AHEAD_OUTSIDE
    seen.ahead = Ahead(0.0, 1.0, "", "human_hand_ahead", (0.4, 1.2, 0.4))
    assert seen.look(0.45, 0.08, 0.4), "the predicted place of another frame does not count"
    seen.ahead = Ahead(0.5, 0.0, "mug", "object_mug_ahead", HERE)
    assert not seen.look(0.45, 1.01, 0.4) and seen.reach.doubt()[0] == ReasonCode.GOAL_LEFT_REGION


def test_a_target_held_still_after_a_short_retreat_is_offered_there(monkeypatch):
    early = Watched(monkeypatch)
    early.look(0.6, 0.0, 0.0), early.look(0.6, 0.0, 0.0)
    assert not early.look(0.68, 0.0, 0.0) and early.reach.doubted()
    looks = [early.look(0.68, 0.0, 0.0) for _ in range(12)]
    assert not any(looks[:8]) and looks[-1]
    with pytest.raises(TimeLimit) as end:  # 0.11 m from its nearest place
        early.look(0.71, 0.0, 0.0)
    assert end.value.code == ReasonCode.GOAL_WITHDRAWN


@pytest.mark.parametrize(("back", "waits"), [(0.055, False), (0.065, True)])
def test_the_arm_waits_for_a_hand_that_begins_to_go_back(monkeypatch, back, waits):
    early = Watched(monkeypatch)
    for x in (0.6, 0.5, 0.5):
        early.look(x, 0.0, 0.0)
    assert early.look(0.5 + back, 0.0, 0.0) is not waits and early.reach.doubted() == waits
    assert early.look(0.51, 0.0, 0.0)


def test_a_jump_is_ignored_unless_it_lasts(monkeypatch):
    hand = Watched(monkeypatch)
    for place, frames in ((HERE, 10), ((0.28, 0.0, 0.28), 4), (HERE, 30)):
        for _ in range(frames):
            hand.t, hand.place = hand.t + FRAME, place
            assert not hand.reach.doubted()
    begin = hand.t
    with pytest.raises(TimeLimit) as end:
        while hand.t < begin + 1.0:
            hand.look(0.7, 0.0, 0.4)
    assert end.value.code == ReasonCode.GOAL_WITHDRAWN and hand.t - begin < SWAPPED + 3 * FRAME


def test_a_lowered_hand_has_not_gone_back(monkeypatch):
    hand = Watched(monkeypatch, frame="human_hand_ahead")
    hand.ahead, hand.reach.may = Ahead(0.0, 1.0, "", "human_hand_ahead", HERE), {**GOAL["watch"], "drop": 0.0}
    assert all(hand.look(0.4, 0.0, 0.4 - 0.025 * k) for k in range(12))


@pytest.mark.parametrize("closing", [False, True])
def test_a_hand_that_goes_back_with_a_hidden_object_withdraws_it(monkeypatch, closing):
    hand = [0.5]
    early = Watched(monkeypatch, SimpleNamespace(), "object_mug", closing)
    sight = lambda state, name, limit=0.3: Located(name, "world", (hand[0], 0.0, 0.4), IDENTITY, 0.0)  # noqa: E731
    monkeypatch.setattr(reach, "sight_of", sight)
    early.ahead = Ahead()
    for _ in range(3):
        early.look(*HERE)
    early.place = None
    for k in range(1, 5):
        hand[0] = 0.5 + 0.02 * k
        assert early.look()
    hand[0] = 0.63
    if closing:
        assert early.look(), "the person lets go and leaves"
        return
    with pytest.raises(TimeLimit) as end:
        early.look()
    assert end.value.code == ReasonCode.GOAL_WITHDRAWN


@pytest.mark.parametrize("code", [ReasonCode.NOT_PERCEIVED, ReasonCode.OBJECT_NOT_SEEN])
def test_an_unidentified_hand_is_no_withdrawal(monkeypatch, code):
    hand = Watched(monkeypatch)
    hand.look(), hand.look()
    hand.ahead, hand.refusal = Ahead(), PortError("2 people are in view", code=code)
    while not hand.reach.doubted():
        hand.t += FRAME
        assert hand.t < 1.0
    told = ReasonCode.NOT_PERCEIVED if code == ReasonCode.NOT_PERCEIVED else ReasonCode.GOAL_WITHDRAWN
    assert hand.reach.doubt()[0] == told


class Hand:
    """A person's hand ``above`` the object (m), and the ages of the two sights (s)."""

    def __init__(self, monkeypatch, above=0.05):
        self.t, self.above, self.ages, self.first = 0.0, above, (0.0, 0.0), []
        monkeypatch.setattr(reach, "sight_of", self.sight)
        ctx = SimpleNamespace(clock=SimpleNamespace(now=lambda: self.t), config=REGION)
        self.grip = PersonsGrip(SimpleNamespace(ctx=ctx, pause=self.pause), "mug")

    def pause(self, duration):
        self.t += duration

    def sight(self, state, name, limit=0.3):
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
def test_an_object_has_fallen_if_most_sights_show_it_below_the_hand(monkeypatch, above, ages, fell):
    person = Hand(monkeypatch)
    person.first = above if isinstance(above, list) else []
    person.above, person.ages = 0.111 if fell and person.first else 0.05 if person.first else above, ages
    found = person.grip.fell_or_withdrawn()
    assert found == (ReasonCode.GOAL_FELL if fell else ReasonCode.GOAL_WITHDRAWN)


def test_a_dropping_object_never_seen_with_a_hand_has_fallen(monkeypatch):
    person = Hand(monkeypatch, None)
    person.above = 0.05
    assert person.grip.fell_or_withdrawn() == ReasonCode.GOAL_FELL
    person.grip.look()
    assert person.grip.fell_or_withdrawn() == ReasonCode.GOAL_WITHDRAWN


# --- the phases -------------------------------------------------------------------------------------------------------


class Reaching:
    """A WaitContact in the armed wait for contact. The test sets the arm's progress."""

    def __init__(self, monkeypatch, progress, off=0.02, doubted=lambda: False, fell=None, **settings):
        self.trial = Trial(**settings)
        self.progress, self.event, self.asked = progress, None, []
        ctx = self.trial.ctx
        ctx.arm.dmp_progress = lambda: self.progress
        ctx.arm.motion_allowed = lambda: Verdict(True)
        ctx.arm.execute_dmp = lambda request: self.asked.append(request) or Ready()
        ctx.arm.cancel_motion = lambda reason: Ready()
        ctx.contact.event = lambda: self.event
        ctx.hand.close_on_object = lambda: self.asked.append("close") or Ready()
        monkeypatch.setattr(reach, "off_grasp", lambda state, goal: off)
        self.watch = SimpleNamespace(
            predicted=True, doubted=doubted, doubt=lambda: (ReasonCode.GOAL_WITHDRAWN, "doubt"), hopeful=lambda: False
        )
        self.watch.forgive, self.watch.goal_now = lambda: None, lambda: GOAL
        monkeypatch.setattr(reach, "ReachWatch", lambda *given: self.watch)
        monkeypatch.setattr(reach, "PersonsGrip", lambda *given: SimpleNamespace(look=lambda: None, **(fell or {})))
        self.state, self.grip = WaitContact(ctx), self.trial.grip
        self.grip.preshaped = True

    def run(self, touched_after=None):
        """Returns the outcome or error, and the duration (s)."""
        grasp = {"hand": {"mode": "cylindrical", "level": "low"}}
        ud = SimpleNamespace(goal=GOAL, grasp=grasp, object_entry={"mass": 0.3}, grip=self.grip)
        self.state.allow(1e9)
        with using(self.trial.clock) as clock:

            def touch():
                clock.sleep(touched_after)
                self.event = ContactEvent(True, "x", 1.5)

            if touched_after is not None:
                clock.start_thread(touch, "touch")
            try:
                return self.state.run(ud), clock.now()
            except PortError as error:
                return error, clock.now()


@pytest.mark.parametrize(
    ("off", "margin", "scale", "seconds"),
    [(0.031, 1.0, 1.0, 0.6), (0.031, 1.0, 0.5, 1.2), (0.029, 1.0, 1.0, 0.0), (0.05, 2.5, 1.0, 0.0)],
)
def test_the_hand_slides_in_after_a_light_touch_beside_the_grasp(monkeypatch, off, margin, scale, seconds):
    reaching = Reaching(monkeypatch, DmpProgress("running", "", "reach_human", 0.5, 0.05), off)
    reaching.trial.ctx.arm.speed_scale = lambda: scale
    reaching.event = ContactEvent(True, "x", margin)
    outcome, took = reaching.run()
    assert outcome == "succeeded" and took == pytest.approx(seconds, abs=0.05)


def received(monkeypatch, off):
    """Run the whole machine with the object seen ``off(touches)`` m off its grasp."""
    # In this cell the object follows the palm from the touch on.
    anywhere = {"handover.region_low": [-2.0] * 3, "handover.region_high": [2.0] * 3, "handover.retreat": 2.0}
    trial, looks = Trial(**{"handover.close_within": 0.0, "handover.drop": 0.0, **anywhere}), []
    monkeypatch.setattr(reach, "off_grasp", lambda state, goal: off(looks.append(1) or len(looks)))
    trial.cell.partner.touch_after = 0.3

    def script(t):
        t.begin()
        t.clock.sleep(1.0)
        t.until(t.ctx.requests.hub)

    trial.run(script)
    return trial


def test_the_arm_tries_again_twice_and_then_gives_up(monkeypatch):
    trial = received(monkeypatch, lambda looks: 0.2 if looks <= 2 else 0.02)
    assert trial.result().outcome == "succeeded" and trial.cell.called().count("execute_dmp") == 3
    trial = received(monkeypatch, lambda looks: 0.2)
    assert (trial.result().outcome, trial.result().code) == ("failed_empty", ReasonCode.NO_CONTACT)
    assert trial.cell.called().count("execute_dmp") == 3


@pytest.mark.parametrize("back_after", [2.9, 9.0])
def test_the_arm_pauses_for_a_person_and_gives_up_after_a_while(monkeypatch, back_after):
    reaching = Reaching(monkeypatch, DmpProgress("running", "", "reach_human", 0.5, 0.05), doubted=lambda: True)
    clock, watch = reaching.trial.clock, reaching.watch
    watch.hopeful = lambda: clock.now() >= back_after
    watch.forgive = lambda: setattr(watch, "doubted", lambda: False)
    outcome, took = reaching.run(touched_after=3.5)
    if back_after < 3.0:
        assert outcome == "succeeded" and [each.goal_frame for each in reaching.asked] == ["object_mug_ahead"]
    else:
        assert outcome.code == ReasonCode.GOAL_WITHDRAWN and took == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize(
    ("progress", "predicted", "code"),
    [
        (DmpProgress("aborted", "", "p", 0.5, 0.2, ReasonCode.GOAL_LEFT_REGION), True, ReasonCode.GOAL_AHEAD_OUTSIDE),
        (DmpProgress("aborted", "", "p", 0.5, 0.2, ReasonCode.GOAL_LEFT_REGION), False, ReasonCode.GOAL_LEFT_REGION),
        (DmpProgress("aborted", "", "p", 0.5, 0.2, 77), True, 77),
        (DmpProgress("aborted", "", "p", 0.5, 0.2, ReasonCode.GOAL_FELL), True, ReasonCode.GOAL_WITHDRAWN),
    ],
)
def test_an_aborted_reach_has_its_reason(monkeypatch, progress, predicted, code):
    lowered = {"fell_or_withdrawn": lambda: ReasonCode.GOAL_WITHDRAWN}
    reaching = Reaching(monkeypatch, progress, fell=lowered)
    reaching.watch.predicted = predicted
    error, took = reaching.run()
    assert error.code == code and (took > 2.9) == (progress.code == ReasonCode.GOAL_LEFT_REGION)


# --- another pattern --------------------------------------------------------------------------------------------------
