"""Take and put: the arm never moves into the board, even if the tracker sees the object tilted or too low."""

from dataclasses import replace

import numpy as np
import pytest
import smach
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import objects_folder, parse_object
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_smach.context.config import Config
from coglab_smach.kinematics.board_room import BoardRoom
from coglab_smach.kinematics.goals import place_goal
from coglab_smach.ports.pending import Polled
from coglab_trials.conditions import CONSIDERATE
from coglab_trials.trial import VirtualTrial
from coglab_trials.world import BOARD, World
from conftest import SHARE, Trial

CONFIG = Config.load(str(SHARE / "config" / "machines.yaml"), {})
URDF = package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8")
OBJECTS = ["ball", "bottle", "mug", "screwdriver", "tea_box"]
TILTS = [(7.0, 0.0), (0.0, -7.0)]
"""deg about the board's x and y, error of an averaged sight"""
LOW = 0.008
"""m, error of the seen height"""


@pytest.fixture(scope="module")
def room():
    return BoardRoom(URDF, CONFIG.get("postures.board"))


def palm_for(object_id, tilt=(0.0, 0.0), low=0.0):
    """The palm at the default grasp of an object in the middle of the board, seen tilted (deg) and too low (m)."""
    entry = parse_object((objects_folder() / f"{object_id}.yaml").read_text(), object_id)
    seen = {"frame": "board", "xyz": [0.0, 0.0, -low], "rpy_deg": [*tilt, 0.0]}
    goal = place_goal(entry, entry["grasps"][entry["default_grasp"]], seen, "take", 0.012)
    return BOARD * Pose.from_dict({"xyz": goal["offset"], "quaternion": goal["orientation"]})


@pytest.mark.parametrize("object_id", OBJECTS)
def test_shipped_grasps_leave_room(room, object_id):
    assert room.over(BOARD, palm_for(object_id)) > 0.005


def test_clearance_follows_the_robot_description(room):
    # The hand lies level on its side. The lowest part is the ball of the wrist, 57 mm around the palm's height.
    palm = palm_for("mug")
    assert room.over(BOARD, palm) == pytest.approx(palm.position[2] - BOARD.position[2] - 0.057, abs=1e-3)
    higher = Pose(palm.position + [0.0, 0.0, 0.1], palm.orientation)
    assert room.over(BOARD, higher) == pytest.approx(room.over(BOARD, palm) + 0.1, abs=5e-3)
    # A goal without a posture of the arm is not checked against the board.
    assert room.over(BOARD, Pose(np.array([3.0, 0.0, 0.1]), palm.orientation)) == np.inf


@pytest.mark.parametrize("object_id", OBJECTS)
@pytest.mark.parametrize("tilt", TILTS)
def test_a_palm_is_raised_only_as_far_as_needed(room, object_id, tilt):
    palm = palm_for(object_id, tilt, LOW)
    lift, raised = room.raised(BOARD, palm, 0.01, 0.05)
    assert raised is not None and raised.orientation == pytest.approx(palm.orientation)
    assert raised.position == pytest.approx(palm.position + [0.0, 0.0, lift])
    before = room.over(BOARD, palm)
    if before >= 0.01:
        assert lift == 0.0
    else:
        assert room.over(BOARD, raised) == pytest.approx(0.01, abs=1e-3)
    # A lift above the limit is refused.
    if before < 0.0:
        assert room.raised(BOARD, palm, 0.01, 0.005)[1] is None


def seen_otherwise(trial, tilt, low):
    """From now on, perception sees the mug tilted about the board's axes and too low."""
    locate = trial.ctx.perception.locate_object

    def otherwise(object_id, time_limit):
        found = locate(object_id, time_limit)
        if object_id != "mug":
            return found

        def value():
            located = found.result()
            true = BOARD.inverse() * Pose(np.array(located.xyz), np.array(located.quaternion))
            off = Pose.from_dict({"xyz": [0.0, 0.0, -low], "rpy_deg": [*tilt, 0.0]})
            seen = BOARD * Pose(true.position + off.position, (off.rotation * true.rotation).as_quat())
            return replace(located, xyz=tuple(seen.position), quaternion=tuple(seen.orientation))

        return Polled(found.done, value)

    trial.ctx.perception.locate_object = otherwise


@pytest.mark.parametrize("tilt", [(0.0, -7.0), (7.0, 0.0)])
def test_an_object_seen_tilted_and_low_is_taken_without_touching_the_board(tilt):
    smach.set_loggers(*[lambda *a: None] * 4)
    trial = VirtualTrial(world=World(8001, CONSIDERATE, "world"))
    seen_otherwise(trial, tilt, LOW)
    results = trial.run("take")
    assert [r.outcome for r in results] == ["succeeded"], trial.ctx.journal.why()
    assert trial.last_hub == "wait_with_object" and trial.world.cell.truth()["held_by"] == "robot"


def test_a_wide_object_is_taken_along_its_approach_axis():
    smach.set_loggers(*[lambda *a: None] * 4)
    trial = VirtualTrial(world=World(8001, replace(CONSIDERATE, object_id="tea_box"), "world"))
    assert [r.outcome for r in trial.run("take")] == ["succeeded"], trial.ctx.journal.why()


def test_a_lying_object_is_refused_before_the_arm_moves_down():
    smach.set_loggers(*[lambda *a: None] * 4)
    trial = VirtualTrial(world=World(8001, CONSIDERATE, "world"))
    seen_otherwise(trial, (0.0, -20.0), 0.02)
    (result,) = trial.run("take")
    assert (result.outcome, result.code) == ("failed_empty", ReasonCode.GOAL_AT_BOARD), trial.ctx.journal.why()
    assert trial.last_hub == "wait_without_object"
    assert not trial.reaches, "the arm moved there"


def walked(action, answer):
    """Run an action on simulated ports. ``answer``: (lift of the palm in m, lifted palm)."""
    trial = Trial()
    trial.ctx.raised = lambda board, palm, room, most: answer(palm)

    def script(t):
        t.wait_hub("wait_without_object")
        if action == "put":
            t.start("exchange_human_to_robot")
            t.wait_hub("wait_with_object")
        t.start(action)
        before = len(t.ctx.journal.results)
        while len(t.ctx.journal.results) == before:
            t.clock.sleep(0.05)

    return trial.run(script)


@pytest.mark.parametrize("action, z", [("take", 0.43 - 0.05 + 0.07), ("put", 0.05 + 0.07)])
def test_goals_at_the_board_are_raised(action, z):
    trial = walked(action, lambda palm: (0.004, Pose(palm.position + [0.0, 0.0, 0.004], palm.orientation)))
    assert trial.result().outcome == "succeeded"
    goal = trial.master.get_children()[action].userdata.goal
    assert goal["offset"][2] == pytest.approx(z + 0.004)
    raised = next(t for t in trial.ctx.journal.transitions if t.from_state == "set_dmp_goal" and action in t.path)
    assert "4.0" in raised.reason


@pytest.mark.parametrize("action, outcome", [("take", "failed_empty"), ("put", "failed_holding")])
def test_goals_too_near_to_the_board_are_refused(action, outcome):
    trial = walked(action, lambda palm: (0.05, None))
    assert (trial.result().outcome, trial.result().code) == (outcome, ReasonCode.GOAL_AT_BOARD)
    assert "precise_motion" not in trial.labels(f"/{action}")
