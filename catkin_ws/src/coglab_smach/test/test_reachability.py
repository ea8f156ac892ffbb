"""Goals from database entries, the arm's reach of them, and the tool that checks objects."""

from pathlib import Path

import pytest
from coglab_objects.database import objects_folder, parse_object
from coglab_py.pose import Pose
from coglab_smach.kinematics.goals import delivery_goal, grasp_goal, palm_at_grasp, place_goal
from coglab_smach.kinematics.reachability import reachability_report, share_reached

SHARE = Path(__file__).resolve().parent.parent
MUG = (objects_folder() / "mug.yaml").read_text()
OBJECTS = ["ball", "bottle", "mug", "screwdriver", "tea_box"]


@pytest.mark.parametrize("object_id", OBJECTS)
def test_sample_grasps_are_reachable(object_id):
    entry = parse_object((objects_folder() / f"{object_id}.yaml").read_text(), object_id)
    for line, ok in reachability_report(entry):
        assert ok, line


def test_an_unreachable_grasp_is_found():
    text = MUG.replace("quaternion: [0.5, 0.5, 0.5, 0.5]", "quaternion: [0.5, 0.5, -0.5, -0.5]")
    reached, total = share_reached(palm_at_grasp(parse_object(text, "mug.yaml")["grasps"]["side"]), yaws_deg=(0.0,))
    assert reached < 0.3 * total


def test_goals_are_the_palm_relative_to_the_goal_frame():
    mug = parse_object(MUG, "mug.yaml")
    grasp = mug["grasps"]["side"]
    receive = grasp_goal(mug, grasp, "object_mug", "receive")
    assert receive["frame"] == "object_mug" and receive["primitive"] == "reach_human"
    assert receive["offset"] == pytest.approx([0.0, -0.065, 0.07])
    assert grasp_goal(mug, grasp, "object_mug", "take", 0.0)["offset"] == pytest.approx([0.0, -0.04, 0.07])
    give = delivery_goal(mug, grasp, mug["deliveries"]["handle_first"], "human_hand")
    # The palm in the hand frame, then the object from the palm, must result in the delivery pose.
    palm = Pose.from_dict({"xyz": give["offset"], "quaternion": give["orientation"]})
    held = palm * palm_at_grasp(grasp, 0.0).inverse()
    assert held.position == pytest.approx(mug["deliveries"]["handle_first"]["pose"]["xyz"])
    put = place_goal(mug, grasp, {"frame": "board", "xyz": [0.1, 0.2, 0.0]}, "put")
    assert put["frame"] == "board" and put["offset"] == pytest.approx([0.1, 0.16, 0.07])
