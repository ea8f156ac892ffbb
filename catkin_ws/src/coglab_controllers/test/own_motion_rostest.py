#!/usr/bin/python3
"""Over ROS: a user's motion is loaded by its type, started, watched and cancelled; unloading; no active controller."""

from __future__ import annotations

import os
import sys
import unittest

import rosgraph
import rospy
import rostest
from coglab_msgs.msg import MotionFeedback, ReasonCode
from coglab_msgs.srv import StartMotion, StartMotionRequest, UnloadController

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from robot_fixture import HOME, Robot, wait_until

CIRCLE = "coglab_example_motions/Circle"


def services() -> set[str]:
    """Names of all services that the master knows."""
    return {name for name, _ in rosgraph.Master(rospy.get_name()).getSystemState()[2]}


class OwnMotion(unittest.TestCase):
    """One robot for all tests; they run in the order of their names."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.feedback: list[MotionFeedback] = []
        cls.robot = Robot()

        def told(message: MotionFeedback) -> None:
            cls.feedback.append(message)
            cls.robot.reasons.append(message.reason_code)

        rospy.Subscriber("controller_manager/circle/motion_feedback", MotionFeedback, told)
        cls.robot.load()
        cls.robot.start()
        cls.robot.go(HOME)

    def start(self, queue: bool = False, **arguments: float):
        request = StartMotionRequest(names=list(arguments), values=list(arguments.values()), queue=queue)
        answer = self.robot.call("controller_manager/circle/start_motion", StartMotion, request)
        self.robot.reasons.append(answer.reason_code)
        return answer

    def runs(self, motion_id: int) -> bool:
        return any(f.motion_id == motion_id and f.state == "running" for f in self.feedback)

    def ended(self, motion_id: int) -> list[MotionFeedback]:
        return [f for f in self.feedback if f.motion_id == motion_id and f.state in ("reached", "aborted")]

    def test_1_found_by_its_type_and_moves_the_arm(self) -> None:
        robot = self.robot
        answer = robot.manager("load_controller", "circle", CIRCLE)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(robot.switch("circle").controller_type, CIRCLE)

        def two_circles() -> None:
            home = robot.arm()
            first = self.start(radius=0.06, duration=5.0)  # it runs when the second one arrives
            self.assertTrue(first.success, first.message)
            self.assertEqual(first.status, StartMotionRequest.STARTED)
            second = self.start(queue=True, duration=2.0)
            self.assertEqual(second.status, StartMotionRequest.QUEUED)
            self.assertEqual(second.motion_id, first.motion_id + 1)
            wait_until(lambda: max(abs(a - b) for a, b in zip(robot.arm(), home, strict=True)) > 0.05, "the arm moves")
            wait_until(lambda: bool(self.ended(second.motion_id)), "the end of both")
            self.assertEqual([self.ended(a.motion_id)[0].state for a in (first, second)], ["reached", "reached"])
            self.assertTrue(any(f.state == "running" and f.queued == 1 and f.time > 0.5 for f in self.feedback))

        robot.unless_late(two_circles)

    def test_2_refusals_and_cancel_have_codes(self) -> None:
        self.assertEqual(self.start(radius=9.0).reason_code, ReasonCode.OUT_OF_RANGE)
        self.assertEqual(self.start(height=1.0).reason_code, ReasonCode.UNKNOWN_NAME)

        def cancelled() -> None:
            answer = self.start(duration=60.0)
            self.assertTrue(answer.success, answer.message)
            wait_until(lambda: self.runs(answer.motion_id), "the motion")
            done = self.robot.cancel("circle", "test")
            self.assertTrue(done.success and done.was_running, done.message)
            wait_until(lambda: bool(self.ended(answer.motion_id)), "the end of the motion")
            end = self.ended(answer.motion_id)[0]
            self.assertEqual((end.state, end.reason_code), ("aborted", ReasonCode.CANCELLED))
            self.assertIn("test", end.reason)

        self.robot.unless_late(cancelled)

    def test_3_no_controller_then_unload_with_all_services(self) -> None:
        robot = self.robot

        def unload(name: str):
            return robot.call("controller_manager/unload_controller", UnloadController, name)

        refused = unload("circle")
        self.assertEqual((refused.success, refused.reason_code), (False, ReasonCode.BUSY))

        def run() -> None:
            answer = self.start(duration=60.0)
            self.assertTrue(answer.success, answer.message)
            wait_until(lambda: self.runs(answer.motion_id), "the motion")

        robot.unless_late(run)
        answer = robot.manager("switch_controller", "")
        self.assertTrue(answer.success, answer.message)
        wait_until(lambda: robot.status.active_controller == "" and robot.status.standing, "no controller, standing")
        self.assertEqual(self.start().reason_code, ReasonCode.NOT_ACTIVE)
        for name in ("circle", "dmp"):
            self.assertTrue(any(f"/{name}/" in s for s in services()))
            answer = unload(name)
            self.assertTrue(answer.success, answer.message)
            self.assertNotIn(name, answer.controller_ids)
            self.assertFalse([s for s in services() if f"/{name}/" in s])
        self.assertEqual(unload("circle").reason_code, ReasonCode.UNKNOWN_NAME)
        self.assertTrue(robot.manager("load_controller", "circle", CIRCLE).success)
        robot.switch("circle")
        robot.unless_late(lambda: self.assertTrue(self.start(duration=2.0).success))


if __name__ == "__main__":
    rospy.init_node("own_motion")
    rostest.rosrun("coglab_controllers", "own_motion", OwnMotion)
