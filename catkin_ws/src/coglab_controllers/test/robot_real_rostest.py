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

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot_fixture import HOME, JOINTS, Robot, wait_until

GOAL = (0.80, 0.0, 0.45)
LIMIT = 0.25
ELBOW = 3
"""index of the joint whose origin is the elbow"""


class RobotReal(unittest.TestCase):
    """Motions that would be much faster without the limits."""

    @classmethod
    def setUpClass(cls) -> None:
        urdf = rospkg.RosPack().get_path("lwr_description") + "/urdf/lwr_ih2.urdf"
        with open(urdf, encoding="utf-8") as file:
            cls.chain = coglab_controllers.Chain(file.read())
        cls.robot = Robot()
        cls.robot.load()
        primitives = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
        answer = cls.robot.dmp("load_dmps", primitives)
        assert answer.success, answer.message
        cls.robot.start()

    def test_1_point_to_point(self) -> None:
        robot = self.robot
        robot.go(HOME)
        robot.go([HOME[0] + 0.8, *HOME[1:]])
        robot.go(HOME)

    def test_2_reach(self) -> None:
        robot = self.robot
        robot.switch("dmp")
        robot.see_hand(GOAL)

        def reach() -> None:
            robot.feedbacks.clear()
            wait_until(lambda: robot.execute(dmp_ratio=0.4).success, "execute_dmp")
            wait_until(lambda: any(m.state == "running" for m in robot.feedbacks), "running")
            wait_until(lambda: robot.feedback.state not in ("running", "holding"), "the end of the reach")

        robot.unless_late(reach)

    def test_3_neither_hand_nor_elbow_was_faster(self) -> None:
        """By the cell's own log, whose time a busy computer cannot change; over 0.3 s."""
        rows = np.genfromtxt(rospy.get_param("~log"), delimiter=",", names=True, invalid_raise=False)
        moving = np.array([rows[f"measured_{name}"] for name in JOINTS]).T
        span = np.searchsorted(rows["time"], rows["time"][0] + 0.3)
        hand = np.array([self.chain.fk(q)[0] for q in moving])
        elbow = np.array([self.chain.joint_origins(q)[ELBOW] for q in moving])
        seconds = (rows["time"][span:] - rows["time"][:-span])[:, None]
        fastest = [np.linalg.norm((way[span:] - way[:-span]) / seconds, axis=1).max() for way in (hand, elbow)]
        self.assertLess(max(fastest), 1.04 * LIMIT)
        self.assertGreater(fastest[0], 0.5 * LIMIT, "the arm hardly moved")


if __name__ == "__main__":
    rospy.init_node("robot_real")
    rostest.rosrun("coglab_controllers", "robot_real", RobotReal)
