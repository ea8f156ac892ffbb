"""Whole trials in virtual time: the machines against the real cell, bridge, controller cores and hand emulator.

A sample by default; COGLAB_LONG=1 runs the campaign (100 trials of each action, each misbehaviour 20 times).
"""

import ast
import os
import re
from pathlib import Path

import pytest
import smach
from coglab_msgs.msg import Say
from coglab_trials.misbehaviours import GIVE, OUTCOMES, RECEIVE, documented
from coglab_trials.trial import VirtualTrial

LONG = os.environ.get("COGLAB_LONG") == "1"
SOURCES = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def quiet():
    """The engine's log of hundreds of transitions helps nobody here."""
    smach.set_loggers(*[lambda *a: None] * 4)


def run(*actions, moves=True, **kw):
    """A trial of the machinery: an accustomed person and perfect perception, unless other ones are named."""
    trial = VirtualTrial(**{"profile": "accustomed", "perfect": True, **kw})
    results = trial.run(*actions)
    assert trial.rig.robot.limit_violations == 0
    assert trial.ctx.contact.watched_while_moving == 0
    # "The arm has not moved" where nobody offered anything; else it has.
    assert (trial.rig.robot.peak_share > 0.05) == (moves and kw.get("behaviour") != "absent")
    assert trial.last_hub in ("wait_without_object", "wait_with_object"), trial.ctx.journal.why()
    return trial, results


@pytest.mark.parametrize("seed", range(2))
def test_receive_and_give_back(seed):
    trial, results = run("exchange_human_to_robot", "exchange_robot_to_human", seed=seed)
    assert [r.outcome for r in results] == ["succeeded", "succeeded"], [r.reason for r in results]
    truth = trial.rig.cell.truth()
    assert truth["held_by"] == "human" and not truth["dropped"]


@pytest.mark.parametrize("seed", range(20 if LONG else 2))
def test_people_and_tracker_as_they_are(seed):
    """Not every exchange succeeds in the default world, but each ends in an outcome of its own with a reason."""
    trial, results = run(RECEIVE, GIVE, seed=700 + seed, profile="drawn", perfect=False)
    for result in results:
        assert result.outcome in ("succeeded", "failed_empty", "failed_holding"), result.reason
        assert (result.outcome == "succeeded") != bool(result.reason)


def test_the_person_is_told_what_the_robot_is_about():
    trial, _ = run(RECEIVE, GIVE, seed=0)
    codes = [code for _, code in trial.said]
    assert codes == [Say.READY_TO_RECEIVE, Say.I_HAVE_IT, Say.READY_TO_GIVE, Say.YOU_HAVE_IT]
    trial, _ = run(RECEIVE, seed=0, behaviour="absent")
    assert [code for _, code in trial.said] == [Say.READY_TO_RECEIVE, Say.GIVEN_UP]


def test_take_and_put():
    trial, results = run("take", "put", seed=6, object_on="world")
    assert [r.outcome for r in results] == ["succeeded", "succeeded"], [r.reason for r in results]
    truth = trial.rig.cell.truth()
    assert truth["held_by"] == "board" and not truth["dropped"]


@pytest.mark.parametrize("perfect", [True, False])
def test_hand_at_the_goal(perfect):
    """Of reaches that nobody meets, to the board; one for a person ends where they touch the hand."""
    trial, results = run("take", "put", seed=6, perfect=perfect, object_on="world")
    assert [r.outcome for r in results] == ["succeeded", "succeeded"], [r.reason for r in results]
    assert len(trial.reaches) == 2
    for reach in trial.reaches:
        for name in ("goal", "truth") if perfect else ("goal",):
            metres, angle = getattr(reach, f"to_{name}")
            assert metres <= 0.005 and angle <= 0.0524, (reach.request.goal_frame, name, metres, angle)


@pytest.mark.parametrize("perfect", [True, False])
def test_hand_at_the_grasp_when_it_has_closed(perfect):
    trial = VirtualTrial(seed=3, profile="accustomed", perfect=perfect)
    off = []
    trial.ctx.journal.listen(lambda r: off.append(trial.palm_off_grasp()) if r.from_state == "hand_close" else None)
    assert [r.outcome for r in trial.run(RECEIVE)] == ["succeeded"]
    assert off and off[-1][0] <= 0.03 and off[-1][1] <= 0.35, off


