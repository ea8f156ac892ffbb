"""Taking a weight and recovery at their limits: metres, newtons and seconds."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.ports.interfaces import ContactEvent, Verdict
from coglab_smach.ports.pending import Polled, Ready
from coglab_smach.states import weight
from coglab_smach.states.base import TimeLimit
from coglab_smach.states.hand_tracking import HandTrack
from coglab_smach.states.weight import TakeWeight
from conftest import Trial

RECEIVE = "exchange_human_to_robot"
WEIGHT = 0.31 * 9.81

# --- taking the weight ------------------------------------------------------------------------------------------------


def seen_all_the_way():
    track = HandTrack()
    track.is_sure = True
    return track


class Lifted:
    """A TakeWeight whose methods the test calls. ``rises``: (m, m/s) of each rise."""

    def __init__(self, monkeypatch, carried=False):
        self.trial, self.rises, self.z, self.away = Trial(), [], 0.5, 0.1
        self.ctx = self.trial.ctx
        state = self.state = TakeWeight(self.ctx)
        self.busy = False
        state._way = SimpleNamespace(
            follow=lambda: None, idle=lambda: not self.busy, begin=lambda m: None, stop=lambda: None
        )
        state._way.halt = lambda why: self.rises.append(why)
        state._rises, state._on, state._said, state._seen_away = 0, None, False, False
        monkeypatch.setattr(weight, "from_palm", lambda state, track, *_: self.away)
        state._hand = self.hand = seen_all_the_way()
        self.ctx.arm.motion_allowed = lambda: Verdict(True)
        state._held = self.held = SimpleNamespace(check=lambda: None, stays=lambda since: self.kept, moved=False)
        self.kept, self.held.there = True, lambda: True
        self.event = ContactEvent(True, "x", 1.0) if carried else None
        self.ctx.contact.event = lambda: self.event
        monkeypatch.setattr(weight, "palm_at", lambda ctx: np.array([0.0, 0.0, self.z]))
        monkeypatch.setattr(weight, "rise", lambda ctx, by, speed: self.rises.append((by, speed)) or Ready())


@pytest.mark.parametrize("stop", [True, False])
def test_the_repeated_closing_ends_with_the_state(stop):
    trial, cancelled = Trial(), []
    trial.ctx.hand.close = lambda speed: Polled(lambda: False, lambda: None, lambda: cancelled.append(speed))
    trial.cell.partner.let_go_after = None

    def script(t):
        t.begin()
        t.until(lambda: "arm lift" in t.cell.called())
        t.clock.sleep(0.5)
        if stop:
            t.ctx.stop.press("test")
        t.until(lambda: t.ctx.journal.results)

    trial.run(script)
    assert cancelled == [60]


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize(
    ("away", "holds", "keeps"),
    [
        (None, True, True),
        (0.31, True, True),
        (1.0, True, True),
        (0.29, True, False),
        (0.29, False, True),
        (0.1, None, True),
    ],
)
def test_a_hand_within_30_cm_that_carries_the_object_gets_it_back(monkeypatch, away, holds, loaded, keeps):
    lifted = Lifted(monkeypatch)
    lifted.away, lifted.ctx.holding = away, "mug"
    lifted.event = ContactEvent(True, "x", 1.0) if loaded else None
    monkeypatch.setattr(weight, "person_holds", lambda state, settings: holds)
    error = lifted.state._not_released("mug", 5.0, TimeLimit("the wait"), {"mass": 0.31})
    assert error.code == ReasonCode.NOT_RELEASED and "'mug'" in error.sentence and "5 s" in error.sentence
    assert (lifted.ctx.holding == "mug") == keeps and len(error.causes) == 1 + keeps


# --- recovery ---------------------------------------------------------------------------------------------------------


def test_leaving_fault_resets_a_hold_latched_at_the_robot():
    trial = Trial()

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.faults.dead.add("arm")
        t.wait_hub("fault")
        t.cell.faults.dead.clear()
        t.cell.arm.held = True
        assert "silent" in t.ctx.journal.why()
        t.start("initialise")
        assert not t.ctx.journal.newest_failure().sentence, "the operator has confirmed the failure"
        t.wait_hub("wait_without_object")
        assert not t.cell.arm.held

    trial.run(script)


def test_a_falling_goal_with_the_hand_at_it_is_a_withdrawal():
    for above, code in ((0.02, ReasonCode.GOAL_WITHDRAWN), (0.12, ReasonCode.GOAL_FELL)):
        trial = Trial()

        def script(t, above=above):
            t.begin()
            t.until(lambda: t.ctx.journal.marked("motion_started"))
            t.clock.sleep(0.3)
            mug = t.cell.objects["mug"].position
            t.cell.objects["human_hand"] = Pose(mug + [0.08, 0.0, above])
            t.cell.arm.end("the goal falls", ReasonCode.GOAL_FELL)
            t.wait_hub("wait_without_object")

        trial.run(script)
        assert trial.result().code == code and len(trial.result().causes) == 1
