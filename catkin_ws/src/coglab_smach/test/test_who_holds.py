"""Measures whether the person holds the object: the arm sinks, and the real LeavingLoad measures the load."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_contact.load import LeavingLoad
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states import weight
from coglab_smach.states.motion import rise
from coglab_smach.states.weight import person_has_it, person_holds
from coglab_trials.virtual_clock import using
from test_weight_and_recovery import Lifted

GIVING = np.array([-0.535, -1.109, 1.799, 1.305, 0.686, -0.385, 1.182])
"""rad, posture of giving"""
WAY, SPEED = 0.03, 0.03
"""m by which the arm sinks, and m/s"""


class Scale:
    """The load on the palm of a sinking arm. ``lifts(m sunk, s since the start, negative before)``: force (N) by which
    a person lifts the object. ``over_ros``: use the share as transmitted over ROS."""

    def __init__(self, monkeypatch, mass, lifts, pull=0.0, over_ros=False):
        self.lifted = Lifted(monkeypatch)
        self.clock, self.ctx, self.state = self.lifted.trial.clock, self.lifted.ctx, self.lifted.state
        self.state.allow(1e9)
        self.lifted.mass = mass
        self.settings = {"mass": mass, "load_share": 0.5}
        self.lifts, self.carried, self.over_ros = lifts, 9.81 * mass + pull, over_ros
        self.load, self.fed = None, 0.0
        self.ways: list[tuple[float, float, float]] = []
        """start (s), sunk distance then (m), target of the motion (m)"""
        monkeypatch.setattr(weight, "palm_at", lambda ctx: np.array([0.0, 0.0, 0.5 - self.sunk()]))
        arm = SimpleNamespace(
            joint_positions=lambda: GIVING,
            move_ptp=lambda position, speeds: position,
            motion_limits=self.ctx.arm.motion_limits,
        )
        there = rise(SimpleNamespace(arm=arm), -WAY, 0.03)
        self.way, contact = np.asarray(there) - GIVING, self.ctx.contact
        contact.arm, contact.share_gone, contact.disarm = self.arm, self.share, lambda: None
        monkeypatch.setattr(weight, "rise", self.sink)

    def arm(self, mode, limit, settings):
        if mode == "lift":  # before the question who holds it
            return Ready()
        self.load = LeavingLoad(settings["mass"], settings["load_share"], self.clock.now() + limit, self.carried)
        self.fed = self.clock.now()
        return Ready()

    def sink(self, ctx, up, speed):
        if self.load is None:
            return Ready()
        self.ways.append((self.clock.now(), self.sunk(), self.sunk() - up))
        return Polled(lambda: self.sunk() == self.ways[-1][2], lambda: None, self.stand)

    def stand(self):
        self.ways.append((self.clock.now(), self.sunk(), self.sunk()))

    def sunk(self, now=None):
        """m."""
        now = self.clock.now() if now is None else now
        begun, here, there = next((way for way in reversed(self.ways) if way[0] <= now), (0.0, 0.0, 0.0))
        return here + float(np.clip(there - here, *(SPEED * (now - begun) * np.array([-1.0, 1.0]))))

    def share(self):
        while self.fed + 0.01 <= self.clock.now() + 1e-9:
            self.fed += 0.01
            sunk, since = self.sunk(self.fed), self.fed - self.ways[0][0] if self.ways else -1.0
            hangs = 9.81 * self.settings["mass"] - self.lifts(sunk, since)
            still = abs(self.sunk(self.fed - 0.25) - sunk) < 1e-6
            self.load.feed(self.fed, hangs, still, False, None, GIVING + sunk / WAY * self.way)
        if self.over_ros and self.load.share is not None:
            return self.load.margin * self.settings["load_share"]
        return self.load.sure

    def ask(self, question, *args):
        with using(self.clock):
            return question(self.state, *args, self.settings)


def spring(before, stiffness):
    """``before``: N. ``stiffness``: N/m."""
    return lambda sunk, since: before + stiffness * sunk


@pytest.mark.parametrize("over_ros", [False, True])
@pytest.mark.parametrize(
    ("mass", "before", "stiffness"),
    [
        *[(mass, 0.0, 35) for mass in (0.06, 0.31, 0.53, 1.0)],
        *[(0.06, before, 100) for before in (0.59, -2.0)],
        (0.31, 3.04, 40),
        (0.53, 5.2, 80),
        (1.0, 9.8, 150),
    ],
)
def test_a_holding_hand_is_detected_for_any_force_before(monkeypatch, mass, before, stiffness, over_ros):
    scale = Scale(monkeypatch, mass, spring(before, stiffness), over_ros=over_ros)
    assert scale.ask(person_holds) is True


@pytest.mark.parametrize("mass", [0.06, 0.31, 0.53, 1.0])
@pytest.mark.parametrize("noise", [0.0, 0.2, -0.2])
def test_nobody_holds_an_object_with_the_same_weight_lower_down(monkeypatch, mass, noise):
    scale = Scale(monkeypatch, mass, lambda sunk, since: noise * sunk / WAY)
    assert scale.ask(person_holds) is False


@pytest.mark.parametrize("pull", [1.5, 6.0])
def test_a_pull_that_ends_before_the_sinking_is_uncertain(monkeypatch, pull):
    """The load is gone, but the hand may follow the object: the fingers stay closed and the arm stays."""
    scale = Scale(monkeypatch, 0.31, spring(0.0, 0.0), pull)
    assert scale.ask(person_holds) is None


@pytest.mark.parametrize("over_ros", [False, True])
@pytest.mark.parametrize("late", [0.05, 0.5, 1.6])
@pytest.mark.parametrize("mass", [0.06, 0.53])
@pytest.mark.parametrize("goes", [0.0, 0.6])
def test_the_robot_keeps_the_object_if_a_pull_ends_during_the_sinking(monkeypatch, goes, mass, late, over_ros):
    """The hand stays, or leaves with ``goes`` m/s."""
    scale = Scale(monkeypatch, mass, lambda sunk, since: 0.0, 3.0, over_ros)
    scale.ctx.holding = "mug"

    def lifts(sunk, since):
        scale.lifted.away = 0.1 + goes * max(0.0, since - late)
        return -3.0 if since < late else 0.0

    scale.lifts = lifts
    failure = scale.lifted.failure()
    assert scale.ctx.holding == "mug" and len(failure.causes) == 2


@pytest.mark.parametrize("stiffness", [60, 100])
def test_one_late_signal_does_not_stop_the_sinking(monkeypatch, stiffness):
    scale, missed = Scale(monkeypatch, 0.31, spring(-2.0, stiffness), over_ros=True), []
    told = scale.share
    scale.ctx.contact.share_gone = lambda: None if scale.ways and not missed and not missed.append(1) else told()
    assert scale.ask(person_holds) is True


@pytest.mark.parametrize(("away", "has"), [(0.1, True), (0.3, True), (0.31, False), (None, False)])
def test_the_person_has_the_object_only_with_a_hand_at_it(monkeypatch, away, has):
    scale = Scale(monkeypatch, 0.31, spring(0.0, 200.0))
    scale.lifted.away = away
    assert scale.ask(person_has_it, scale.lifted.hand) is has and bool(scale.ways) is has


def test_the_sinking_ends_as_soon_as_the_person_is_felt(monkeypatch):
    scale = Scale(monkeypatch, 0.31, spring(0.0, 500.0))
    assert scale.ask(person_holds) is True and scale.ways[1][1] < 0.2 * WAY


def test_an_arm_that_cannot_sink_is_uncertain(monkeypatch):
    scale = Scale(monkeypatch, 0.31, spring(0.0, 0.0))
    monkeypatch.setattr(weight, "rise", lambda *_: Ready(error=PortError("refused")))
    assert scale.ask(person_holds) is None
    monkeypatch.setattr(weight, "rise", lambda *_: None)
    assert scale.ask(person_holds) is None
