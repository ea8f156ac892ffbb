"""When a person has let go, and when not: who it was, and what became of the object."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.clocks.virtual_clock import using
from coglab_smach.ports.interfaces import ContactEvent, Verdict
from coglab_smach.ports.pending import Polled, PortError
from coglab_smach.states import weight, where
from coglab_smach.states.base import TimeLimit
from conftest import Trial
from test_weight_and_recovery import RECEIVE, Lifted


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
        t.wait_hub("wait_without_object")
        t.start(RECEIVE)
        t.until(lambda: firm and t.ctx.journal.marked(moment))
        t.ctx.stop.press("a finger is in it")
        t.wait_hub("stopped")

    trial.run(script)
    assert firm and cancelled == firm


def test_a_hand_that_is_seen_late_counts_from_where_it_is_seen_at_the_object(monkeypatch):
    lifted = Lifted(monkeypatch, carried=True)
    lifted.away = 0.1
    for _ in range(3):
        assert not lifted.state._has_let_go(), "it holds on, though it was hidden as the fingers closed"
    assert lifted.state._farther == pytest.approx(0.14)
    lifted.away = 0.141
    assert lifted.state._has_let_go()


def test_who_pulls_it_out_has_not_let_go(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.state._farther, lifted.away, lifted.kept, lifted.held.moved = 0.14, 0.2, False, True
    with using(lifted.trial.clock) as clock:
        for _ in range(100):
            assert not lifted.state._has_let_go()
            clock.sleep(0.01)
        lifted.held.moved = False
        assert lifted.state._has_let_go(), "nobody sees it, and the fingers have not closed past it"
        lifted.held.there = lambda: False
        assert not lifted.state._has_let_go(), "it is seen away from the palm"
        lifted.held.there, lifted.held.moved, lifted.away = (lambda: True), True, 0.31
        assert lifted.state._has_let_go(), "it has slipped a little, and stays where the hand is not"


def test_another_hand_that_goes_tells_it_late_unless_the_weight_has_come(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.state._farther, lifted.away, lifted.hand.is_one = 0.14, 0.6, False
    with using(lifted.trial.clock) as clock:
        assert not lifted.state._has_let_go()
        clock.sleep(0.95)
        assert not lifted.state._has_let_go()
        clock.sleep(0.1)
        assert lifted.state._has_let_go() and not lifted.state._seen_away
    lifted.state._gone = None
    lifted.event = ContactEvent(True, "x", 1.0)
    assert lifted.state._has_let_go() and not lifted.state._seen_away, "and nothing is held firmly for it"


def test_an_arm_that_may_not_move_says_so_and_not_that_the_person_holds_on(monkeypatch):
    lifted = Lifted(monkeypatch)
    lifted.ctx.arm.motion_allowed = lambda: Verdict(False, "the operator holds it", int(ReasonCode.HELD))
    with pytest.raises(TimeLimit) as error:
        lifted.state._has_let_go()
    assert error.value.code == ReasonCode.HELD and "the operator holds it" in " ".join(error.value.causes)


def test_what_has_gone_with_the_persons_hand_was_taken_back(monkeypatch):
    lifted, lost = Lifted(monkeypatch), PortError("'mug' has left the hand", ("open",), ReasonCode.OBJECT_NOT_SEEN)
    monkeypatch.setattr(weight, "person_at", lambda s: np.array([0.8, 0.0, 0.4]))
    for thing, code in (([0.8, 0.1, 0.4], ReasonCode.GOAL_WITHDRAWN), ([0.8, 0.3, 0.4], ReasonCode.OBJECT_NOT_SEEN)):
        monkeypatch.setattr(weight, "seen_at", lambda s, name, at=thing: np.array(at))
        assert lifted.state._taken_back("mug", lost).code == code
    monkeypatch.setattr(weight, "seen_at", lambda s, name: None)
    assert lifted.state._taken_back("mug", lost) is lost


def test_a_hand_that_is_elsewhere_from_one_sight_to_the_next_is_another_one(monkeypatch):
    trial, place = Trial(), [0.9, 0.0, 0.4]
    monkeypatch.setattr(where, "person_at", lambda s: np.array(place))
    monkeypatch.setattr(where, "palm_at", lambda ctx: np.array([0.8, 0.0, 0.4]))
    hand = where.HandTrack(SimpleNamespace(ctx=trial.ctx))
    with using(trial.clock) as clock:
        assert hand.from_palm() == pytest.approx(0.1)
        place[0] += 0.3
        clock.sleep(0.05)
        assert hand.from_palm() is None and hand.is_one, "for a moment"
        place[0] -= 0.3
        clock.sleep(0.05)
        assert hand.from_palm() == pytest.approx(0.1) and hand.is_one
        # Who goes, and is hidden now and then, is followed.
        for way, after in ((0.1, 0.05), (0.3, 0.1), (0.2, 0.05), (0.4, 0.15)):
            place[0] += way
            clock.sleep(after)
            assert hand.from_palm() is not None and hand.is_one
        place[0] -= 0.9
        for _ in range(6):
            clock.sleep(0.05)
            hand.from_palm()
        assert not hand.is_one and hand.from_palm() is not None
