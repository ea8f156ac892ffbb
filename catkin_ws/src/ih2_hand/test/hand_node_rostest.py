#!/usr/bin/python3
"""Table 3 of D4.10 against the running node: actions, calibration, status, joints, stop."""

from __future__ import annotations

import random
import sys
import time
import unittest

import rospy
import rostest
from actionlib import GoalStatus
from actionlib_msgs.msg import GoalID, GoalStatusArray
from coglab_msgs.msg import (
    HandPreshapeCloseActionFeedback,
    HandPreshapeCloseFeedback,
    HandStatus,
    MotorStatus,
    ReasonCode,
)
from diagnostic_msgs.msg import DiagnosticArray
from hand_client import HandClient
from std_msgs.msg import String

OBJECT = [255, 100, 120, 120, 130]
FREE = [255] * 5


class HandNode(unittest.TestCase):
    """Runs in alphabetical order on one hand."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.hand = HandClient()
        cls.diagnostics = []
        rospy.Subscriber("/diagnostics", DiagnosticArray, lambda array: cls.diagnostics.extend(array.status))
        cls.trace = []
        rospy.Subscriber("ih2_hand/trace", String, lambda line: cls.trace.append(line.data))
        cls.hand.wait_ready()

    def state(self, name: str) -> int:
        return self.hand.clients[name].get_state()

    def test_a_node_does_nothing_by_itself(self) -> None:
        status = self.hand.fresh_status()
        self.assertFalse(status.calibrated)
        self.assertEqual([motor.motor for motor in status.motors], [0, 1, 2, 3, 4])
        self.assertEqual([motor.force for motor in status.motors], [-1, 0, 0, 0, 0])
        self.hand.wait(lambda: len(self.trace) > 200, "trace lines")
        meanings = {line.split(maxsplit=2)[2].split("  ", 1)[-1].strip() for line in self.trace if " > " in line}
        quiet = [meaning for meaning in meanings if "Get" in meaning or "filler" in meaning]
        self.assertEqual(len(quiet), len(meanings), f"readings and StopALL only: {meanings}")

    def test_b_preshape_before_calibration_reports_the_reason(self) -> None:
        result = self.hand.run("hand_preshape", "cylindrical", "medium")
        self.assertFalse(result.isOk)
        self.assertIn("not calibrated", result.message)
        self.assertEqual(result.reason_code, ReasonCode.HAND_NOT_CALIBRATED)
        self.assertEqual(self.state("hand_preshape"), GoalStatus.ABORTED)

    def test_c_calibration(self) -> None:
        self.hand.calibrate("slow")
        self.hand.wait(lambda: self.hand.status.event_code == ReasonCode.HAND_REFUSED, "refusal")
        self.assertIn("fast", self.hand.status.message)
        count = len(self.hand.statuses)
        self.hand.calibrate_and_wait("fast")
        seen = self.hand.statuses[count:]
        told = [status.event_code for status in seen]
        self.assertLess(told.index(ReasonCode.HAND_STARTED), told.index(ReasonCode.HAND_ENDED))
        self.assertTrue(any("fast started" in status.message for status in seen))
        self.assertTrue(all(not status.motors for status in seen if status.calibrating))
        self.assertTrue(self.hand.status.calibrated)
        self.assertFalse(self.hand.fresh_status().holding)
        self.hand.calibrate("fast")
        self.hand.wait(lambda: self.hand.status.event_code == ReasonCode.HAND_REFUSED, "refusal")
        self.assertIn("calibrated already", self.hand.status.message)
        self.hand.calibrate_and_wait("fast force")
        self.assertTrue(self.hand.status.calibrated)
        for word in ("must be fast", "started", "calibrated already", "ended"):
            self.assertTrue(any(word in status.message for status in self.diagnostics), word)
        told = {value.value for status in self.diagnostics for value in status.values if value.key == "reason_code"}
        self.assertLessEqual({str(ReasonCode.HAND_STARTED), str(ReasonCode.HAND_ENDED)}, told)

    def test_f_grasp_an_object(self) -> None:
        self.hand.touch(OBJECT)
        result = self.hand.run("hand_preshape", "cylindrical", "medium")
        self.assertTrue(result.isOk, result.message)
        self.assertEqual(self.state("hand_preshape"), GoalStatus.SUCCEEDED)
        positions = [motor.position for motor in self.hand.fresh_status().motors]
        for position, target in zip(positions, (245, 5, 30, 50, 50), strict=True):
            self.assertLessEqual(abs(position - target), 4)
        feedback: list[HandPreshapeCloseFeedback] = []
        # From the topic: actionlib's client drops feedback that arrives after the result.
        told = rospy.Subscriber(
            "ih2_hand/hand_preshape_close/feedback",
            HandPreshapeCloseActionFeedback,
            lambda message: feedback.append(message.feedback),
        )
        self.hand.wait(told.get_num_connections, "feedback topic")
        result = self.hand.run("hand_preshape_close")
        self.assertTrue(result.isOk, result.message)
        self.assertIn("holding", result.message)
        self.hand.wait(lambda: feedback and feedback[-1].status_code == ReasonCode.NONE, "the last feedback")
        told.unregister()
        self.assertEqual(len(feedback[-1].positions), 5)
        codes = [one.status_code for one in feedback]
        self.assertEqual((set(codes[:-1]), codes[-1]), ({ReasonCode.HAND_MOVING}, ReasonCode.NONE))
        self.assertTrue(self.hand.fresh_status().holding)
        self.assertTrue(any("grasp cylindrical medium by current" in line for line in self.trace))
        self.hand.wait(lambda: min(self.hand.fingers.effort[1:]) > 100.0, "the force of the grasp")

    def test_h_open(self) -> None:
        result = self.hand.run("hand_open", 400)
        self.assertTrue(result.isOk, result.message)
        status = self.hand.fresh_status()
        self.assertTrue(all(motor.fully_open for motor in status.motors))
        self.assertFalse(status.holding)
        self.hand.wait(lambda: max(self.hand.joints.position) == 0.0, "open joints")

    def test_i_close_on_object_and_on_nothing(self) -> None:
        self.hand.touch(OBJECT)
        result = self.hand.run("hand_close", 300)
        self.assertTrue(result.isOk and "object" in result.message, result.message)
        self.assertTrue(self.hand.fresh_status().holding)
        self.assertTrue(self.hand.run("hand_open", 511).isOk)
        self.hand.touch(FREE)
        result = self.hand.run("hand_close", 511)
        self.assertTrue(result.isOk and "without meeting" in result.message, result.message)
        self.assertFalse(self.hand.fresh_status().holding)
        self.hand.wait(lambda: self.hand.joints.position[2] == 1.5, "closed joints")
        self.assertEqual(
            list(self.hand.joints.name),
            [
                "ih2_thumb_abduction",
                "ih2_thumb_flexion",
                "ih2_index_flexion",
                "ih2_middle_flexion",
                "ih2_ring_little_flexion",
            ],
        )

    def test_k_preemption_stops_the_fingers(self) -> None:
        self.assertTrue(self.hand.run("hand_open", 511).isOk)
        self.hand.send("hand_close", 60)
        self.hand.wait(lambda: self.hand.feedback, "feedback")
        # actionlib takes a goal for lost if an older status arrives after the cancel.
        self.hand.wait(lambda: self.state("hand_close") == GoalStatus.ACTIVE, "the goal's status")
        self.hand.clients["hand_close"].cancel_goal()
        result = self.hand.result("hand_close")
        self.assertEqual(self.state("hand_close"), GoalStatus.PREEMPTED)
        self.assertEqual((result.isOk, result.reason_code), (False, ReasonCode.CANCELLED))
        status = self.hand.fresh_status()
        self.assertTrue(all(motor.mode == "stop" for motor in status.motors))

    def test_l_a_new_goal_replaces_the_old_one(self) -> None:
        old = self.hand.send("hand_close", 60)
        self.hand.wait(lambda: self.hand.feedback, "feedback")
        result = self.hand.run("hand_open", 511)
        self.assertTrue(result.isOk, result.message)
        self.hand.wait(lambda: old.get_state() == GoalStatus.PREEMPTED, "preempted old goal")
        self.assertIn("replaced", old.get_result().message)
        self.assertEqual(old.get_result().reason_code, ReasonCode.SUPERSEDED)
        for speed in range(100, 200, 5):  # the same action, goal upon goal
            self.hand.send("hand_close", speed)
        result = self.hand.run("hand_close", 511)
        self.assertTrue(result.isOk, result.message)

    def test_l_cancels_at_any_moment(self) -> None:
        rng = random.Random(5)
        ends = (GoalStatus.PREEMPTED, GoalStatus.RECALLED, GoalStatus.SUCCEEDED)
        told: dict[str, int] = {}

        def on_status(array: GoalStatusArray) -> None:
            told.update({item.goal_id.id: item.status for item in array.status_list})

        names = ("hand_open", "hand_close")
        topics = [rospy.Subscriber(f"ih2_hand/{name}/status", GoalStatusArray, on_status) for name in names]
        for _ in range(25):
            name = rng.choice(names)
            client = self.hand.send(name, 300)
            time.sleep(rng.choice((0.0, 0.001, 0.01, 0.05)))
            client.cancel_goal()
            self.assertTrue(client.wait_for_result(rospy.Duration(60.0)), name)
            goal = client.gh.comm_state_machine.action_goal.goal_id.id
            self.hand.wait(lambda goal=goal: told.get(goal) in ends, f"end of {name} on its topic")
            # If a status was sent before a cancelled goal arrived, actionlib's client counts the
            # goal as lost, so the test uses the server's status of the goal.
            self.assertIn(client.get_state(), (*ends, GoalStatus.LOST), name)
        for topic in topics:
            topic.unregister()
        status = self.hand.fresh_status()
        self.assertTrue(all(motor.mode == "stop" for motor in status.motors))
        self.assertTrue(self.hand.run("hand_open", 511).isOk)

    def test_m_stop_service(self) -> None:
        self.assertTrue(self.hand.run("hand_open", 511).isOk)
        self.hand.send("hand_close", 60)
        self.hand.wait(lambda: self.hand.feedback, "feedback")
        answer = self.hand.stop_service()
        self.assertTrue(answer.success, answer.message)
        result = self.hand.result("hand_close")
        self.assertFalse(result.isOk)
        self.assertIn("stop service", result.message)
        self.assertEqual(result.reason_code, ReasonCode.STOPPING)
        status = self.hand.fresh_status()
        self.assertTrue(all(motor.mode == "stop" for motor in status.motors))
        self.assertTrue(self.hand.stop_service().success)

    def test_p_neither_stamps_nor_foreign_statuses_reach_a_goal(self) -> None:
        cancel = rospy.Publisher("ih2_hand/hand_close/cancel", GoalID, queue_size=1)
        foreign = rospy.Publisher("ih2_hand/hand_status", HandStatus, queue_size=10)
        self.hand.wait(cancel.get_num_connections, "cancel topic")
        cancel.publish(GoalID(stamp=rospy.Time(4294967295), id="nobody's"))
        nonsense = HandStatus(motors=[MotorStatus(motor=99, position=-(2**31))] * 1000)
        nonsense.header.stamp = rospy.Time(4294967295)
        time.sleep(0.2)
        self.hand.send("hand_close", 511)
        client = self.hand.clients["hand_close"]
        while not client.wait_for_result(rospy.Duration(0.02)):
            foreign.publish(nonsense)
        self.assertTrue(client.get_result().isOk, client.get_result().message)
        for topic in (cancel, foreign):
            topic.unregister()
        self.hand.run("hand_open", 511)


if __name__ == "__main__":
    rospy.init_node("hand_node_rostest")
    rostest.rosrun("ih2_hand", "hand_node", HandNode, sys.argv)
