#!/usr/bin/python3
"""Over ROS: goals from the goal helper, ik_debug, refusals, speed scale, feedback services."""

from __future__ import annotations

import math
import os
import sys

import rospkg
import rospy
import rostest
from coglab_msgs.msg import DmpGoal, FeedbackStatus, IkDebug, PredictedPath, ReasonCode
from coglab_msgs.srv import (
    AddPtpRequest,
    PredictDmpRequest,
    SwitchDmpRequest,
)
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from feedback_on_ros import FeedbackOnRos
from lateness import LATE
from robot_fixture import HOME, JOINTS, Robot, end_all, frozen_master, robot_processes, wait_until

GOAL = (0.80, 0.0, 0.45)
ASIDE = (0.65, -0.15, 0.60)


class TopicGoal(FeedbackOnRos):
    """One robot for all tests; they run in the order of their names."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.goals: list[DmpGoal] = []
        cls.debug: list[IkDebug] = []
        cls.feedback: list[FeedbackStatus] = []
        cls.diagnostics: dict[str, dict[str, str]] = {}
        cls.targets: list[JointState] = []
        rospy.Subscriber("controller_manager/dmp/dmp_goal", DmpGoal, cls.goals.append)
        rospy.Subscriber("controller_manager/dmp/ik_debug", IkDebug, cls.debug.append)
        rospy.Subscriber("controller_manager/feedback/status", FeedbackStatus, cls.feedback.append)
        rospy.Subscriber("lwr/target_joint_states", JointState, cls.targets.append)
        rospy.Subscriber(
            "/diagnostics",
            DiagnosticArray,
            lambda m: cls.diagnostics.update({s.name: {v.key: v.value for v in s.values} for s in m.status}),
        )
        cls.robot = Robot()
        cls.robot.load()
        path = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
        answer = cls.robot.dmp("load_dmps", path)
        assert answer.success, answer.message
        cls.robot.start()
        cls.robot.go(HOME)
        cls.robot.switch("dmp")

    def test_1_no_goal_yet(self) -> None:
        answer = self.robot.execute(goal_frame="")
        self.assertFalse(answer.success)
        self.assertIn("dmp_goal", answer.message)

    def test_2_helper_publishes_each_transform_once(self) -> None:
        self.robot.see_hand(GOAL)
        wait_until(lambda: len(self.goals) >= 20, "20 goals of the helper")
        stamps = [g.header.stamp for g in self.goals]
        self.assertEqual(len(stamps), len(set(stamps)))
        goal = self.goals[-1]
        self.assertEqual(goal.header.frame_id, "lwr_base_link")
        self.assertAlmostEqual(goal.goal.x, GOAL[0], places=6)
        self.assertAlmostEqual(goal.goal.y, GOAL[1], places=6)
        self.assertAlmostEqual(goal.goal.z, GOAL[2] + 0.02, places=6)

    def test_3_reaches_the_goal_of_the_topic(self) -> None:
        robot = self.robot

        def reach() -> None:
            answer = robot.execute(goal_frame="")
            self.assertTrue(answer.success, answer.message)
            wait_until(lambda: robot.feedback.state == "reached", "reached")

        robot.unless_late(reach)
        wait_until(lambda: len(self.debug) > 50, "ik_debug")
        record = self.debug[len(self.debug) // 2]
        self.assertEqual(record.header.frame_id, "lwr_base_link")
        self.assertEqual((len(record.joint_velocity_position), len(record.joint_velocity_rotation)), (7, 7))
        self.assertGreater(record.smallest_singular_value_position, 0.0)
        q = record.measured.orientation
        self.assertAlmostEqual(q.x**2 + q.y**2 + q.z**2 + q.w**2, 1.0, places=6)
        # The reference of the cycle less where the arm is: what the inverse kinematics takes away.
        for axis in "xyz":
            ahead = getattr(record.set_point.position, axis) - getattr(record.measured.position, axis)
            self.assertAlmostEqual(getattr(record.position_error, axis), ahead, delta=1e-2)
        self.assertTrue(self.targets and len(self.targets[-1].velocity) == 7)
        self.assertEqual(list(self.targets[-1].name), JOINTS)

    def test_3b_switch_dmp_goes_on_in_the_phase_of_the_motion(self) -> None:
        robot = self.robot
        robot.see_hand(ASIDE)
        wait_until(lambda: abs(self.goals[-1].goal.x - ASIDE[0]) < 1e-6, "the helper's goal aside")

        def reach() -> None:
            answer = robot.execute(goal_frame="", dmp_ratio=6.0)
            self.assertTrue(answer.success, answer.message)
            wait_until(lambda: robot.feedback.state == "running" and robot.feedback.phase < 0.6, "half way")
            robot.feedbacks.clear()
            wait_until(lambda: len(robot.feedbacks) > 0, "a report before the switch")
            answer = robot.dmp("switch_dmp", SwitchDmpRequest(primitive_id="wave", dmp_ratio=3.0))
            self.assertEqual((answer.success, answer.reason_code), (False, ReasonCode.UNKNOWN_NAME))
            answer = robot.dmp("switch_dmp", SwitchDmpRequest(primitive_id="give_human", dmp_ratio=4.0))
            self.assertTrue(answer.success, answer.message)
            wait_until(lambda: robot.feedback.state == "reached", "reached")

        robot.unless_late(reach)
        told = list(robot.feedbacks)
        primitives = [m.primitive_id for m in told]
        self.assertIn("give_human", primitives)
        first = primitives.index("give_human")
        self.assertEqual(set(primitives[:first]), {"reach_human"})
        self.assertEqual(set(primitives[first:]), {"give_human"})
        phases = [m.phase for m in told]
        self.assertEqual(phases, sorted(phases, reverse=True), "the phase never begins anew")
        # holding: this computer published the hand late, and the motion waited for it
        self.assertEqual({m.state for m in told} - {"holding"}, {"running", "reached"})
        answer = robot.dmp("switch_dmp", SwitchDmpRequest(primitive_id="reach_human", dmp_ratio=1.0))
        self.assertTrue(answer.success or answer.reason_code == ReasonCode.NOTHING_RUNS, answer.message)

    def test_4_refusals(self) -> None:
        robot = self.robot
        for fields, word in (
            ({"primitive": "wave"}, "reach_human"),
            ({"dmp_ratio": 0.0}, "ratio"),
            ({"dmp_ratio": math.nan}, "ratio"),
            ({"initial_state": 9}, "CURRENT=0"),
        ):
            answer = robot.execute(**{"primitive": "reach_human", **fields})
            self.assertFalse(answer.success)
            self.assertIn(word, answer.message)
        answer = robot.dmp("load_dmps", "/does/not/exist.xml")
        self.assertEqual((answer.success, answer.num_loaded), (False, 0))
        answer = robot.manager("load_controller", "dmp", "coglab/DmpController")
        self.assertFalse(answer.success)
        self.assertIn("in use", answer.message)
        self.assertIn("dmp", answer.controller_ids)
        answer = robot.manager("load_controller", "x", "coglab/Nothing")
        self.assertIn("coglab/DmpController", answer.message)
        answer = robot.manager("switch_controller", "nobody")
        self.assertFalse(answer.success)
        for scale in (2.0, -0.1, math.nan):
            answer = robot.manager("speed_scale", scale)
            self.assertEqual((answer.success, answer.reason_code), (False, ReasonCode.OUT_OF_RANGE))
        publisher = rospy.Publisher("controller_manager/dmp/dmp_goal", DmpGoal, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "connection")
        robot.see_hand(None)
        wait_until(lambda: robot.status.standing, "standing")
        before = robot.feedback.remaining_distance
        for frame, x in (("world", 0.3), ("lwr_base_link", math.nan)):
            wrong = DmpGoal()
            wrong.header.frame_id = frame
            wrong.goal.x = x
            publisher.publish(wrong)
        rospy.sleep(0.5)
        self.assertAlmostEqual(robot.feedback.remaining_distance, before, delta=0.002)

    def cycle_statistics(self) -> dict[str, str]:
        """Values of the control cycle on /diagnostics, by name; empty before the first."""
        return next((v for n, v in self.diagnostics.items() if "control cycle" in n), {})

    def test_6_diagnostics_and_ptp_refusal(self) -> None:
        wait_until(lambda: bool(self.cycle_statistics()), "/diagnostics")
        values = self.cycle_statistics()
        self.assertEqual(values["active controller"], "dmp")
        self.assertEqual(values["faults"], "0")
        self.assertIn("reason_code", values)
        cycles = int(values["cycles with a joint state"])
        self.assertGreater(cycles, 100)
        last, longest = (float(values[f"{name} cycle (us)"]) for name in ("duration of the last", "longest"))
        self.assertTrue(0.0 < last <= longest)
        self.assertGreaterEqual(int(values["overruns"]), 0)
        wait_until(lambda: int(self.cycle_statistics()["cycles with a joint state"]) > cycles + 20, "newer statistics")
        answer = self.robot.add_ptp(HOME)
        self.assertEqual(answer.status, AddPtpRequest.REJECTED)
        self.robot.switch("ptp")
        answer = self.robot.add_ptp([0.0, 1.0])
        self.assertEqual((answer.status, answer.ptp_id), (AddPtpRequest.REJECTED, -1))
        self.assertIn("2 numbers", answer.message)

    def test_7_speed_scale_by_service_and_by_topic(self) -> None:
        robot = self.robot
        publisher = rospy.Publisher("controller_manager/speed_scale", Float64, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "connection")
        self.assertTrue(robot.manager("speed_scale", 0.5).success)
        wait_until(lambda: robot.status.speed_scale == 0.5, "0.5 by the service")
        publisher.publish(0.25)
        wait_until(lambda: robot.status.speed_scale == 0.25, "0.25 by the topic")
        wait_until(lambda: float(self.cycle_statistics()["time scale"]) == 0.25, "the clock of the references")
        publisher.publish(7.0)
        rospy.sleep(0.5)
        self.assertEqual(robot.status.speed_scale, 0.25)  # refused
        publisher.publish(1.0)
        wait_until(lambda: robot.status.speed_scale == 1.0, "1 by the topic")

    def test_7b_the_path_ahead_before_a_motion_and_while_it_runs(self) -> None:
        robot, told = self.robot, []
        listening = [
            rospy.Subscriber(f"controller_manager/{name}/predicted_path", PredictedPath, told.append)
            for name in ("dmp", "ptp")
        ]
        wait_until(lambda: all(one.get_num_connections() for one in listening), "connections")

        def place(pose: Pose) -> tuple[float, float, float]:
            return pose.position.x, pose.position.y, pose.position.z

        robot.go(HOME)
        wait_until(lambda: any(not m.poses for m in told), "the end of the path of the ptp motion")
        self.assertRegex(told[0].motion, "^ptp [0-9]+$")
        told.clear()
        robot.see_hand(GOAL)
        asked = PredictDmpRequest(primitive_id="reach_human", dmp_ratio=2.0, goal_frame="human_hand")
        answers = []

        def predicted() -> bool:
            answers.append(robot.dmp("predict_dmp", asked))
            return answers[-1].success

        wait_until(predicted, "the path to the hand")
        ahead = answers[-1]
        self.assertEqual((ahead.path.header.frame_id, ahead.path.motion), ("lwr_base_link", "reach_human"))
        self.assertLess(math.dist(place(ahead.path.poses[-1]), GOAL), 0.01)
        asked.dmp_ratio = 0.0
        self.assertEqual(robot.dmp("predict_dmp", asked).reason_code, ReasonCode.OUT_OF_RANGE)
        robot.switch("dmp")
        rospy.sleep(0.3)
        self.assertEqual(told, [], "before a motion nothing is published")
        paths = []

        def reach() -> None:
            told.clear()
            wait_until(lambda: robot.execute(dmp_ratio=2.0).success, "execute_dmp")
            wait_until(lambda: any(not m.poses for m in told), "the end of the path")
            paths[:] = told[: next(i for i, m in enumerate(told) if not m.poses)]
            self.assertGreater(len(paths), 1)

        robot.unless_late(reach)
        self.assertEqual({m.motion for m in paths}, {"reach_human"})
        self.assertTrue(all(len(m.poses) == len(m.times) for m in paths))
        self.assertGreaterEqual(len(paths[0].poses), 2)  # at the end of the motion one pose is left
        self.assertLess(math.dist(place(paths[0].poses[-1]), GOAL), 0.01)
        self.assertLess(paths[-1].times[-1], paths[0].times[-1])

    def test_8_stamps_of_any_kind_end_nothing_and_are_no_goal_from_the_future(self) -> None:
        robot = self.robot
        robot.see_hand(None)
        robot.switch("dmp")
        publisher = rospy.Publisher("controller_manager/dmp/dmp_goal", DmpGoal, queue_size=100)
        wait_until(lambda: publisher.get_num_connections() > 0, "connection")
        for secs in (2**32 - 1, 2**31, 2**31 - 1, int(rospy.get_time()) + 10, 1):
            for nsecs in (2**32 - 1, 10**9, 0):
                wrong = DmpGoal()
                wrong.header.frame_id = "lwr_base_link"
                wrong.header.stamp.secs, wrong.header.stamp.nsecs = secs, nsecs
                wrong.goal.x, wrong.goal.z = 0.5, 0.6
                publisher.publish(wrong)
        rospy.sleep(0.3)
        robot.see_hand(ASIDE)

        def reach() -> None:
            robot.feedbacks.clear()
            wait_until(lambda: robot.execute(goal_frame="", dmp_ratio=2.0).success, "execute_dmp")
            wait_until(
                lambda: any(m.state == "running" for m in robot.feedbacks),
                "running, toward the goal that replaced the old one",
            )

        robot.unless_late(reach)

    def test_9_a_frozen_master_ends_no_reach_and_keeps_no_node_from_ending(self) -> None:
        """With goals from the topic and from a tf2 frame: they are followed while new, and lost when too old."""
        robot, pids = self.robot, robot_processes()
        self.assertTrue(pids)

        def reach_of_a_frame() -> None:
            robot.go(HOME)  # far from the goal: a reach that has nearly arrived is finished without sights of it
            robot.switch("dmp")
            robot.see_hand(GOAL)
            wait_until(lambda: robot.execute(dmp_ratio=20.0).success, "execute_dmp of a frame")
            wait_until(lambda: robot.feedback.state == "running", "running")
            with frozen_master():
                rospy.sleep(2.0)  # longer than goal_max_age and goal_lost_time together
                self.assertIn(robot.feedback.state, ("running", "holding"), robot.feedback.reason)
                robot.see_hand(None)
                wait_until(lambda: robot.feedback.state == "aborted", "the goal that aged")
                self.assertEqual(robot.feedback.reason_code, ReasonCode.GOAL_LOST)

        def reach_of_the_topic() -> None:
            robot.see_hand(ASIDE)
            wait_until(lambda: robot.execute(goal_frame="", dmp_ratio=2.0).success, "execute_dmp of the topic")
            wait_until(lambda: robot.feedback.state == "running", "running")
            with frozen_master():
                wait_until(lambda: robot.feedback.state not in ("running", "holding"), "the end of the motion")
                self.assertEqual((robot.feedback.state, robot.feedback.reason), ("reached", ""))
                self.assertLess(robot.feedback.remaining_distance, 0.02)

        late = LATE - {ReasonCode.GOAL_LOST, ReasonCode.GOAL_STALE}  # this is what is tested
        robot.unless_late(reach_of_a_frame, late)
        robot.unless_late(reach_of_the_topic, late)
        with frozen_master():
            end_all(pids)


if __name__ == "__main__":
    rospy.init_node("topic_goal")
    rostest.rosrun("coglab_controllers", "topic_goal", TopicGoal)
