"""A sample of the campaigns that judge the world: one trial of the physics, one of a hardship, judged as they are."""

import sys

import pytest
import smach
from coglab_py.packages import package_path
from misbehaviours import GIVE, RECEIVE

sys.path.insert(0, str(package_path("coglab_smach", "bench")))
import world_rows
from campaign import ends_of, one_trial


@pytest.fixture(autouse=True)
def quiet():
    """The engine's log helps nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)


def test_the_physics_are_right_for_a_patient_person():
    """Perfect perception: nothing falls, nothing gets stuck, no period of the arm is outside a limit, commanded or
    measured."""
    done = one_trial(world_rows.physics_plan("mug").jobs()[0])
    assert (done["stuck"], done["fell"]) == ("", False)
    assert (done["outside_commanded"], done["outside_measured"]) == (0, 0)
    assert [outcome for _, outcome, _, _ in done["outcomes"]] == ["succeeded", "succeeded"], done["outcomes"]
    assert done["held_by"] == "human"


def test_a_hardship_ends_in_an_outcome():
    """How often control succeeds in it is the campaign's: here nothing gets stuck, and what failed says why."""
    plan = next(plan for plan in world_rows.hardship_plans() if "friction -30 %" in plan.name)
    job = plan.jobs()[0]
    done = one_trial(job)
    assert done["stuck"] == ""
    ends = ends_of(job.actions, done)
    assert [action for action, *_ in ends] == [RECEIVE, GIVE] and ends[0][1] != "not started"
    for _, outcome, sentence, code in ends:
        assert outcome in ("succeeded", "failed_empty", "failed_holding", "not started"), sentence
        assert (outcome in ("failed_empty", "failed_holding")) == bool(sentence), (outcome, sentence, code)
