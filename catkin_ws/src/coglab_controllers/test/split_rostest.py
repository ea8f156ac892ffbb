#!/usr/bin/python3
"""Bridge and controller manager as two nodes, and the simulated cell: load, ptp, reach, switch, refuse."""

from __future__ import annotations

import os
import signal
import sys
import unittest
import xmlrpc.client

import rosgraph
import rosnode
import rospkg
import rospy
import rostest
import tf2_ros

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import AddPtpRequest, LwrCommand
from diagnostic_msgs.msg import DiagnosticArray
from robot_fixture import HOME, Robot, end_all, robot_processes, wait_until
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState

GOAL = (0.80, 0.0, 0.45)


class Split(unittest.TestCase):
    """One robot for all tests; they run in the order of their names."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = Robot()
        cls.frames = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.frames)
        cls.robot.load()
        path = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
        answer = cls.robot.dmp("load_dmps", path)
        assert answer.success and answer.num_loaded >= 4, answer.message
        cls.robot.start()
        cls.robot.go(HOME)

    def test_1_list_and_active(self) -> None:
        listed = self.robot.manager("list_controllers")
        types = dict(zip(listed.controller_ids, listed.controller_types, strict=True))
        self.assertEqual((types["dmp"], types["ptp"]), ("coglab/DmpController", "coglab/PtpController"))
        active = self.robot.manager("get_active_controller")
        self.assertEqual(active.controller_id, "ptp")
        self.assertEqual(active.controller_type, "coglab/PtpController")

    def test_2_reaches_the_hand_and_follows_it(self) -> None:
        robot = self.robot
        answer = robot.switch("dmp")
        self.assertEqual(answer.controller_type, "coglab/DmpController")
        robot.see_hand(GOAL)

        def reach() -> None:
            wait_until(lambda: robot.execute().success, "execute_dmp")
            wait_until(
                lambda: self.frames.can_transform("lwr_base_link", "dmp_goal", rospy.Time(0)), "tf2 frame dmp_goal"
            )
            wait_until(lambda: robot.feedback.state == "reached", "reached")
            wait_until(lambda: robot.feedback.remaining_distance < 0.002, "2 mm from the goal")

        robot.unless_late(reach)
        goal = self.frames.lookup_transform("lwr_base_link", "dmp_goal", rospy.Time(0))
        place = goal.transform.translation
        for value, wanted in zip((place.x, place.y, place.z), GOAL, strict=False):
            self.assertAlmostEqual(value, wanted, delta=0.01)
        phases = [m.phase for m in robot.feedbacks if m.state == "running"]
        self.assertTrue(all(a >= b for a, b in zip(phases[-20:], phases[-19:], strict=False)))

    def test_3_switch_in_motion_ends_it_and_refuses_dmp(self) -> None:
        robot = self.robot
        robot.go(HOME)
        robot.switch("dmp")

        def begin() -> None:
            robot.feedbacks.clear()
            wait_until(lambda: robot.execute(dmp_ratio=6.0).success, "execute_dmp")
            wait_until(lambda: any(m.state == "running" and m.phase < 0.8 for m in robot.feedbacks), "in mid-motion")

        robot.unless_late(begin)
        refused = robot.add_ptp(HOME)
        self.assertEqual(refused.status, AddPtpRequest.REJECTED)
        self.assertEqual(refused.reason_code, ReasonCode.NOT_ACTIVE)
        self.assertIn("'dmp'", refused.message)
        robot.go(HOME)
        refused = robot.execute()
        self.assertFalse(refused.success)
        self.assertIn("'ptp'", refused.message)

    def test_5_cancel_ends_a_motion_and_its_queue_and_answers_when_the_arm_stands(self) -> None:
        robot = self.robot
        there = [HOME[0] + 0.6, *HOME[1:]]

        def cancel() -> None:
            robot.go(HOME)
            wait_until(lambda: robot.status.standing, "standing")
            ids = [robot.begin(there).ptp_id, robot.begin(HOME).ptp_id]
            wait_until(lambda: max(abs(v) for v in robot.joints.velocity) > 0.1, "in motion")
            wait_until(lambda: not robot.status.standing, "status of a moving arm")
            answer = robot.cancel("ptp", "a test gives up")
            self.assertTrue(answer.success, answer.message)
            self.assertTrue(answer.was_running)
            self.assertEqual(answer.reason_code, ReasonCode.NONE)
            wait_until(lambda: all(i in robot.unfinished for i in ids), "unfinished_ptp")
            for i in ids:
                self.assertEqual(robot.unfinished[i].reason_code, ReasonCode.CANCELLED)
                self.assertNotIn(i, robot.finished)
            wait_until(
                lambda: robot.status.standing and robot.status.reason_code == ReasonCode.CANCELLED,
                "status after the cancel",
            )
            self.assertIn("a test gives up", robot.status.reason)
            self.assertGreater(abs(robot.arm()[0] - there[0]), 0.05, "it went on to its target")

        robot.unless_late(cancel)
        again = robot.cancel("dmp")
        self.assertTrue(again.success, again.message)
        self.assertFalse(again.was_running)

    def test_6_foreign_target_velocities_are_refused_with_the_reason(self) -> None:
        """While a controller is active, another publisher of target_joint_states moves nothing."""
        robot = self.robot
        robot.go(HOME)
        told: list[str] = []
        counted: dict[str, int] = {}

        def diagnosed(message: DiagnosticArray) -> None:
            for status in message.status:
                if status.name.endswith("commands"):
                    counted.update((v.key, int(v.value)) for v in status.values)

        rospy.Subscriber("/rosout", Log, lambda m: told.append(m.msg))
        rospy.Subscriber("/diagnostics", DiagnosticArray, diagnosed)
        foreign = rospy.Publisher("lwr/target_joint_states", JointState, queue_size=1)
        wait_until(lambda: foreign.get_num_connections() > 0 and counted, "connections")

        def publish(cycles: int) -> None:
            rate = rospy.Rate(100)
            for _ in range(cycles):
                message = JointState(velocity=[0.0] * 6 + [0.4])
                message.header.stamp = rospy.Time.now()
                foreign.publish(message)
                rate.sleep()

        keys = ("refused: a controller is active", "refused: another publisher moves the arm")

        def refused() -> int:
            return sum(counted.get(key, 0) for key in keys)

        # A manager that a busy machine does not run pauses, and the other publisher may move the arm: try again then.
        for _ in range(5):
            before, already = robot.arm(), refused()
            # A queue of one message loses some on a busy machine, so that the counter ends this, not a number sent.
            while refused() <= already + 100:  # the time limit of the rostest ends it
                robot.start()  # a late computer may have ended command mode
                publish(20)
            if max(abs(now - then) for now, then in zip(robot.arm(), before, strict=True)) < 0.01:
                break
            robot.go(HOME)
        else:
            self.fail("another publisher moves the arm")
        wait_until(
            lambda: any("target_joint_states" in line and rospy.get_name() in line for line in told),
            "the reason with the publisher's name",
        )
        # The bridge knows only that another node moves the arm.
        helps = "/controller_manager moves the arm; end that one's motion first"
        self.assertTrue([line for line in told if helps in line], told)
        answer = robot.manager("switch_controller", "")
        self.assertTrue(answer.success, answer.message)

        def moves() -> bool:
            robot.start()
            publish(20)
            return robot.arm()[6] - before[6] > 0.1

        wait_until(moves, "motion asked for over the topic")
        foreign.unregister()
        robot.go(HOME)  # and the controller's own velocities still count

    def test_8_it_ends_when_it_is_asked_to(self) -> None:
        pids = robot_processes()
        self.assertTrue(pids)
        end_all(pids)

    def test_7_a_frozen_manager_moves_nothing_after_hold_and_reset(self) -> None:
        """The manager freezes during a motion. After hold and reset without it, it continues with its old state."""
        robot = self.robot
        target = [angle + 0.8 if joint == 6 else angle for joint, angle in enumerate(HOME)]
        manager = rosnode.get_api_uri(rosgraph.Master("/split"), "/controller_manager")
        process = xmlrpc.client.ServerProxy(manager).getPid("/split")[2]

        def begin() -> None:
            robot.go(HOME)
            self.assertEqual(robot.begin(target).status, AddPtpRequest.STARTED)
            wait_until(lambda: robot.joints.velocity[6] > 0.2, "in mid-motion")

        robot.unless_late(begin)
        os.kill(process, signal.SIGSTOP)
        try:
            for event in ("hold", "reset"):
                answer = robot.call("lwr/command", LwrCommand, event)
                self.assertTrue(answer.success, answer.message)
            wait_until(lambda: robot.state.motion_allowed, "motion allowed again")
            wait_until(lambda: max(abs(v) for v in robot.joints.velocity) < 0.01, "standing still")
            stood = robot.arm()
        finally:
            os.kill(process, signal.SIGCONT)
        rospy.sleep(0.6)
        for now, then in zip(robot.arm(), stood, strict=True):
            self.assertAlmostEqual(now, then, delta=0.003)
        robot.go(HOME)  # a motion that is asked for after the reset counts


if __name__ == "__main__":
    rospy.init_node("split")
    rostest.rosrun("coglab_controllers", "split", Split)
