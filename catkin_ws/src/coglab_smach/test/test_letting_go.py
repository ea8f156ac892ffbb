"""When a person has let go of the object, and when not."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import Located, Verdict
from coglab_smach.ports.pending import Polled, PortError
from coglab_smach.states import weight
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.hand_tracking import HandTrack
from coglab_trials.virtual_clock import using
from conftest import Trial
from test_weight_and_recovery import Lifted


@pytest.mark.parametrize("moment", ["released", "tightened"])
def test_a_stop_ends_the_firm_closing_as_well(moment):
    trial, firm, cancelled = Trial(), [], []
    close = trial.ctx.hand.close

    def watched(speed):
        if speed <= 60:
            return close(speed)
        firm.append(speed)
        return Polled(lambda: False, lambda: None, lambda: cancelled.append(speed))

    trial.ctx.hand.close = watched

    def script(t):
        t.begin()
        t.until(lambda: firm and t.ctx.journal.marked(moment))
        t.ctx.stop.press("a finger is in it")
        t.wait_hub("stopped")

    trial.run(script)
    assert firm and cancelled == firm


def test_an_object_pulled_out_of_the_hand_is_not_let_go(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.state._farther, lifted.away, lifted.kept, lifted.held.moved = 0.14, 0.2, False, True
    with using(lifted.trial.clock) as clock:
        for _ in range(100):
            assert not lifted.state._has_let_go()
            clock.sleep(0.01)
        lifted.held.moved = False
        assert lifted.state._has_let_go(), "it is not seen, and the fingers have not closed past it"
        lifted.held.there = lambda: False
        assert not lifted.state._has_let_go(), "it is seen away from the palm"
        lifted.held.there, lifted.held.moved, lifted.away = (lambda: True), True, 0.31
        assert lifted.state._has_let_go(), "it has slipped a little, and stays away from the hand"


def test_a_blocked_arm_is_the_reason_and_not_the_person(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.ctx.arm.motion_allowed = lambda: Verdict(False, "the operator holds it", int(ReasonCode.HELD))
    with pytest.raises(TimeLimit) as error:
        lifted.state._has_let_go()
    assert error.value.code == ReasonCode.HELD and "the operator holds it" in " ".join(error.value.causes)


def test_an_object_that_moves_with_the_persons_hand_was_taken_back(monkeypatch):
    lifted, lost = Lifted(monkeypatch), PortError("'mug' has left the hand", ("open",), ReasonCode.OBJECT_NOT_SEEN)
    taken, fell = ReasonCode.GOAL_WITHDRAWN, ReasonCode.OBJECT_NOT_SEEN
    sights = {}
    lifted.state.allow(1e9)
    monkeypatch.setattr(weight, "sight_of", lambda s, name: sights.get(name))
    with using(lifted.trial.clock) as clock:
        for thing, age, code in ((0.1, 0.1, taken), (0.3, 0.1, fell), (0.1, 0.2, fell), (None, 0.0, fell)):
            sights["human_hand"] = Located("human_hand", "", (0.8, 0.0, 0.4), (0.0, 0.0, 0.0, 1.0), 0.1)
            sights["mug"] = thing and Located("object_mug", "", (0.8, thing, 0.4), (0.0, 0.0, 0.0, 1.0), age)
            begun = clock.now()
            assert lifted.state._taken_back("mug", lost).code == code
            looks = 0.4 if thing and age <= 0.15 else 0.8
            assert clock.now() - begun == pytest.approx(looks, abs=0.06), "a falling object is far below by then"


def seen(track, way, frames=5, frame=0.033, since=0.0, jitter=0.0):
    """Feed sights of a hand at x = ``way(s)`` m. Returns the time (s) of the last sight."""
    for k in range(1, frames + 1):
        track.follow(since + k * frame, np.array([way(k * frame) + jitter * (-1) ** k, 0.0, 0.4]))
    return since + frames * frame


@pytest.mark.parametrize("shift", [0.25, 0.4, 0.6, -0.3])
def test_a_hand_that_jumps_between_sights_is_another_one(shift):
    track = HandTrack()
    t = seen(track, lambda s: 0.9, jitter=0.01)
    assert track.is_one
    t = seen(track, lambda s: 0.9 + shift, frames=60, since=t, jitter=0.01)
    assert not track.is_one, "even if the confusion lasts"
    track.follow(t - 5.0, np.array([0.9 + shift, 0.0, 0.4]))
    assert not track.is_one, "a repeated old sight does not count"
    t = seen(track, lambda s: 0.9, since=t)
    assert track.is_one, "back where it was"


@pytest.mark.parametrize("hidden", [0.033, 0.1, 0.3])
@pytest.mark.parametrize("speed", [0.3, 1.0, 1.9])
def test_a_leaving_hand_with_short_gaps_is_the_same_hand(speed, hidden):
    track, t = HandTrack(), 0.0
    for _ in range(5):
        t = seen(track, lambda s, t=t: speed * (t + s), since=t)
        t += hidden
    assert track.is_one


def test_the_published_wait_does_not_change_with_each_sight():
    trial, told = Trial(), []
    trial.cell.partner.let_go_after = None

    def script(t):
        t.begin()
        t.until(lambda: "arm lift" in t.cell.called())
        t.clock.sleep(0.3)
        for _ in range(100):
            told.append(t.ctx.journal.wait().code)
            t.clock.sleep(0.011)
        t.ctx.stop.press("enough")
        t.wait_hub("stopped")

    trial.run(script)
    assert set(told) == {ReasonCode.WAITS_FOR_PERSON}, set(told)
