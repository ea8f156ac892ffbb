#!/usr/bin/python3
"""Who may move the arm of /robot over target_joint_states: other nodes, but only while no controller is active."""

from __future__ import annotations

import os
import sys
import unittest
import xmlrpc.client
from pathlib import Path

import rosgraph
import rosnode
import rospy
import rostest
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot_fixture import Robot, wait_until

A6 = 6


def priorities(process: int) -> dict[str, int]:
    """SCHED_FIFO priority (0: none) of the threads of a process, by their names."""
    tasks = [task for task in Path(f"/proc/{process}/task").iterdir()]
    return {(task / "comm").read_text().strip(): os.sched_getparam(int(task.name)).sched_priority for task in tasks}


SPEED = 0.2  # rad/s


class TargetTopic(unittest.TestCase):
    def test_others_until_a_controller_is_active(self) -> None:
        robot = Robot()
        target = rospy.Publisher("lwr/target_joint_states", JointState, queue_size=1)
        message = JointState(velocity=[0.0] * A6 + [SPEED])

        def publish(_: object) -> None:
            message.header.stamp = rospy.Time.now()
            target.publish(message)

        timer = rospy.Timer(rospy.Duration(0.02), publish)
        wait_until(lambda: robot.joints is not None, "joint states")
        before = robot.arm()[A6]
        # No controller is loaded.
        robot.unless_late(lambda: wait_until(lambda: robot.arm()[A6] > before + 0.1, "motion asked for over the topic"))
        answer = robot.manager("load_controller", "ptp", "coglab/PtpController")
        self.assertTrue(answer.success, answer.message)
        robot.switch("ptp")
        wait_until(lambda: abs(robot.joints.velocity[A6]) < 0.01, "standing still")
        robot_node = rosnode.get_api_uri(rosgraph.Master("/target_topic"), "/robot")
        by_thread = priorities(xmlrpc.client.ServerProxy(robot_node).getPid("/target_topic")[2])
        # Asked for as much as the FRI thread has: the answers to the robot come first all the same.
        self.assertLess(by_thread["control"], max(by_thread["fri"], 1))
        stood = robot.arm()[A6]
        rospy.sleep(1.0)
        self.assertAlmostEqual(robot.arm()[A6], stood, delta=0.005)
        timer.shutdown()


if __name__ == "__main__":
    rospy.init_node("target_topic")
    rostest.rosrun("coglab_controllers", "target_topic", TargetTopic)
