"""When a person has let go of the object, and when not."""

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import Located, Verdict
from coglab_smach.ports.pending import Polled, PortError
from coglab_smach.states import weight
from coglab_smach.states.hand_tracking import HandTrack
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


@pytest.mark.parametrize(
    ("away", "moved", "there", "let_go"),
    [
        (0.2, True, True, False),
        (0.2, False, True, True),  # it is not seen, and the fingers have not closed past it
        (0.2, False, False, False),  # it is seen away from the palm
        (0.31, True, True, True),  # it has slipped a little, and stays away from the hand
    ],
)
def test_an_object_pulled_out_of_the_hand_is_not_let_go(monkeypatch, away, moved, there, let_go):
    lifted = Lifted(monkeypatch)
    lifted.away, lifted.kept, lifted.held.moved, lifted.held.there = away, False, moved, lambda: there
    if let_go:
        assert lifted.take(hand_distance=0.1) == "succeeded"
    else:
        assert lifted.failure(hand_distance=0.1).code == ReasonCode.NOT_RELEASED


def test_a_blocked_arm_is_the_reason_and_not_the_person(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.ctx.arm.motion_allowed = lambda: Verdict(False, "the operator holds it", int(ReasonCode.HELD))
    error = lifted.failure()
    assert error.code == ReasonCode.HELD and "the operator holds it" in " ".join(error.causes)


@pytest.mark.parametrize(
    ("thing", "age", "code"),
    [
        (0.1, 0.1, ReasonCode.GOAL_WITHDRAWN),
        (0.3, 0.1, ReasonCode.OBJECT_NOT_SEEN),
        (0.1, 0.2, ReasonCode.OBJECT_NOT_SEEN),
        (None, 0.0, ReasonCode.OBJECT_NOT_SEEN),
    ],
)
def test_an_object_that_moves_with_the_persons_hand_was_taken_back(monkeypatch, thing, age, code):
    lifted, lost_at = Lifted(monkeypatch), []
    sights = {
        "human_hand": Located("human_hand", "", (0.8, 0.0, 0.4), (0.0, 0.0, 0.0, 1.0), 0.1),
        "mug": thing and Located("object_mug", "", (0.8, thing, 0.4), (0.0, 0.0, 0.0, 1.0), age),
    }
    monkeypatch.setattr(weight, "sight_of", lambda s, name: sights.get(name))

    def lost():
        lost_at.append(lifted.trial.clock.now())
        raise PortError("'mug' has left the hand", ("open",), ReasonCode.OBJECT_NOT_SEEN)

    lifted.held.check = lost
    assert lifted.failure().code == code
    looks = 0.4 if thing and age <= 0.15 else 0.8
    took = lifted.trial.clock.now() - lost_at[0]
    assert took == pytest.approx(looks, abs=0.06), "a falling object is far below by then"


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
