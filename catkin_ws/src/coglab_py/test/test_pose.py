"""Poses, and poses from and to geometry_msgs."""

from __future__ import annotations

import numpy as np
import pytest
from coglab_py.messages import pose_message, pose_of
from coglab_py.pose import Pose, about_z, mean_pose, rotation
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage

RNG = np.random.default_rng(5)


def random_pose() -> Pose:
    q = RNG.normal(size=4)
    return Pose(RNG.normal(size=3), q / np.linalg.norm(q))


def matrix(pose: Pose) -> np.ndarray:
    """Homogeneous matrix, from the formula of the quaternion."""
    x, y, z, w = pose.orientation
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.block([[turn, pose.position[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def test_poses_compose_as_matrices_do():
    for _ in range(200):
        a, b = random_pose(), random_pose()
        assert matrix(a * b) == pytest.approx(matrix(a) @ matrix(b), abs=1e-12)
        assert matrix(a * a.inverse()) == pytest.approx(np.eye(4), abs=1e-12)
        point = RNG.normal(size=3)
        assert a.apply(point) == pytest.approx((matrix(a) @ [*point, 1.0])[:3], abs=1e-12)
        assert np.array([a.axis(i) for i in range(3)]).T == pytest.approx(matrix(a)[:3, :3], abs=1e-12)


def test_distance_has_position_and_smallest_rotation():
    far, angle = Pose().distance(Pose(np.array([3.0, 4.0, 0.0]), -about_z(0.3)))
    assert (far, angle) == pytest.approx((5.0, 0.3))


def test_the_mean_of_two_poses_lies_half_way():
    one, other = Pose(np.array([1.0, 2.0, 3.0]), about_z(0.2)), Pose(np.array([3.0, 6.0, -3.0]), about_z(0.6))
    mean = mean_pose([one, other])
    assert mean.position == pytest.approx([2.0, 4.0, 0.0])
    assert mean.distance(Pose(mean.position, about_z(0.4))) == pytest.approx((0.0, 0.0), abs=1e-7)


def test_reading():
    assert Pose.from_dict({"xyz": [1, 2, 3], "quaternion": [0, 0, 2, 0]}).orientation == pytest.approx([0, 0, 1, 0])
    assert Pose.from_dict({"xyz": [1, 2, 3]}).orientation == pytest.approx([0, 0, 0, 1])
    assert Pose.from_dict({"xyz": [0, 0, 0], "rpy_deg": [0, 0, 90]}).axis(0) == pytest.approx([0, 1, 0], abs=1e-12)
    # Fixed axes: the roll comes first, then the yaw rotates the rolled y axis.
    assert Pose.from_dict({"rpy_deg": [90, 0, 90]}).axis(1) == pytest.approx([0, 0, 1], abs=1e-12)
    pose = random_pose()
    assert matrix(Pose.from_dict(pose.to_dict())) == pytest.approx(matrix(pose))


@pytest.mark.parametrize(
    "data, sentence",
    [
        ({"xyz": [0, 0]}, "xyz has three"),
        ({"rpy_deg": [0, float("nan"), 0]}, "rpy_deg has three"),
        ({"quaternion": [0, 0, 0, 0]}, "no direction"),
        ({"quaternion": [0, 0, 1]}, "four finite numbers"),
        ({"quaternion": [0, 0, float("inf"), 1]}, "four finite numbers"),
        ({"quaternion": [[0, 0, 0, 1]]}, "four finite numbers"),
        ({"quaternion": [0, 0, 0.6e-9, 0.6e-9]}, "no direction"),
        ({"xyz": [0, float("inf"), 0]}, r"xyz .* m, got \[0, inf, 0\]"),
        ({"xyz": [0, 0, 0, 0]}, "xyz has three"),
        ({"rpy_deg": [0, 0]}, r"rpy_deg .* degrees, got \[0, 0\]"),
    ],
)
def test_malformed_poses_are_refused(data, sentence):
    with pytest.raises(ValueError, match=sentence):
        Pose.from_dict(data)


def test_the_mean_of_noisy_poses_does_not_depend_on_quaternion_signs():
    truth = random_pose()
    noisy = [
        truth * Pose(0.01 * RNG.normal(size=3), rotation([*(0.01 * RNG.normal(size=3)), 1.0]).as_quat())
        for _ in range(400)
    ]
    mixed = [Pose(pose.position, pose.orientation * (-1) ** i) for i, pose in enumerate(noisy)]
    far, angle = mean_pose(mixed).distance(truth)
    assert far < 0.003 and angle < 0.004
    with pytest.raises(ValueError):
        mean_pose([])


MESSAGE = PoseMessage(Point(1.0, 2.0, 3.0), Quaternion(0.1, 0.3, 0.5, 0.7))


def test_a_message_as_a_pose():
    pose = pose_of(MESSAGE)
    assert pose.position == pytest.approx([1.0, 2.0, 3.0])
    assert pose.orientation == pytest.approx([0.1, 0.3, 0.5, 0.7])


def test_a_pose_as_a_message():
    assert pose_message(Pose(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.3, 0.5, 0.7]))) == MESSAGE
    assert pose_message(Pose()) == PoseMessage(Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
