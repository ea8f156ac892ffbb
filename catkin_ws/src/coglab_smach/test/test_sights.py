"""A tracker that takes something else for what a reach is for: that is no withdrawal, and a real one is."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import Ahead, DmpProgress, Located
from coglab_smach.ports.pending import PortError
from coglab_smach.states import reach_watch
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.reach import WaitStop
from coglab_smach.states.where import SWAPPED

WITHDRAWN = (int(ReasonCode.GOAL_WITHDRAWN), "the person does not offer or ask any more")
LOW, HIGH = [-1.0, -1.0, -1.0], [2.0, 1.0, 2.0]
FRAME = 1.0 / 30.0


class Watched:
    """A reach for a hand that is seen at places that the test names, 30 times a second; the palm is at the origin."""

    def __init__(self, monkeypatch):
        self.t, self.place, self.refusal = 0.0, np.array([0.4, 0.0, 0.4]), None
        self.ahead = Ahead(0.0, 1.0, "", "human_hand_ahead", (0.4, 0.0, 0.4))
        monkeypatch.setattr(reach_watch, "sight_or_refusal", lambda state, target, limit: self.refusal or self.sight())
        monkeypatch.setattr(reach_watch, "palm_at", lambda ctx: np.zeros(3))
        ctx = SimpleNamespace(
            clock=SimpleNamespace(now=lambda: self.t),
            perception=SimpleNamespace(ahead=lambda: self.ahead),
            config={"handover.region_low": LOW, "handover.region_high": HIGH},
        )
        goal = {
            "frame": "human_hand_ahead",
            "limits": {"goal_region_low": LOW, "goal_region_high": HIGH},
            "watch": {"retreat": 0.10, "drop": 0.0, "margin": 0.0},
        }
        self.reach = reach_watch.ReachWatch(SimpleNamespace(ctx=ctx), goal, None)

    def sight(self):
        return Located("human_hand", "world", tuple(self.place), (0.0, 0.0, 0.0, 1.0), 0.0)

    def see(self, *place, frames=1):
        self.place = np.array(place)
        for _ in range(frames):
            self.t += FRAME
            assert not self.reach.doubted()


def test_four_frames_of_something_else_are_no_withdrawal(monkeypatch):
    hand = Watched(monkeypatch)
    hand.see(0.4, 0.0, 0.4, frames=10)
    hand.see(0.28, 0.0, 0.28, frames=4)
    hand.see(0.4, 0.0, 0.4, frames=30)


def test_a_hand_that_goes_back_ends_the_reach(monkeypatch):
    hand = Watched(monkeypatch)
    hand.see(0.4, 0.0, 0.4, frames=10)
    with pytest.raises(TimeLimit, match="went back") as end:
        for k in range(12):
            hand.place, hand.t = np.array([0.4 + 0.03 * k, 0.0, 0.4]), hand.t + FRAME
            hand.reach.hopeful()
    assert end.value.code == ReasonCode.GOAL_WITHDRAWN


def test_the_arm_waits_for_a_hand_that_begins_to_go_back_and_comes_again(monkeypatch):
    """Before it is known whether it is withdrawn; a tremor of a centimetre is no reason to wait."""
    hand = Watched(monkeypatch)
    hand.see(0.4, 0.0, 0.4, frames=10)
    hand.see(0.41, 0.0, 0.41, frames=10)
    hand.place = np.array([0.46, 0.0, 0.45])
    hand.t += FRAME
    assert hand.reach.doubted() and hand.reach.doubt()[0] == ReasonCode.GOAL_WITHDRAWN and not hand.reach.hopeful()
    hand.place, hand.t = np.array([0.42, 0.0, 0.42]), hand.t + 2 * FRAME
    assert hand.reach.hopeful()


def test_a_hand_that_was_hidden_while_it_went_back_is_believed_after_a_moment(monkeypatch):
    hand = Watched(monkeypatch)
    hand.see(0.4, 0.0, 0.4, frames=10)
    with pytest.raises(TimeLimit, match="went back"):
        hand.see(0.7, 0.0, 0.4, frames=12)
    assert hand.t < 10 * FRAME + SWAPPED + 3 * FRAME


@pytest.mark.parametrize("code, told", [(ReasonCode.NOT_PERCEIVED, True), (ReasonCode.OBJECT_NOT_SEEN, False)])
def test_of_a_hand_that_cannot_be_told_from_another_it_is_said(monkeypatch, code, told):
    """That is no withdrawal. One that is merely hidden may well be: a hand that goes back hides what it holds."""
    hand = Watched(monkeypatch)
    hand.see(0.4, 0.0, 0.4, frames=10)
    hand.ahead, hand.refusal = Ahead(), PortError("2 people are in view", code=code)
    begin = hand.t
    while not hand.reach.doubted():
        hand.t += FRAME
        assert hand.t < begin + reach_watch.DOUBT_TIME + 3 * FRAME
    assert hand.reach.doubt() == ((int(code), "2 people are in view") if told else WITHDRAWN)
    hand.refusal = None
    assert hand.reach.hopeful() and hand.reach.doubt() == WITHDRAWN


def test_who_lowers_the_hand_goes_on(monkeypatch):
    hand = Watched(monkeypatch)
    for k in range(12):
        hand.see(0.4, 0.0, 0.4 - 0.025 * k)


@pytest.mark.parametrize("beyond, followed", [(-0.01, True), (0.01, False)])
def test_a_reach_that_will_end_outside_the_region_is_not_followed(monkeypatch, beyond, followed):
    hand = Watched(monkeypatch)
    hand.see(0.4, 0.0, 0.4, frames=5)
    hand.ahead = Ahead(0.0, 1.0, "", "human_hand_ahead", (HIGH[0] + beyond, 0.0, 0.4), 0.06)
    begin, doubted = hand.t, False
    while hand.t < begin + 1.0 and not doubted:
        hand.t += FRAME
        hand.place = np.array([0.4, 0.2 * (hand.t - begin), 0.4])
        doubted = hand.reach.doubted()
    assert doubted == (not followed), "a hand that passes through the region offers nothing there"
    if doubted:
        assert hand.t - begin < reach_watch.DOUBT_TIME + 3 * FRAME
        assert hand.reach.doubt()[0] == ReasonCode.GOAL_AHEAD_OUTSIDE


def test_a_hand_that_is_hidden_while_it_goes_down_has_not_lost_what_it_holds(monkeypatch):
    """Its last sight is older than that of the object, which seems to have left it, until it is seen again."""
    t, sights = [0.0], {"human_hand": ((0.8, 0.0, 0.45), 0.05), "mug": ((0.75, 0.0, 0.42), 0.05)}
    monkeypatch.setattr(
        reach_watch, "sight_of", lambda state, name, limit=0.3: Located(name, "world", *sight(*sights[name]))
    )

    def sight(place, age):
        return place, (0.0, 0.0, 0.0, 1.0), age

    def pause(duration):
        t[0] += duration
        if t[0] > 0.1:
            sights["human_hand"] = ((1.0, 0.0, 0.23), 0.05)

    state = SimpleNamespace(ctx=SimpleNamespace(clock=SimpleNamespace(now=lambda: t[0]), config={}), pause=pause)
    grip = reach_watch.PersonsGrip(state, "mug")
    sights["mug"], sights["human_hand"] = ((0.95, 0.0, 0.20), 0.05), ((0.85, 0.0, 0.40), 0.30)
    assert grip.fell_or_withdrawn() == ReasonCode.GOAL_WITHDRAWN
    sights["mug"] = ((1.0, 0.0, 0.10), 0.05)
    assert grip.fell_or_withdrawn() == ReasonCode.GOAL_FELL


class Reach(WaitStop):
    """Waits for somebody who never goes on."""

    def __init__(self, progress, doubted, predicted=True):
        self.ctx = SimpleNamespace(
            config={},
            arm=SimpleNamespace(
                dmp_progress=lambda: progress,
                motion_allowed=lambda: SimpleNamespace(ok=True),
                cancel_motion=lambda reason: None,
            ),
            journal=SimpleNamespace(mark=lambda name: None),
        )
        self._watched, self._grip = (
            SimpleNamespace(
                predicted=predicted, doubted=lambda: doubted, hopeful=lambda: False, doubt=lambda: WITHDRAWN
            ),
            None,
        )

    def allow(self, duration):
        pass

    def await_pending(self, pending, what, limit=None, pace=None, code=0):
        pass

    def wait_for(self, condition, what, limit=None, pace=None, code=0):
        raise TimeLimit(what)


@pytest.mark.parametrize(
    "state, code, doubted, expected",
    [
        ("running", ReasonCode.NONE, True, ReasonCode.GOAL_WITHDRAWN),
        ("aborted", ReasonCode.GOAL_LEFT_REGION, False, ReasonCode.GOAL_AHEAD_OUTSIDE),
    ],
)
def test_a_reach_that_is_given_up_says_for_which_of_the_two_reasons(state, code, doubted, expected):
    with pytest.raises(TimeLimit) as found:
        Reach(DmpProgress(state, "", "reach_human", 0.5, 0.2, code), doubted)._reached()
    assert found.value.code == expected


def test_a_goal_that_is_seen_to_leave_the_region_has_its_own_reason():
    left = DmpProgress("aborted", "it left", "reach_human", 0.5, 0.2, ReasonCode.GOAL_LEFT_REGION)
    with pytest.raises(TimeLimit) as found:
        Reach(left, False, predicted=False)._reached()
    assert found.value.code == ReasonCode.GOAL_LEFT_REGION and found.value.causes == (reach_watch.LEFT[1],)
