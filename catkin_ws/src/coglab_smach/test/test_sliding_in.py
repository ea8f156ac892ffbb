"""A touch on the way past an object is not yet the moment to close; and what goes down with the hand does not fall."""

from types import SimpleNamespace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.context.config import Config
from coglab_smach.ports.interfaces import Located
from coglab_smach.states import reach
from conftest import Trial


def receive(monkeypatch, away, **constants):
    """Receive where the palm is ``away(s since the first look)`` m off its grasp at a touch. Returns seconds from the
    first look to the closing, and the trial."""
    # In this cell the object is at the palm from the touch on, wherever the palm is, and goes with it.
    trial, looked = Trial(**{"handover.retreat": 2.0}), []

    def off_grasp(state, goal):
        looked.append(trial.clock.now())
        return away(looked[-1] - looked[0])

    monkeypatch.setattr(reach, "off_grasp", off_grasp)
    for name, value in constants.items():
        monkeypatch.setattr(reach, name, value)

    def script(t):
        t.wait_hub("wait_without_object")
        t.cell.partner.touch_after = 0.05
        t.start("exchange_human_to_robot")
        t.wait_hub("wait_with_object")

    trial.run(script)
    assert trial.result().outcome == "succeeded"
    return min(stamp for stamp, what in trial.cell.calls if what == "close") - looked[0], trial


def test_it_closes_where_the_palm_is_at_its_grasp(monkeypatch):
    waited, trial = receive(monkeypatch, lambda t: 0.07 - 0.2 * t)
    assert (0.07 - reach.SEATED) / 0.2 <= waited < (0.07 - reach.SEATED) / 0.2 + 0.15
    assert trial.cell.called("disarm")


@pytest.mark.parametrize("case", ["there already", "firm", "not seen"])
def test_it_closes_at_once_where_nothing_is_won_by_going_on(monkeypatch, case):
    away = {"there already": lambda t: 0.02, "firm": lambda t: 0.07, "not seen": lambda t: None}[case]
    waited, _ = receive(monkeypatch, away, **({"FIRM": 1.0} if case == "firm" else {}))
    assert waited < 0.1


def test_it_does_not_go_on_for_ever(monkeypatch):
    waited, _ = receive(monkeypatch, lambda t: 0.07)
    assert waited < reach.SLIDING + 0.2


@pytest.mark.parametrize("apart, code", [(0.03, "GOAL_WITHDRAWN"), (0.12, "GOAL_FELL"), (None, "GOAL_FELL")])
def test_what_is_still_at_the_hand_has_not_fallen(monkeypatch, apart, code):
    thing, hand, t = np.array([0.7, 0.0, 0.4]), [np.array([0.73, 0.0, 0.4])], [0.0]

    def sight(state, name):
        place = thing if name == "mug" else hand[0]
        return None if place is None else Located(name, "world", tuple(place), (0.0, 0.0, 0.0, 1.0), 0.05)

    def pause(duration):
        t[0] += duration

    monkeypatch.setattr(reach, "sight_of", sight)
    ctx = SimpleNamespace(clock=SimpleNamespace(now=lambda: t[0]), config=Config({}))
    grip = reach.PersonsGrip(SimpleNamespace(ctx=ctx, pause=pause), "mug")
    hand[0] = None if apart is None else thing + [0.03, 0.0, apart]
    assert grip.fell_or_withdrawn() == getattr(ReasonCode, code)
