"""Whole trials: the machines with the simulated cell, bridge, controller cores and hand emulator.

A sample by default; COGLAB_LONG=1 runs the campaign (100 trials of each action, each misbehaviour 20 times).
"""

import ast
import copy
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from coglab_msgs.msg import ReasonCode, Say
from coglab_perception.recogniser import Recogniser, load_patterns
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_sim.person.in_cell import pose_of_truth
from coglab_smach.context.config import ConfigError
from coglab_trials import GIVE, RECEIVE, Conditions, VirtualTrial, World
from coglab_trials.conditions import CONSIDERATE
from coglab_trials.world import LIMITS

LONG = os.environ.get("COGLAB_LONG") == "1"
SOURCES = Path(__file__).resolve().parents[2]
BY_HOLDER = ("succeeded", "failed_empty")
"""true holder of the object at the end, for outcomes in which the robot holds it, and in which it does not"""
OUTCOMES = {
    (RECEIVE, "slow"): "succeeded",
    (RECEIVE, "hesitant"): "succeeded",
    (RECEIVE, "change_side"): BY_HOLDER,
    (RECEIVE, "tug"): "succeeded",
    (RECEIVE, "absent"): "failed_empty",
    (RECEIVE, "early_release"): BY_HOLDER,
    (RECEIVE, "never_release"): "failed_empty",
    (RECEIVE, "pull_back"): BY_HOLDER,
    (RECEIVE, "early_contact"): BY_HOLDER,
    (GIVE, "slow"): "succeeded",
    (GIVE, "hesitant"): "succeeded",
    (GIVE, "change_side"): "succeeded",
    (GIVE, "absent"): "failed_holding",
    (GIVE, "early_release"): "failed_holding",
    (GIVE, "never_release"): "succeeded",
    (GIVE, "pull_back"): "failed_holding",
}
"""(action, behaviour) -> documented outcome, or two that depend on the holder"""


def checked(trial, *actions, moves=True, **how):
    """Run a trial and return its results. It must exceed no limit, watch for contact only at the right time, and end in
    a hub. ``moves``: the arm must move."""
    results = trial.run(*actions, **how)
    assert trial.world.robot.limit_violations == 0
    assert trial.contact.watched_while_moving == 0
    assert (trial.world.robot.peak_share > 0.05) == moves
    assert trial.last_hub in ("wait_without_object", "wait_with_object"), trial.why()
    return results


def succeed(trial, *actions, **how):
    results = checked(trial, *actions, **how)
    assert [(r.action, r.outcome) for r in results] == [(action, "succeeded") for action in actions], trial.why()
    return results


@pytest.mark.parametrize("seed", range(2))
def test_receive_and_give_back(seed):
    trial = VirtualTrial(seed, CONSIDERATE)
    received, given = succeed(trial, RECEIVE, GIVE)
    truth = trial.world.cell.truth()
    assert truth["held_by"] == "human" and not truth["dropped"]
    assert 0.0 < received.started < received.marks["closing"] < received.ended <= given.started < given.ended
    assert [code for _, code in trial.said] == [
        *(Say.READY_TO_RECEIVE, Say.I_HAVE_IT, Say.READY_TO_GIVE, Say.YOU_HAVE_IT),
    ]


@pytest.mark.parametrize("seed", range(20 if LONG else 2))
def test_drawn_people_and_a_realistic_tracker(seed):
    """In the default world not every exchange succeeds, but each ends in an outcome with a reason."""
    for result in checked(VirtualTrial(700 + seed), RECEIVE, GIVE):
        assert result.outcome in ("succeeded", "failed_empty", "failed_holding"), result.reason
        assert (result.outcome == "succeeded") != bool(result.reason)


def test_nobody_offers_anything():
    trial = VirtualTrial(0, replace(CONSIDERATE, behaviour="absent"))
    checked(trial, RECEIVE, moves=False)
    assert [code for _, code in trial.said] == [Say.READY_TO_RECEIVE, Say.GIVEN_UP]


@pytest.mark.parametrize("conditions", [CONSIDERATE, Conditions(profile="accustomed")], ids=["perfect", "as it is"])
def test_take_and_put_bring_the_hand_to_its_goal(conditions):
    trial = VirtualTrial(world=World(6, conditions, "world"))
    succeed(trial, "take", "put")
    truth = trial.world.cell.truth()
    assert truth["held_by"] == "board" and not truth["dropped"]
    assert len(trial.reaches) == 2
    for reach in trial.reaches:
        for name in ("goal", "truth") if conditions.perception.perfect else ("goal",):
            metres, angle = getattr(reach, f"to_{name}")
            assert metres <= 0.005 and angle <= 0.0524, (reach.request.goal_frame, name, metres, angle)


