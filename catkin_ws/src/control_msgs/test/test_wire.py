"""Clients of the published package understand these messages: the md5 sums are those of control_msgs of ROS 1."""

from control_msgs import msg

PUBLISHED = {
    "FollowJointTrajectoryAction": "bc4f9b743838566551c0390c65f1a248",
    "FollowJointTrajectoryGoal": "69636787b6ecbde4d61d711979bc7ecb",
    "FollowJointTrajectoryActionGoal": "cff5c1d533bf2f82dd0138d57f4304bb",
    "FollowJointTrajectoryResult": "493383b18409bfb604b4e26c676401d2",
    "FollowJointTrajectoryActionResult": "c4fb3b000dc9da4fd99699380efcc5d9",
    "FollowJointTrajectoryFeedback": "10817c60c2486ef6b33e97dcd87f4474",
    "FollowJointTrajectoryActionFeedback": "d8920dc4eae9fc107e00999cce4be641",
    "JointTolerance": "f544fe9c16cf04547e135dd6063ff5be",
    "JointTrajectoryControllerState": "10817c60c2486ef6b33e97dcd87f4474",
}


def test_md5_sums_are_the_published_ones() -> None:
    assert {name: getattr(msg, name)._md5sum for name in PUBLISHED} == PUBLISHED