@pytest.mark.parametrize("action, behaviour", sorted(OUTCOMES))
def test_misbehaviour_ends_in_its_documented_outcome(action, behaviour):
    for seed in range(20 if LONG else 1):
        if action == GIVE:
            trial, results = run(RECEIVE, GIVE, seed=30 + seed, later_behaviour=behaviour)
        else:
            trial, results = run(RECEIVE, seed=30 + seed, behaviour=behaviour)
        last = results[-1]
        assert last.kind == action
        right = documented(action, behaviour, trial.rig.cell.truth()["held_by"])
        assert last.outcome == right, f"seed {30 + seed}: {last.outcome}, {last.reason}"
        held = last.outcome == "failed_holding" or (last.outcome == "succeeded" and action == RECEIVE)
        assert trial.last_hub == ("wait_with_object" if held else "wait_without_object")
        if last.outcome != "succeeded":
            assert last.reason
        if (action, behaviour) == (RECEIVE, "early_release"):
            # Nobody else holds it: what the robot has not caught lies on the floor.
            truth = trial.rig.cell.truth()
            assert truth["dropped"] == (last.outcome == "failed_empty"), (truth["held_by"], last.reason)


def test_an_object_that_cannot_be_reached_is_refused_before_the_arm_moves():
    trial, results = run(RECEIVE, seed=3, turned=3.14159, moves=False)
    assert results[0].outcome == "failed_empty" and trial.last_hub == "wait_without_object"
    assert "'mug' cannot be reached: the arm has no posture for the hand at (" in trial.ctx.journal.why()


@pytest.mark.parametrize("turned", [2.6, -1.8])
def test_an_object_out_of_reach_all_the_same_ends_with_what_remained(turned):
    trial, results = run(RECEIVE, seed=1, turned=turned, **{"handover.check_reach": False})
    assert results[0].outcome == "failed_empty" and trial.last_hub == "wait_without_object"
    assert re.search(
        r"the end of the reach within \d+\.\d s expected, it did not happen, because the motion is running with \d\."
        r"|something touches the hand, and the object is \d\.\d\d m from where it would be held"
        r"|the reach was given up: the goal went back by"
        r"|(joint lwr_\w\d is at its stop and|a border of the workspace) blocks the motion",
        trial.ctx.journal.why(),
    ), trial.ctx.journal.why()


def test_the_same_seed_gives_the_same_trial():
    def marks():
        _, results = run("exchange_human_to_robot", seed=12)
        return results[0].marks

    assert marks() == marks()


@pytest.mark.skipif(not LONG, reason="campaign: COGLAB_LONG=1")
@pytest.mark.parametrize(
    "actions, where",
    [(("exchange_human_to_robot", "exchange_robot_to_human"), "human_hand"), (("take", "put"), "world")],
)
def test_campaign(actions, where):
    good = {action: 0 for action in actions}
    reasons = []
    for seed in range(100):
        _, results = run(*actions, seed=1000 + seed, object_on=where)
        for result in results:
            good[result.kind] += result.outcome == "succeeded"
            if result.outcome != "succeeded":
                reasons.append((seed, result.kind, result.reason))
    assert all(n >= 97 for n in good.values()), (good, reasons)


def test_nothing_in_control_reads_the_truth():
    """Only the partner, the tracker stand-in, recorders and tests may: no file of a control package names the topic."""
    for package in (
        "coglab_smach",
        "coglab_perception",
        "coglab_controllers",
        "ctrl_more",
        "lwr_fri_bridge",
        "ih2_hand",
    ):
        for folder in ("src", "scripts", "include", "launch", "config"):
            for path in (SOURCES / package / folder).rglob("*"):
                if path.suffix in (".py", ".cpp", ".hpp", ".launch", ".yaml"):
                    text = path.read_text(encoding="utf-8", errors="replace")
                    assert "truth/" not in text and "CellTruth" not in text, f"{path} reads the truth"
                    if path.suffix == ".py":
                        names = {n.module or "" for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ImportFrom)}
                        assert not any(name.startswith("coglab_sim") for name in names), f"{path} imports coglab_sim"


def test_the_true_frames_are_not_on_tf():
    """They go to a topic of their own, so that no tf listener can look them up."""
    text = (SOURCES / "coglab_sim" / "scripts" / "truth_markers.py").read_text(encoding="utf-8")
    assert "TransformBroadcaster" not in text and 'rospy.Publisher("truth/tf"' in text
