#!/usr/bin/python3
"""Who may move the arm of /robot over target_joint_states: others while no controller is active, nobody else after."""
from __future__ import annotations

import os
import sys
import unittest

import rospy
import rostest
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot_fixture import Robot, wait_until

A6 = 6
SPEED = 0.2  # rad/s


class TargetTopic(unittest.TestCase):
    def test_others_until_a_controller_is_active(self) -> None:
        robot = Robot()
        target = rospy.Publisher("lwr/target_joint_states", JointState, queue_size=1)
        timer = rospy.Timer(rospy.Duration(0.02),
                            lambda _: target.publish(JointState(velocity=[0.0] * A6 + [SPEED])))
        wait_until(lambda: robot.joints is not None, 20.0, "joint states")
        before = robot.arm()[A6]
        robot.start()  # no controller is loaded
        wait_until(lambda: robot.arm()[A6] > before + 0.1, 10.0, "motion asked for over the topic")
        answer = robot.manager("load_controller", "ptp", "coglab/PtpController")
        self.assertTrue(answer.success, answer.message)
        robot.switch("ptp")
        wait_until(lambda: abs(robot.joints.velocity[A6]) < 0.01, 5.0, "standing still")
        stood = robot.arm()[A6]
        rospy.sleep(1.0)
        self.assertAlmostEqual(robot.arm()[A6], stood, delta=0.005)
        timer.shutdown()


if __name__ == "__main__":
    rospy.init_node("target_topic")
    rostest.rosrun("coglab_controllers", "target_topic", TargetTopic)
