#!/usr/bin/python3
"""Controllers on the ideal arm: point-to-point, DMP, feedback, hold and reset, shutdown."""

from __future__ import annotations

import sys
import time
import unittest

import rosnode
import rospkg
import rospy
import rostest

sys.path.insert(0, rospkg.RosPack().get_path("coglab_controllers") + "/test")
from coglab_msgs.msg import ControllerStatus, FeedbackStatus, LwrState, ReasonCode
from coglab_msgs.srv import AddPtpRequest, FeedbackSelect, LwrCommand
from robot_fixture import HOME, JOINTS, Robot, end_all, robot_processes, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String

GOAL = (0.80, 0.0, 0.45)
AWAY = [HOME[0] + 0.5, *HOME[1:]]


class IdealArm(unittest.TestCase):
    """One robot for all tests; they run in the order of their names."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = Robot()
        cls.events = rospy.Publisher("lwr/ros_events", String, queue_size=1)
        cls.states: list[LwrState] = []
        rospy.Subscriber("lwr/state", LwrState, cls.states.append)

    def command(self, event: str) -> object:
        return self.robot.call("lwr/command", LwrCommand, event)

    def test_1_stands_at_home_until_start(self) -> None:
        joints = rospy.wait_for_message("lwr/joint_states", JointState, 60.0)
        self.assertEqual(joints.name, JOINTS)
        self.assertEqual(list(joints.position), HOME)
        state = rospy.wait_for_message("lwr/state", LwrState, 60.0)
        self.assertEqual((state.supervisor, state.motion_allowed, state.next_event), ("monitor", False, "start"))
        self.assertEqual(state.reason_code, ReasonCode.NOT_IN_COMMAND_MODE)
        wait_until(lambda: self.robot.manager("get_active_controller").controller_id == "ptp", "ptp active")
        self.assertLessEqual({"dmp", "ptp"}, set(self.robot.manager("list_controllers").controller_ids))
        refused = self.robot.add_ptp(AWAY)
        self.assertEqual(refused.status, AddPtpRequest.REJECTED)
        self.assertEqual(refused.reason_code, ReasonCode.NOT_IN_COMMAND_MODE)
        nodes = set(rosnode.get_node_names())
        self.assertIn("/robot", nodes)
        self.assertFalse(nodes & {"/lwr", "/cell", "/coglab_sim", "/ih2_hand", "/coglab", "/perception"}, nodes)

    def test_1b_state_and_status_are_published_again_without_a_change(self) -> None:
        """Thus observers can detect a silent node."""
        told: list[ControllerStatus] = []
        rospy.Subscriber("controller_manager/status", ControllerStatus, told.append)
        count = len(self.states)
        wait_until(lambda: len(told) >= 4 and len(self.states) >= count + 4, "four messages more of each")
        self.assertEqual(len({(one.state, one.active_controller, one.plan_generation) for one in told[1:]}), 1)

    def test_2_goes_from_point_to_point(self) -> None:
        self.robot.start()
        self.robot.go(AWAY)
        for value, wanted in zip(self.robot.arm(), AWAY, strict=True):
            self.assertAlmostEqual(value, wanted, delta=2e-3)  # ptp/tolerance

    def test_3_hold_brakes_and_latches_until_reset(self) -> None:
        robot = self.robot
        motions = []

        def begin() -> None:
            robot.go(AWAY)
            motion = robot.add_ptp(HOME, [0.05] * 7)  # 10 s: it runs when the hold comes
            self.assertEqual(motion.status, AddPtpRequest.STARTED, motion.message)
            wait_until(lambda: max(abs(v) for v in robot.joints.velocity) > 0.04, "in motion")
            motions.append(motion.ptp_id)

        robot.unless_late(begin)
        self.events.publish("hold")
        wait_until(lambda: robot.state.hold_latched, "hold")
        self.assertEqual((robot.state.supervisor, robot.state.reason_code), ("holding", ReasonCode.HELD))
        wait_until(lambda: not any(robot.joints.velocity), "stand-still")
        wait_until(lambda: motions[-1] in robot.unfinished, "unfinished_ptp")
        held = robot.arm()
        refused = self.command("start")
        self.assertEqual((refused.success, refused.reason_code), (False, ReasonCode.HELD))
        self.assertEqual(robot.add_ptp(HOME).status, AddPtpRequest.REJECTED)
        time.sleep(0.3)
        self.assertEqual(robot.arm(), held)
        self.assertTrue(self.command("reset").success)
        wait_until(lambda: robot.state.motion_allowed, "motion allowed")
        self.assertEqual(robot.arm(), held)  # the motion before the hold has ended
        robot.go(HOME)

    def test_4_reaches_a_tf_goal_with_feedback_controllers(self) -> None:
        robot = self.robot
        path = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
        self.assertTrue(robot.dmp("load_dmps", path).success)
        robot.switch("dmp")
        enabled = robot.call("controller_manager/feedback/enable", FeedbackSelect, ["ee_admittance"], "")
        self.assertTrue(enabled.success, enabled.message)
        status = rospy.wait_for_message("controller_manager/feedback/status", FeedbackStatus, 60.0)
        self.assertTrue(status.controllers)
        robot.see_hand(GOAL)

        def reach() -> None:
            wait_until(lambda: robot.execute().success, "execute_dmp")
            wait_until(lambda: robot.feedback.state == "reached", "reached")

        robot.unless_late(reach)
        self.assertLess(robot.feedback.remaining_distance, 0.006)

    def test_5_modes_with_forces_are_refused(self) -> None:
        refused = self.command("joint_impedance stiffness 500")
        self.assertEqual((refused.success, refused.reason_code), (False, ReasonCode.NOT_SUPPORTED))
        unknown = self.command("jump")
        self.assertEqual(unknown.reason_code, ReasonCode.INVALID_ARGUMENT)
        self.assertIn("start, stop, hold, reset, position", unknown.message)

    def test_6_a_stop_needs_a_start(self) -> None:
        self.assertTrue(self.command("stop").success)
        wait_until(lambda: self.robot.state.supervisor == "monitor", "monitor")
        self.assertFalse(self.robot.state.motion_allowed)
        epochs = [state.motion_epoch for state in self.states]
        self.assertEqual(epochs, sorted(epochs))

    def test_7_ends_at_once_and_is_restarted(self) -> None:
        first = robot_processes()
        self.assertEqual(len(first), 1)
        end_all(first)
        wait_until(lambda: robot_processes() not in ([], first), "a new process")


if __name__ == "__main__":
    rospy.init_node("ideal_arm_rostest")
    rostest.rosrun("coglab_bringup", "ideal_arm", IdealArm, sys.argv)
