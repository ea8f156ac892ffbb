"""Taking a weight and recovery at their limits: metres, newtons and seconds."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.context.grip import Grip
from coglab_smach.ports.interfaces import ContactEvent, Verdict
from coglab_smach.ports.pending import Polled, PortError, Ready
from coglab_smach.states import weight
from coglab_smach.states.weight import TakeWeight
from coglab_trials.virtual_clock import using
from conftest import Trial

RECEIVE = "exchange_human_to_robot"
WEIGHT = 0.31 * 9.81

# --- taking the weight ------------------------------------------------------------------------------------------------


class Lifted:
    """A TakeWeight beside a person whose hand is ``away`` m from the palm. ``at_limit`` is called at its time limit."""

    def __init__(self, monkeypatch):
        self.trial, self.mass, self.away, self.kept, self.event = Trial(), 0.31, 0.1, True, None
        self.ctx, self.grip = self.trial.ctx, Grip()
        self.state, self.hand = TakeWeight(self.ctx), self.grip.hand
        self.hand.is_sure = True
        self.at_limit = lambda: None
        self.held = SimpleNamespace(check=lambda: None, stays=lambda since: self.kept, moved=False, there=lambda: True)
        way = SimpleNamespace(
            follow=lambda: None,
            idle=lambda: True,
            begin=lambda motion: None,
            halt=lambda why: None,
            stop=lambda: self.at_limit(),
        )
        self.ctx.arm.motion_allowed = lambda: Verdict(True)
        self.ctx.contact.event = lambda: self.event
        monkeypatch.setattr(weight, "HeldObject", lambda *_: self.held)
        monkeypatch.setattr(weight, "YieldToPull", lambda ctx: way)
        monkeypatch.setattr(weight, "from_palm", lambda state, track, *_: self.away)
        monkeypatch.setattr(weight, "palm_at", lambda ctx: np.array([0.0, 0.0, 0.5]))
        monkeypatch.setattr(weight, "rise", lambda ctx, by, speed: Ready())

    def take(self, hand_distance=None):
        """Take the weight of the mug. ``hand_distance``: m from the palm before the fingers closed."""
        self.state.allow(1e9)
        entry = {"mass": self.mass}
        ud = SimpleNamespace(object_id="mug", object_entry=entry, hand_distance=hand_distance, grip=self.grip)
        with using(self.trial.clock):
            return self.state.run(ud)

    def failure(self, hand_distance=None):
        """The same for an object that is not taken. Returns the error."""
        with pytest.raises(PortError) as raised:
            self.take(hand_distance)
        return raised.value


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
    lifted.ctx.holding, lifted.at_limit = "mug", lambda: setattr(lifted, "away", away)
    lifted.event = ContactEvent(True, "x", 1.0) if loaded else None
    monkeypatch.setattr(weight, "person_holds", lambda state, settings: holds)
    error = lifted.failure()
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
