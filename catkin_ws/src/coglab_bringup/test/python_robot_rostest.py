#!/usr/bin/python3
"""coglab.connect() on the running simulated cell: motions, hold and reset, and an exchange each way."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import unittest
from collections.abc import Callable
from unittest import mock

import coglab
import numpy as np
import rosnode
import rospy
import rostest
from coglab.running import NoRobot
from coglab_bringup.handover import READY_LIMIT
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import Start
from coglab_py.packages import package_path

sys.path.insert(0, str(package_path("coglab_controllers", "test")))
from lateness import Lateness, say_again

LIMIT = 180.0  # s for a motion or an exchange on a loaded machine


class PythonRobot(unittest.TestCase):
    """One system for all tests; they run in the order of their names."""

    @classmethod
    def setUpClass(cls) -> None:
        end = time.monotonic() + 5 * READY_LIMIT  # READY_LIMIT is without progress; here nodes still come
        while True:
            try:
                cls.robot = coglab.connect()
                if cls.robot.state.actions:
                    break
                cls.robot.close()
            except NoRobot:
                pass
            if time.monotonic() > end:
                raise TimeoutError("the system is not ready")
            time.sleep(0.5)
        cls.lateness = Lateness()

    def done(self, act: Callable[[], coglab.Result]) -> coglab.Result:
        """Acts and expects success. Acts again if a late computer may be why it failed."""
        for left in (2, 1, 0):
            self.lateness.begin()
            try:
                result = act()
                problem, code = str(result), result.code
                if result.ok:
                    return result
            except coglab.Refused as refused:
                problem, code = str(refused), refused.code
            except TimeoutError as silent:
                problem, code = str(silent), ReasonCode.TIME_LIMIT
            if not left or not self.lateness.may_explain(code):
                self.fail(problem)
            say_again("a call of the robot", problem)
            self.robot.reset(limit=LIMIT)
        raise AssertionError(problem)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.robot.close()

    def test_1_moves_and_stops_at_the_end_of_a_block(self) -> None:
        arm = self.robot.arm
        target = arm.home + 0.1
        self.done(lambda: arm.move_joints(target, limit=LIMIT))
        self.assertLess(np.abs(arm.joints - target).max(), 0.01)
        for left in (2, 1, 0):
            self.lateness.begin()
            with arm.start_joints(arm.home - 0.3, duration=8.0, limit=LIMIT) as motion:
                time.sleep(1.0)
                done = motion.done
            if not done or not left or not self.lateness.may_explain(motion.result.code):
                break
            say_again("start_joints", motion.result)
            self.robot.reset(limit=LIMIT)
        self.assertFalse(done)
        self.assertEqual((motion.result.ok, motion.result.reason), (False, "CANCELLED"))
        self.assertTrue(self.robot.state.standing)
        self.assertGreater(np.abs(arm.joints - arm.home + 0.3).max(), 0.05)

    def test_2_reaches_a_pose_and_follows_a_function(self) -> None:
        arm = self.robot.arm
        self.done(lambda: arm.move_joints(arm.home, limit=LIMIT))
        palm = arm.palm
        there = coglab.Pose(palm.position + [0.05, 0.0, 0.05], palm.orientation)
        self.done(lambda: arm.move_to(there, limit=LIMIT))
        self.assertLess(np.linalg.norm(arm.palm.position - there.position), 0.01)
        self.done(lambda: arm.reach("reach_human", palm, limit=LIMIT))
        self.assertLess(np.linalg.norm(arm.palm.position - palm.position), 0.01)
        self.done(lambda: arm.follow(lambda t: palm.position + [0.0, 0.03 * t, 0.0], 3.0, limit=LIMIT))
        self.assertGreater(arm.palm.position[1] - palm.position[1], 0.03)

    def test_3_hold_is_latched_until_reset(self) -> None:
        robot = self.robot
        self.assertTrue(robot.hold().ok)
        with self.assertRaises(coglab.Refused) as refused:
            robot.arm.move_joints(robot.arm.home)
        self.assertIn("robot.reset()", str(refused.exception))
        self.done(lambda: robot.reset(limit=LIMIT))

    def test_4_receives_and_gives_back(self) -> None:
        robot = self.robot
        robot.events()
        with self.assertRaises(coglab.Refused) as refused:
            robot.give()
        self.assertEqual(refused.exception.code, ReasonCode.WRONG_STATE)
        with self.assertRaises(coglab.Refused) as refused:
            robot.receive("teapot_of_nobody")
        self.assertEqual(refused.exception.code, ReasonCode.OBJECT_UNKNOWN)
        received = self.done(lambda: robot.receive("mug", limit=LIMIT))
        self.assertEqual(robot.state.holding, "mug")
        self.assertTrue(received.started <= received.marks["closed"] <= received.ended <= rospy.get_time())
        with self.assertRaises(coglab.Refused):
            robot.hand.open()
        # A client that uses only actionlib and the messages gives it back.
        client = str(package_path("coglab_smach", "examples", "handover_client.py"))
        give = [sys.executable, client, "give", "mug"]
        for left in (2, 1, 0):
            self.lateness.begin()
            given = subprocess.run(give, capture_output=True, text=True, timeout=LIMIT)
            if given.returncode == 0:
                break
            if not left or not self.lateness.may_explain(robot.state.code):
                self.fail(given.stdout + given.stderr)
            say_again("give", given.stdout + given.stderr)
            robot.reset(limit=LIMIT)
        self.assertIn("/exchange_robot_to_human/", given.stdout)
        self.assertEqual(robot.state.holding, "")
        kinds = {event.kind for event in robot.events()}
        self.assertEqual(kinds, {"transition", "result", "said"})
        self.assertTrue(robot.hand.preshape("lateral", limit=LIMIT).ok)

    def test_5_several_connections_and_a_clean_end(self) -> None:
        with coglab.connect(limit=60.0) as second:
            self.assertEqual(second.state.holding, self.robot.state.holding)
        with self.assertRaises(RuntimeError):
            second.arm.joints  # noqa: B018  (a property that is refused)
        self.assertEqual(self.robot.arm.joints.shape, (7,))
        own = [name for name in rosnode.get_node_names() if "coglab_python" in name or name == rospy.get_name()]
        self.assertEqual(own, [rospy.get_name()])
        with self.assertRaises(NoRobot):
            coglab.connect(namespace="nowhere")
        with mock.patch("coglab.running.LwrCommand", Start), self.assertRaisesRegex(NoRobot, "another version"):
            coglab.connect()
        before = os.environ["ROS_MASTER_URI"]
        with self.assertRaises(NoRobot):
            coglab.connect("1")
        self.assertEqual(os.environ["ROS_MASTER_URI"], before)


if __name__ == "__main__":
    rostest.rosrun("coglab_bringup", "python_robot", PythonRobot, sys.argv)
