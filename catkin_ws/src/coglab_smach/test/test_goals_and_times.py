"""Geometry and times of the machines: goals, costs of a grasp, durations, clearance above the board."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from coglab_controllers import load_joint_limits
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z
from coglab_smach.kinematics import board_room
from coglab_smach.kinematics.goals import (
    approach_of,
    cost,
    palm_at_grasp,
    ranked,
)
from coglab_smach.kinematics.motion_time import MotionLimits, hand_path, ptp_time, reach_time, read_limits
from coglab_smach.kinematics.reachability import default_arm

GRASP = {
    "hand": {"mode": "cylindrical", "level": "low"},
    "pose": {"xyz": [0.0, -0.04, 0.07], "quaternion": [0.0, 0.0, 0.0, 1.0]},
    "approach": {"axis": [0.0, 2.0, 0.0], "distance": 0.025},
}
ENTRY = {"dmp": {"receive": "a", "give": "b", "take": "c", "put": "d"}, "grasps": {"side": GRASP}}

# --- goals ------------------------------------------------------------------------------------------------------------


def test_the_standoff_of_a_palm_is_against_the_approach_axis():
    assert palm_at_grasp(GRASP).position == pytest.approx([0.0, -0.065, 0.07]), "as stored"
    assert palm_at_grasp(GRASP, 0.0).position == pytest.approx([0.0, -0.04, 0.07])
    assert palm_at_grasp(GRASP, 0.1).position == pytest.approx([0.0, -0.14, 0.07])
    bare = {"pose": {"xyz": [0.1, 0.0, 0.0], "quaternion": about_z(math.pi / 2).tolist()}}
    assert palm_at_grasp(bare).position == pytest.approx([0.1, 0.0, 0.0]), "no distance: none"
    assert palm_at_grasp(bare, 0.05).position == pytest.approx([0.1, -0.05, 0.0]), "no axis: the palm's x"
    assert approach_of(GRASP, 0.03) == pytest.approx([0.0, 0.03, 0.0])
    assert approach_of(bare, 0.03) == pytest.approx([0.0, 0.03, 0.0])


def test_cost_of_a_grasp():
    seen = Pose(np.array([1.0, 0.0, 0.0]))
    palm = np.array([1.0, -0.04, 0.07])
    tips = {**GRASP, "hand": {"mode": "tridigit", "level": "low"}}
    assert cost(GRASP, seen, None, None) == 0.0 and cost(tips, seen, None, None) == 1.0
    for distance, price in ((0.0, 1.0), (0.03, 0.75), (0.12, 0.0), (0.3, 0.0)):
        assert cost(GRASP, seen, palm + [0.0, distance, 0.0], None) == pytest.approx(price)
    # Angle between the palm's x axis and the path from the present palm.
    for start, price in (([0.5, 0, 0], 0.0), ([0, 0.5, 0], 0.5), ([-0.5, 0, 0], 1.0), ([0.5, 0.5, 0], 0.25)):
        assert cost(GRASP, seen, None, palm - start) == pytest.approx(price, abs=1e-6)
    assert cost(GRASP, seen, None, palm) == pytest.approx(0.5), "the palm is already at the grasp"


@pytest.mark.parametrize(("better", "stays"), [(0.19, True), (0.21, False)])
def test_the_chosen_grasp_stays_until_another_is_better_by_a_fifth(better, stays):
    far = {**GRASP, "pose": {**GRASP["pose"], "xyz": [0.0, -0.04 - 0.12 * better, 0.07]}}
    entry, person = {"grasps": {"near": GRASP, "far": far}}, np.array([1.0, -0.04, 0.07])
    seen = Pose(np.array([1.0, 0.0, 0.0]))
    assert ranked(entry, seen, person, None) == ["far", "near"]
    assert ranked(entry, seen, person, None, "near")[0] == ("near" if stays else "far")
    assert ranked(entry, seen, person, None, "gone") == ["far", "near"]


# --- times ------------------------------------------------------------------------------------------------------------


def limits(velocity=2.0, acceleration=4.0, hand=math.inf):
    return MotionLimits((velocity,) * 7, (acceleration,) * 7, (0.5,) * 7, (1.0,) * 7, hand)


def test_ptp_time_follows_the_slowest_joint_or_the_hands_path():
    way = [0.0, 0.2, 0.0, -1.0, 0.0, 0.0, 0.0]
    assert ptp_time(limits(), [0.0] * 7, way) == pytest.approx(1.0 / 0.5 + 0.5 / 1.0)
    assert ptp_time(limits(), way, [0.0] * 7, [0.25] * 7) == pytest.approx(1.0 / 0.25 + 0.25)
    assert ptp_time(limits(), [0.0] * 7, way, [0.5, 0.05, *[0.5] * 5]) == pytest.approx(0.2 / 0.05 + 0.05)
    length = hand_path([0.0] * 7, way)
    assert ptp_time(limits(hand=0.01), [0.0] * 7, way) == pytest.approx(length / 0.01)
    assert hand_path([0.0] * 7, [0.0] * 7) == 0.0
    places = [default_arm().fk(s * np.array(way))[0] for s in np.linspace(0.0, 1.0, 400)]
    assert length == pytest.approx(sum(math.dist(a, b) for a, b in zip(places, places[1:], strict=False)), rel=1e-3)
    bent = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]
    assert hand_path([0.0] * 7, bent, 3) < hand_path([0.0] * 7, bent)


def test_reach_time_counts_path_rotation_and_start():
    assert reach_time(limits(), 0.4) == pytest.approx(0.4 / 0.8 + math.pi / 2.0 + 0.5)
    assert reach_time(limits(hand=0.1), 0.4) == pytest.approx(4.0 + math.pi / 2.0 + 0.5)
    uneven = MotionLimits((2.0, *[1.0] * 6), (4.0, 1.0, *[4.0] * 5), (1.0,) * 7, (1.0,) * 7)
    assert reach_time(uneven, 0.4) == pytest.approx(1.0 + math.pi + 1.0)


def test_limits_come_from_the_managers_parameters():
    table = load_joint_limits(str(package_path("lwr_description", "config", "joint_limits.yaml")), "default")
    plain = read_limits({})
    assert plain.velocity == pytest.approx(table.velocity) and plain.acceleration == pytest.approx(table.acceleration)
    assert plain.ptp_velocity == pytest.approx(0.3 * np.array(table.velocity))
    assert plain.ptp_acceleration == pytest.approx(0.2 * np.array(table.acceleration))
    assert plain.hand_speed == 1.0
    asked = read_limits(
        {
            "joint_vel_limit": [0.5] * 7,
            "ptp": {"default_speed": 0.6, "default_acceleration": 0.1},
            "hand_speed_limit": 0.4,
            "elbow_speed_limit": 0.3,
        }
    )
    assert asked.velocity == (0.5,) * 7 and asked.ptp_velocity == pytest.approx([0.3] * 7)
    assert asked.ptp_acceleration == pytest.approx(0.1 * np.array(table.acceleration)) and asked.hand_speed == 0.3
    for hand, elbow, speed in ((0.0, 0.7, 0.7), (0.7, 0.0, 0.7), (0.0, 0.0, math.inf)):
        assert read_limits({"hand_speed_limit": hand, "elbow_speed_limit": elbow}).hand_speed == speed


# --- the board --------------------------------------------------------------------------------------------------------


def solid(text):
    return board_room.read_solid(ElementTree.fromstring(f"<collision>{text}</collision>"))


def test_the_lowest_point_of_plain_shapes():
    up, level = np.array([0.0, 0.0, 1.0]), Pose(np.array([0.0, 0.0, 1.0]))
    tilted = Pose(np.array([0.0, 0.0, 1.0]), np.array([math.sin(math.pi / 8), 0.0, 0.0, math.cos(math.pi / 8)]))
    box = solid('<origin xyz="0 0 0.5"/><geometry><box size="0.2 0.4 0.6"/></geometry>')
    assert box.below(level, up) == pytest.approx(1.5 - 0.3)
    assert box.below(tilted, up) == pytest.approx(1.0 + (0.5 - 0.3 - 0.2) / math.sqrt(2.0))
    bar = solid('<geometry><cylinder radius="0.1" length="1.0"/></geometry>')
    assert bar.below(level, up) == pytest.approx(0.5) and bar.kind == "cylinder"
    assert bar.below(tilted, up) == pytest.approx(1.0 - 0.6 / math.sqrt(2.0))
    lying = solid('<origin rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="0.1" length="1.0"/></geometry>')
    assert lying.below(level, up) == pytest.approx(0.9)
    ball = solid('<origin xyz="0.3 0 0.2"/><geometry><sphere radius="0.1"/></geometry>')
    assert ball.below(level, up) == pytest.approx(1.1) == ball.below(level, up)
    assert solid('<geometry><mesh filename="hand.stl"/></geometry>') is None
