"""Whole trials in which it is not clear who holds the object: nothing is dragged along, pressed firmly or dropped."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.pending import Polled
from coglab_trials.trial import VirtualTrial

RECEIVE = "exchange_human_to_robot"


@pytest.mark.parametrize(
    ("aside", "mark", "later"), [(0.25, "closed", 0.0), (0.4, "closed", 0.3), (0.6, "closing", 0.3)]
)
def test_another_hand_that_the_tracker_takes_for_the_persons_frees_nothing(aside, mark, later):
    """The person never lets go; their hand seems to be elsewhere, and to stay there."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True, behaviour="never_release")
    locate, since = trial.ctx.perception.locate_object, []

    def located(name, limit):
        pending, marked = locate(name, limit), trial.begun and trial.ctx.journal.marked(mark)
        if marked and not since:
            since.append(trial.rig.t)
        if name != "human_hand" or not since or trial.rig.t < since[0] + later:
            return pending
        beside = lambda seen: replace(seen, xyz=tuple(np.array(seen.xyz) + [0.0, aside, 0.0]))  # noqa: E731
        return Polled(pending.done, lambda: beside(pending.result()))

    trial.ctx.perception.locate_object = located
    result = trial.run(RECEIVE)[0]
    assert result.code == ReasonCode.NOT_RELEASED and "tightened" not in result.marks, result
    assert result.outcome in ("stopped", "failed_empty") and not trial.rig.cell.truth()["dropped"]


@pytest.mark.parametrize("after", [0.5, 0.8])
def test_what_a_hand_has_let_go_of_beside_closed_fingers_is_not_dropped(after):
    """The reach ends as the fingers close; the person lets go and leaves their hand where it is."""
    trial = VirtualTrial(seed=4, profile="accustomed", perfect=True)
    step, began, held = trial.rig.human.step, [], []

    def let_go(now, view):
        action = step(now, view)
        if not began or now < began[0] + after:
            return action
        held.append(action.frame)
        return replace(action, frame=held[0], velocity=np.zeros(3), grip=0.0, grip_force=0.0)

    def beside(t):
        if not began and t.begun and t.ctx.journal.marked("closing_on_the_way"):
            began.append(t.rig.t)
        if began and len(began) == 1 and t.rig.t > began[0] + 0.06:
            began.append(t.rig.t)
            t.ctx.arm.cancel_motion("the goal is lost")

    trial.rig.human.step, trial.beside = let_go, beside
    result, truth = trial.run(RECEIVE)[0], trial.rig.cell.truth()
    assert held and not truth["dropped"] and truth["held_by"] == "robot", (result, truth["held_by"])
