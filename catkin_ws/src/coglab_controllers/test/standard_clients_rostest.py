#!/usr/bin/python3
"""Over ROS: examples/standard_client.py, which uses only standard messages, sends trajectories and twists."""

from __future__ import annotations

import os
import sys
import unittest

import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from coglab_msgs.msg import MotionFeedback, ReasonCode
from coglab_msgs.srv import StartMotion, StartMotionRequest
from control_msgs.msg import FollowJointTrajectoryFeedback, FollowJointTrajectoryResult
from geometry_msgs.msg import PoseStamped

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "examples"))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot_fixture import HOME, JOINTS, Robot, wait_until
from standard_client import Client

Result = FollowJointTrajectoryResult


class StandardClients(unittest.TestCase):
    """One robot for all tests; they run in the order of their names."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = Robot()
        cls.streams: dict[str, MotionFeedback] = {}
        for name in ("twist_stream", "pose_stream"):
            rospy.Subscriber(
                f"controller_manager/{name}/motion_feedback",
                MotionFeedback,
                lambda m, name=name: cls.streams.update({name: m}),
            )
        cls.robot.start()  # at HOME
        cls.client = Client()

    def open(self, stream: str):
        return self.robot.call(f"controller_manager/{stream}/start_motion", StartMotion, StartMotionRequest())

    def test_1_a_trajectory_takes_the_arm_and_is_followed(self) -> None:
        seen: list[FollowJointTrajectoryFeedback] = []
        self.client.trajectories.send_goal(
            self.client.goal([(1.0, {JOINTS[0]: HOME[0] + 0.2}), (2.0, {JOINTS[0]: HOME[0] + 0.3})]),
            feedback_cb=seen.append,
        )
        self.assertTrue(self.client.trajectories.wait_for_result(rospy.Duration(60.0)))
        result = self.client.trajectories.get_result()
        self.assertEqual(result.error_code, Result.SUCCESSFUL, result.error_string)
        self.assertEqual(self.client.trajectories.get_state(), GoalStatus.SUCCEEDED)
        self.assertAlmostEqual(self.robot.arm()[0], HOME[0] + 0.3, delta=0.02)
        self.assertEqual(self.robot.manager("get_active_controller").controller_id, "joint_trajectory")
        self.assertEqual(seen[-1].joint_names, JOINTS)
        self.assertLess(max(abs(e) for f in seen for e in f.error.positions), 0.2)

    def test_2_refusals_carry_the_codes_of_the_action(self) -> None:
        partial = self.client.goal([(1.0, {})])
        partial.trajectory.joint_names.pop()
        partial.trajectory.points[0].positions = partial.trajectory.points[0].positions[:-1]
        self.assertEqual(self.client.follow(partial).error_code, Result.INVALID_JOINTS)
        far = self.client.follow(self.client.goal([(1.0, {JOINTS[0]: 9.0})]))
        self.assertEqual(far.error_code, Result.INVALID_GOAL)
        self.assertIn("lwr_a1", far.error_string)
        self.assertEqual(self.client.trajectories.get_state(), GoalStatus.REJECTED)

    def test_3_a_newer_goal_preempts_and_a_cancel_brakes(self) -> None:
        states: list[int] = []
        slow = self.client.goal([(30.0, {JOINTS[0]: HOME[0]})])
        first = Client().trajectories
        first.send_goal(slow, done_cb=lambda state, _: states.append(state))
        wait_until(lambda: first.get_state() == GoalStatus.ACTIVE, "the first goal")
        self.client.trajectories.send_goal(slow)
        wait_until(lambda: states == [GoalStatus.PREEMPTED], "the end of the first goal")
        wait_until(lambda: self.client.trajectories.get_state() == GoalStatus.ACTIVE, "the second goal")
        refused = self.open("twist_stream")
        self.assertEqual(refused.reason_code, ReasonCode.BUSY, refused.message)
        self.client.trajectories.cancel_goal()
        self.assertTrue(self.client.trajectories.wait_for_result(rospy.Duration(60.0)))
        self.assertEqual(self.client.trajectories.get_state(), GoalStatus.PREEMPTED)
        wait_until(lambda: self.robot.status.standing, "the arm stands")

    def test_3b_a_goal_for_later_waits_for_its_stamp_and_can_be_cancelled(self) -> None:
        here = {JOINTS[0]: self.robot.arm()[0] + 0.1}
        goal = self.client.goal([(1.0, here)])
        goal.trajectory.header.stamp = begin = rospy.Time.now() + rospy.Duration(5.0)
        self.client.trajectories.send_goal(goal)
        self.assertTrue(self.client.trajectories.wait_for_result(rospy.Duration(60.0)))
        result = self.client.trajectories.get_result()
        self.assertEqual(result.error_code, Result.SUCCESSFUL, result.error_string)
        self.assertGreater(rospy.Time.now(), begin + rospy.Duration(0.9))
        goal.trajectory.header.stamp = rospy.Time.now() + rospy.Duration(50.0)
        self.client.trajectories.send_goal(goal)
        wait_until(lambda: self.client.trajectories.get_state() == GoalStatus.ACTIVE, "the goal")
        self.client.trajectories.cancel_goal()
        self.assertTrue(self.client.trajectories.wait_for_result(rospy.Duration(60.0)))
        self.assertEqual(self.client.trajectories.get_state(), GoalStatus.PREEMPTED)
        goal.trajectory.header.stamp = rospy.Time.now() + rospy.Duration(90.0)
        late = self.client.follow(goal)
        self.assertEqual(late.error_code, Result.INVALID_GOAL)
        self.assertIn("60 s", late.error_string)

    def test_4_a_stream_of_twists_moves_the_palm_and_ends_in_rest(self) -> None:
        answer = self.open("twist_stream")
        self.assertTrue(answer.success, answer.message)
        for frame in ("lwr_base_link", "ih2_palm"):
            before = self.robot.arm()

            def moved(frame=frame, before=before) -> bool:
                self.client.twist((0.0, 0.0, 0.1), frame, 0.5)
                return max(abs(a - b) for a, b in zip(self.robot.arm(), before, strict=True)) > 0.02

            wait_until(moved, f"the arm moves along z of {frame}")
        wait_until(lambda: self.streams["twist_stream"].reason_code == ReasonCode.GOAL_STALE, "the silence is seen")
        wait_until(lambda: self.robot.status.standing, "the arm stands")
        self.client.twist((float("nan"), 0.0, 0.0), seconds=0.1)
        self.client.twist((0.1, 0.0, 0.0), "no_such_frame", seconds=0.1)
        self.assertTrue(self.robot.status.standing)

    def test_5_poses_are_followed_in_the_frame_that_they_name(self) -> None:
        answer = self.open("pose_stream")
        self.assertEqual(answer.reason_code, ReasonCode.BUSY, "the twist stream is open")
        self.robot.cancel("twist_stream")
        answer = self.open("pose_stream")
        self.assertTrue(answer.success, answer.message)
        before = self.robot.arm()
        poses = rospy.Publisher("controller_manager/pose_stream/pose", PoseStamped, queue_size=1)
        message = PoseStamped()
        message.header.frame_id = "lwr_base_link"
        message.pose.position.x, message.pose.position.z, message.pose.orientation.w = 0.5, 0.6, 1.0

        def moved() -> bool:
            message.header.stamp = rospy.Time.now()
            poses.publish(message)
            return max(abs(a - b) for a, b in zip(self.robot.arm(), before, strict=True)) > 0.1

        wait_until(moved, "the arm moves")
        self.robot.cancel("pose_stream")


if __name__ == "__main__":
    rospy.init_node("standard_clients")
    rostest.rosrun("coglab_controllers", "standard_clients", StandardClients)
