"""Whether the person holds what the fingers have closed on: the arm sinks, and the real LeavingLoad weighs."""

import numpy as np
import pytest
from coglab_smach.clocks.virtual_clock import using
from coglab_smach.contact.leaving_load import LeavingLoad
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states import weight
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.motion import _joint_way
from coglab_smach.states.weight import person_has_it, person_holds
from test_weight_and_recovery import Lifted

GIVING = np.array([-0.535, -1.109, 1.799, 1.305, 0.686, -0.385, 1.182])
"""rad, where the arm gives"""
WAY, TAKES = 0.03, 1.0
"""m by which the arm sinks, and s for that"""


class Scale:
    """What hangs on the palm of an arm that sinks; ``lifts``: N by which a person lifts the object, of m sunk and s
    since the sinking began (negative before). ``over_ros``: the share as it is told over ROS."""

    def __init__(self, monkeypatch, mass, lifts, pull=0.0, over_ros=False):
        self.lifted = Lifted(monkeypatch)
        self.clock, self.ctx, self.state = self.lifted.trial.clock, self.lifted.ctx, self.lifted.state
        self.state._deadline, self.settings = 1e9, {"mass": mass, "load_share": 0.5}
        self.lifts, self.carried, self.over_ros = lifts, 9.81 * mass + pull, over_ros
        self.load, self.fed, self.begun, self.ends = None, 0.0, None, None
        there = _joint_way(self.ctx, GIVING, np.array([0.0, 0.0, -WAY]), 0.03)[0]
        self.way, contact = np.asarray(there) - GIVING, self.ctx.contact
        contact.arm, contact.share_gone, contact.disarm = self.arm, self.share, lambda: None
        monkeypatch.setattr(weight, "rise", self.sink)

    def arm(self, mode, limit, settings):
        self.load = LeavingLoad(settings["mass"], settings["load_share"], self.clock.now() + limit, self.carried)
        self.fed = self.clock.now()
        return Ready()

    def sink(self, *_):
        self.begun = self.clock.now()
        return Polled(lambda: self.part() >= 1.0, lambda: None, self.stand)

    def stand(self):
        self.ends = self.part()

    def part(self, now=None):
        if self.begun is None:
            return 0.0
        part = max(0.0, ((self.clock.now() if now is None else now) - self.begun) / TAKES)
        return min(part, 1.0 if self.ends is None else self.ends)

    def share(self):
        while self.fed + 0.01 <= self.clock.now() + 1e-9:
            self.fed += 0.01
            part, since = self.part(self.fed), -1.0 if self.begun is None else self.fed - self.begun
            hangs = 9.81 * self.settings["mass"] - self.lifts(WAY * part, since)
            self.load.feed(self.fed, hangs, not 0.0 <= since < TAKES + 0.25, False, None, GIVING + part * self.way)
        if self.over_ros and self.load.share is not None:
            return self.load.margin * self.settings["load_share"]
        return self.load.sure

    def ask(self, question, *args):
        with using(self.clock):
            return question(self.state, *args, self.settings)


def spring(before, stiffness):
    """N, and N/m."""
    return lambda sunk, since: before + stiffness * sunk


@pytest.mark.parametrize("over_ros", [False, True])
@pytest.mark.parametrize(
    ("mass", "before", "stiffness"),
    [
        *[(mass, 0.0, 100) for mass in (0.06, 0.31, 0.53, 1.0)],
        *[(0.06, before, 100) for before in (0.59, -0.5, -2.0)],
        *[(0.31, before, 100) for before in (1.0, -2.0)],
        (0.31, 3.04, 40),
        *[(0.53, before, 80) for before in (1.0, 2.0, 5.2)],
        (0.53, -1.0, 100),
        *[(1.0, before, stiffness) for before, stiffness in ((4.4, 100), (9.8, 100), (9.8, 150))],
    ],
)
def test_a_hand_holds_it_whatever_it_lifts_or_presses_before(monkeypatch, mass, before, stiffness, over_ros):
    scale = Scale(monkeypatch, mass, spring(before, stiffness), over_ros=over_ros)
    assert scale.ask(person_holds) is True


@pytest.mark.parametrize("mass", [0.06, 0.31, 0.53, 1.0])
@pytest.mark.parametrize("noise", [0.0, 0.2, -0.2])
def test_nobody_holds_what_weighs_the_same_lower_down(monkeypatch, mass, noise):
    scale = Scale(monkeypatch, mass, lambda sunk, since: noise * sunk / WAY)
    assert scale.ask(person_holds) is False


@pytest.mark.parametrize("pull", [1.5, 3.0, 6.0])
def test_a_pull_that_ends_before_the_arm_sinks_may_be_a_hand_that_follows(monkeypatch, pull):
    """The weight that it takes along is gone from the palm: nothing is opened for that, nor taken away."""
    scale = Scale(monkeypatch, 0.31, spring(0.0, 0.0), pull)
    assert scale.ask(person_holds) is None


@pytest.mark.parametrize("over_ros", [False, True])
@pytest.mark.parametrize("late", [0.2, 0.5, 1.0, 1.5])
@pytest.mark.parametrize("mass", [0.06, 0.31, 0.53])
def test_who_ends_a_pull_while_the_arm_sinks_and_goes_has_left_it_to_the_robot(monkeypatch, mass, late, over_ros):
    scale = Scale(monkeypatch, mass, lambda sunk, since: 0.0, 3.0, over_ros)
    scale.ctx.holding = "mug"

    def lifts(sunk, since):
        scale.lifted.away = 0.1 if since < late else 0.4
        return -3.0 if since < late else 0.0

    scale.lifts = lifts
    with using(scale.clock):
        failure = scale.state._not_released("mug", 5.0, TimeLimit("no"), scale.settings)
    assert scale.ctx.holding == "mug" and "and the person's hand is" in failure.causes[1]


@pytest.mark.parametrize(("away", "has"), [(0.1, True), (0.3, True), (0.31, False), (None, False)])
def test_who_has_it_has_their_hand_there(monkeypatch, away, has):
    scale = Scale(monkeypatch, 0.31, spring(0.0, 200.0))
    scale.lifted.away = away
    assert scale.ask(person_has_it, scale.lifted.hand) is has and (scale.begun is not None) is has


def test_a_person_is_not_pressed_down_for_longer_than_it_takes_to_feel_them(monkeypatch):
    scale = Scale(monkeypatch, 0.31, spring(0.0, 500.0))
    assert scale.ask(person_holds) is True and scale.ends < 0.2


def test_a_share_that_is_told_late_is_waited_for(monkeypatch):
    scale, looks = Scale(monkeypatch, 0.31, spring(2.5, 0.0)), []
    told = scale.share
    scale.ctx.contact.share_gone = lambda: None if looks.append(1) or len(looks) < 40 else told()
    assert scale.ask(person_holds) is None and len(looks) > 40, "the sinking itself changes nothing"
    scale.ctx.contact.share_gone = lambda: None
    assert scale.ask(person_holds) is None


def test_an_arm_that_sinks_no_further_has_felt_nothing(monkeypatch):
    scale = Scale(monkeypatch, 0.31, spring(0.0, 0.0))
    monkeypatch.setattr(weight, "rise", lambda *_: Ready(error=PortError("refused")))
    assert scale.ask(person_holds) is None
    monkeypatch.setattr(weight, "rise", lambda *_: None)
    assert scale.ask(person_holds) is None