def test_hand_is_at_the_grasp_when_it_has_closed():
    trial, off = VirtualTrial(3, Conditions(profile="accustomed")), []

    def note(record):
        if record.from_state == "hand_close":
            request = trial.arm.request
            grasp = Pose(np.asarray(request.goal_offset, dtype=float), np.asarray(request.target_orientation))
            off.append(trial.world.robot.palm().distance(pose_of_truth(trial.world.truth["object"]) * grasp))

    trial.ctx.journal.listen(note)
    succeed(trial, RECEIVE)
    assert off and off[-1][0] <= 0.03 and off[-1][1] <= 0.35, off


@pytest.mark.parametrize("action, behaviour", sorted(OUTCOMES))
def test_misbehaviour_ends_in_its_documented_outcome(action, behaviour):
    for seed in range(30, 50 if LONG else 31):
        misbehaves = replace(CONSIDERATE, behaviour=behaviour)
        trial = VirtualTrial(seed, misbehaves if action == RECEIVE else CONSIDERATE)

        def script(t, action=action, misbehaves=misbehaves, seed=seed):
            if action == GIVE:
                t.ask_for(RECEIVE)
                t.world.human.participant = misbehaves.participant(seed)
            t.ask_for(action)

        last = checked(trial, script=script, moves=(action, behaviour) != (RECEIVE, "absent"))[-1]
        truth, right = trial.world.cell.truth(), OUTCOMES[(action, behaviour)]
        if not isinstance(right, str):
            right = right[0 if truth["held_by"] == "robot" else 1]
        assert (last.action, last.outcome) == (action, right), f"seed {seed}: {last.outcome}, {last.reason}"
        held = last.outcome == "failed_holding" or (last.outcome == "succeeded" and action == RECEIVE)
        assert trial.last_hub == ("wait_with_object" if held else "wait_without_object")
        assert (last.outcome == "succeeded") != bool(last.reason)
        if (action, behaviour) == (RECEIVE, "early_release"):
            # Nobody else holds the object: without the robot it lies on the floor.
            assert truth["dropped"] == (last.outcome == "failed_empty"), (truth["held_by"], last.reason)


def test_an_object_that_cannot_be_reached_is_refused_before_the_arm_moves():
    trial = VirtualTrial(world=World(3, CONSIDERATE, turned=3.14159))
    (result,) = checked(trial, RECEIVE, moves=False)
    assert result.outcome == "failed_empty" and "'mug'" in trial.why()


@pytest.mark.parametrize("turned", [2.6, -1.8])
def test_a_reach_to_an_unreachable_object_ends_with_its_reason(turned):
    world = World(1, CONSIDERATE, turned=turned)
    trial = VirtualTrial(world=world, settings={"handover.check_reach": False})
    (result,) = checked(trial, RECEIVE)
    assert result.outcome == "failed_empty" and trial.last_hub == "wait_without_object"
    assert re.search(
        r"end of the reach within \d+\.\d s|the object is \d\.\d\d m|the goal went back"
        r"|(joint lwr_\w\d|workspace) .*blocks",
        trial.why(),
    ), trial.why()


def test_a_corrected_predicted_place_is_followed():
    """The first predicted place is 0.07 m nearer than the person's hand at its end: an arm that stops there never meets
    it. The changing height of a coming hand is no fall."""
    trial = VirtualTrial(6004, Conditions(object_id="screwdriver"))
    succeed(trial, RECEIVE, GIVE)
    goal = trial.arm.request
    assert goal.goal_frame.startswith("human_hand") and goal.goal_drop == 0.0


def test_the_same_seed_gives_the_same_trial():
    (one,), (other,) = (VirtualTrial(12).run(RECEIVE) for _ in range(2))
    assert one == other


def test_impossible_requests_are_refused():
    with pytest.raises(ValueError, match="not both"):
        VirtualTrial(world=World(1), conditions=CONSIDERATE)
    with pytest.raises(ConfigError, match="reach_ration"):
        VirtualTrial(settings={"handover.reach_ration": 1.0})
    trial = VirtualTrial(1, CONSIDERATE)
    with pytest.raises(TimeoutError, match="'take'|'nowhere'"):
        trial.run(script=lambda t: t.wait_hub("nowhere", limit=5.0))
    with pytest.raises(RuntimeError, match="once"):
        trial.run(RECEIVE)


