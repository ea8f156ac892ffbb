#!/usr/bin/python3
"""robot_real.launch against the simulated cell: neither hand nor elbow is faster than 0.25 m/s."""

from __future__ import annotations

import os
import sys
import unittest

import coglab_controllers
import numpy as np
import rospkg
import rospy
import rostest
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot_fixture import HOME, JOINTS, Robot, wait_until

GOAL = (0.80, 0.0, 0.45)
LIMIT = 0.25
ELBOW = 3
"""index of the joint whose origin is the elbow"""


class RobotReal(unittest.TestCase):
    """Two motions that would be much faster without the limits."""

    @classmethod
    def setUpClass(cls) -> None:
        urdf = rospkg.RosPack().get_path("lwr_description") + "/urdf/lwr_ih2.urdf"
        with open(urdf, encoding="utf-8") as file:
            cls.chain = coglab_controllers.Chain(file.read())
        cls.path: list[tuple[float, np.ndarray]] = []
        rospy.Subscriber("lwr/joint_states", JointState, cls.note, queue_size=100)
        cls.robot = Robot()
        cls.robot.load()
        primitives = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
        answer = cls.robot.dmp("load_dmps", primitives)
        assert answer.success, answer.message
        cls.robot.start()

    @classmethod
    def note(cls, message: JointState) -> None:
        by_name = dict(zip(message.name, message.position, strict=False))
        cls.path.append((message.header.stamp.to_sec(), np.array([by_name[n] for n in JOINTS])))

    def fastest(self) -> tuple[float, float]:
        """Speeds of hand and elbow over 0.3 s, m/s: the largest since the last call."""
        path, self.path[:] = list(self.path), []
        hand, elbow = 0.0, 0.0
        for t, q in path:
            later = next(((t2, q2) for t2, q2 in path if t2 >= t + 0.3), None)
            if later is None:
                break
            span = later[0] - t
            hand = max(hand, float(np.linalg.norm(self.chain.fk(later[1])[0] - self.chain.fk(q)[0])) / span)
            way = self.chain.joint_origins(later[1])[ELBOW] - self.chain.joint_origins(q)[ELBOW]
            elbow = max(elbow, float(np.linalg.norm(way)) / span)
        return hand, elbow

    def test_1_point_to_point(self) -> None:
        robot = self.robot
        robot.switch("ptp")
        robot.go(HOME)
        self.fastest()
        other = [HOME[0] + 0.8] + HOME[1:]
        answer = robot.add_ptp(other, [1.5] * 7)
        self.assertEqual(answer.status, 0, answer.message)
        wait_until(lambda: answer.ptp_id in robot.finished, 30.0, "finished_ptp")
        hand, elbow = self.fastest()
        self.assertLess(max(hand, elbow), 1.04 * LIMIT)
        self.assertGreater(hand, 0.75 * LIMIT, "the limit was reached, or this shows nothing")
        robot.go(HOME)

    def test_2_reach(self) -> None:
        robot = self.robot
        robot.switch("dmp")
        robot.see_hand(GOAL)
        rospy.sleep(0.3)
        self.fastest()
        answer = robot.execute(dmp_ratio=0.4)
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: robot.feedback.state == "running", 5.0, "running")
        wait_until(lambda: robot.feedback.state == "reached", 20.0, "reached")
        hand, elbow = self.fastest()
        self.assertLess(max(hand, elbow), 1.04 * LIMIT)
        self.assertGreater(hand, 0.75 * LIMIT)
        self.assertTrue(all(m.state != "aborted" for m in robot.feedbacks))


if __name__ == "__main__":
    rospy.init_node("robot_real")
    rostest.rosrun("coglab_controllers", "robot_real", RobotReal)