@pytest.mark.skipif(not LONG, reason="campaign: COGLAB_LONG=1")
@pytest.mark.parametrize("actions, where", [((RECEIVE, GIVE), "human_hand"), (("take", "put"), "world")])
def test_campaign(actions, where):
    failed = {action: [] for action in actions}
    for seed in range(1000, 1100):
        for result in checked(VirtualTrial(world=World(seed, CONSIDERATE, where)), *actions):
            if result.outcome != "succeeded":
                failed[result.action].append((seed, result.reason))
    assert all(len(each) <= 3 for each in failed.values()), failed


# --- timing and limits ------------------------------------------------------------------------------------------------


def test_natural_starts_before_calm_and_both_take_the_object():
    after = {}
    for timing in ("calm", "natural"):
        trial, onset = VirtualTrial(21001, settings={"timing": timing}), []
        trial.beside = lambda t, onset=onset: (
            onset.append(t.world.t) if t.begun and not onset and t.world.human.phase != "idle" else None
        )
        succeed(trial, RECEIVE)
        after[timing] = trial.reaches[0].begin - onset[0]
    assert after["calm"] - after["natural"] > 0.3


@pytest.mark.parametrize(
    "actions, where", [(("take",), "world")] + [((RECEIVE, "put", "take", GIVE), "human_hand")] * LONG
)
def test_actions_succeed_within_the_limits_of_t1(tmp_path, actions, where):
    """With the reduced limits of operating mode T1, the machines wait for the longer motions."""
    table = yaml.safe_load(Path(LIMITS).read_text(encoding="utf-8"))
    reduced = tmp_path / "joint_limits.yaml"
    reduced.write_text(yaml.safe_dump({**table, "default": {**table["default"], **copy.deepcopy(table["t1"])}}))
    results = succeed(VirtualTrial(world=World(3, CONSIDERATE, where, limits=str(reduced))), *actions, limit=200.0)
    # Fixed limits for full speed would be too short: the motion to the board alone takes 20 s.
    assert max(r.ended - r.started for r in results) > 40.0


# --- recognition ------------------------------------------------------------------------------------------------------


def recogniser():
    return Recogniser(*load_patterns(str(package_path("coglab_perception", "config", "patterns.json"))))


def switched(trial):
    return [t.reason for t in trial.ctx.journal.transitions if t.outcome == "switched"]


def test_an_object_held_high_gets_its_own_primitive():
    trial = VirtualTrial(5, CONSIDERATE, recogniser=recogniser())
    trial.world.scene.handover_object = np.array([0.78, 0.03, 0.60])
    trial.world.scene.region_high = np.array([0.81, 0.16, 0.66])
    succeed(trial, RECEIVE)
    assert len(switched(trial)) == 1
    assert trial.world.robot.progress["primitive"] == "reach_human_high"


def test_a_common_reach_keeps_the_primitive():
    trial = VirtualTrial(5, CONSIDERATE, recogniser=recogniser())
    succeed(trial, RECEIVE)
    assert not switched(trial)


def test_a_person_who_reaches_out_starts_the_exchange():
    trial = VirtualTrial(5, CONSIDERATE, recogniser=recogniser(), settings={"recognition_trigger.enabled": True})

    def script(t):
        t.wait_hub("wait_without_object")
        t.clock.sleep(1.0)
        t.world.human.command("give")
        t.wait_hub("wait_with_object")
        t.clock.sleep(4.0)
        assert t.hub == "wait_with_object", "a hand that goes back must not count as a reach"

    trial.run(script=script)
    assert [r.code for r in trial.results] == [ReasonCode.NONE]


# --- the truth --------------------------------------------------------------------------------------------------------


def test_nothing_in_control_reads_the_truth():
    """Only partner, tracker, recorders and tests may read it: no file of a control package names the topic."""
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
                        assert not any(name.startswith(("coglab_sim", "coglab_trials")) for name in names), path
    # The true frames have their own topic, so that no tf listener can look them up.
    text = (SOURCES / "coglab_sim" / "scripts" / "truth_markers.py").read_text(encoding="utf-8")
    assert "TransformBroadcaster" not in text and 'rospy.Publisher("truth/tf"' in text
