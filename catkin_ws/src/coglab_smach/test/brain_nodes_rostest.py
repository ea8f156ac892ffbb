#!/usr/bin/python3
"""Services and topics of the brain's nodes, over ROS: database, contact detector fed with synthetic torques, master."""

import base64
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import unittest

import actionlib
import numpy as np
import rospy
import rostest
from coglab_msgs.msg import (
    Contact,
    ContactSignal,
    HandoverAction,
    HandoverGoal,
    HandoverResult,
    MasterState,
    ReasonCode,
    Transition,
)
from coglab_msgs.srv import ArmContact, Learn, LearnMotion, Start
from coglab_py.action_client import ActionClient
from coglab_smach.kinematics.reachability import default_arm, home_posture, position_jacobian
from sensor_msgs.msg import JointState
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from std_msgs.msg import String
from std_srvs.srv import Trigger

LIMIT = 60.0
"""s, of every wait."""
SILENT = (ReasonCode.NODE_SILENT, ReasonCode.TIME_LIMIT)
"""Why the system without a robot does not start. On a busy computer the time limit may end first."""


def service(name, kind):
    rospy.wait_for_service(name, LIMIT)
    return rospy.ServiceProxy(name, kind)


class Torques(threading.Thread):
    """An arm at its home posture: joint states and external torques at 200 Hz; ``force`` (N) on the hand."""

    def __init__(self):
        super().__init__(daemon=True)
        self.joints = rospy.Publisher("/lwr/joint_states", JointState, queue_size=1)
        self.torques = rospy.Publisher("/lwr/external_torques", JointState, queue_size=1)
        self.force = np.zeros(3)
        self.over = False

    def run(self):
        arm, noise = default_arm(), np.random.default_rng(5)
        home = home_posture()
        jacobian = position_jacobian(arm, home)
        applied = np.zeros(3)
        while not self.over and not rospy.is_shutdown():
            applied = applied + np.clip(self.force - applied, -0.4, 0.4)
            stamp = rospy.Time.now()
            state = JointState(name=list(arm.joint_names), position=list(home), velocity=[0.0] * 7)
            state.header.stamp = stamp
            tau = jacobian.T @ applied + noise.normal(0.0, 0.05, 7)
            torque = JointState(name=list(arm.joint_names), effort=list(tau))
            torque.header.stamp = stamp
            self.joints.publish(state)
            self.torques.publish(torque)
            time.sleep(0.005)


class BrainNodes(unittest.TestCase):
    """Tests in the order of their numbers."""

    def test_1_arming_without_torques_is_refused(self):
        answer = service("/contact_detector/arm", ArmContact)(mode="contact", timeout=1.0)
        self.assertFalse(answer.success)
        self.assertEqual(answer.reason_code, ReasonCode.NODE_SILENT)

    def test_2_contact_is_published_once(self):
        torques = Torques()
        events, seen = [], []
        rospy.Subscriber("/coglab/contact", Contact, events.append)
        rospy.Subscriber("/contact_detector/signal", ContactSignal, seen.append)
        learn = service("/contact_detector/learn", Learn)
        refused = learn()
        self.assertEqual(refused.reason_code, ReasonCode.NODE_SILENT)
        self.assertEqual(seen, [], "a signal without torques")
        torques.start()
        try:
            arm = service("/contact_detector/arm", ArmContact)
            self.learns(learn, seen)
            self.assertEqual(arm(mode="juggle", timeout=1.0).reason_code, ReasonCode.INVALID_ARGUMENT)
            self.assertFalse(arm(mode="release", timeout=1.0).success)
            self.assertTrue(arm(mode="contact", timeout=120.0, joints=[1, 2, 4]).success)
            self.until(lambda: (seen[-1].state, seen[-1].mode) == ("watching", "contact"), "watching")
            self.assertEqual([j + 1 for j in range(7) if seen[-1].watched[j]], [1, 2, 4])
            self.until(lambda: 0.0 < seen[-1].margin < 1.0, "a margin of noise")
            refused = learn()
            self.assertEqual((refused.success, refused.reason_code), (False, ReasonCode.BUSY))
            self.assertIn("contact", refused.message)
            self.learns_no_motion()
            seen.clear()
            self.assertEqual(events, [], "a false alarm at rest")
            torques.force = np.array([0.0, 8.0, 0.0])
            end = time.monotonic() + LIMIT
            while not events and time.monotonic() < end:
                time.sleep(0.02)
            time.sleep(0.5)
            self.assertEqual(len(events), 1)
            self.assertTrue(events[0].contact and events[0].source == "joint_torque" and events[0].margin > 1.0)
            self.assertEqual(events[0].reason_code, ReasonCode.CONTACT_FOUND)
            self.assertTrue(0.5 < events[0].confidence <= 1.0)
            self.assertTrue(any(abs(m.change[j]) > m.threshold[j] for m in seen for j in (0, 1, 3)))
            self.assertTrue(arm(mode="off").success)
            seen.clear()
            self.until(lambda: seen and seen[-1].state == "off", "off")
        finally:
            torques.over = True

    def until(self, ready, what):
        """Wait until ``ready()``."""
        end = time.monotonic() + LIMIT
        while not ready():
            self.assertLess(time.monotonic(), end, what)
            time.sleep(0.02)

    def learns(self, learn, seen):
        """Learn the noise at rest again: thresholds are k standard deviations of the learnt noise."""
        self.until(lambda: seen and seen[-1].learnt, "learnt at the start")
        self.assertTrue(all(value > 0.0 for value in seen[-1].threshold) and all(seen[-1].watched))
        self.assertEqual((seen[-1].state, seen[-1].mode, seen[-1].margin), ("off", "", 0.0))
        samples = seen[-1].rest_samples
        seen.clear()
        answer = learn()
        self.assertTrue(answer.success, answer.message)
        self.until(lambda: any(not m.learnt and m.rest_samples < samples for m in seen), "forgotten")
        self.until(lambda: seen[-1].learnt, "learnt anew")

    def learns_no_motion(self):
        """Learning in motion is refused with a code for each missing condition."""
        learn_motion = service("/contact_detector/learn_motion", LearnMotion)
        for gather, success, code in (
            (False, False, ReasonCode.NOTHING_RUNS),
            (True, False, ReasonCode.BAD_FILE),  # no file is set
            (False, False, ReasonCode.NOTHING_RUNS),
        ):
            answer = learn_motion(gather)
            self.assertEqual((answer.success, answer.reason_code), (success, code), answer.message)

    def test_4_introspection_shows_the_whole_hierarchy(self):
        paths, states = set(), {}
        rospy.Subscriber("/coglab/smach/container_structure", SmachContainerStructure, lambda m: paths.add(m.path))
        rospy.Subscriber("/coglab/smach/container_status", SmachContainerStatus, lambda m: states.update({m.path: m}))
        wanted = {
            "/coglab_master",
            "/coglab_master/exchange_human_to_robot",
            "/coglab_master/take/precise_motion",
            "/coglab_master/exchange_robot_to_human/approach/arm_motion",
            "/coglab_master/put",
            "/coglab_master/coglab_init_system/coglab_init_robot",
        }
        end = time.monotonic() + LIMIT
        while not wanted <= paths and time.monotonic() < end:
            time.sleep(0.1)
        self.assertLessEqual(wanted, paths)
        while "/coglab_master" not in states and time.monotonic() < end:
            time.sleep(0.1)
        self.assertIn("object_id", pickle.loads(base64.b64decode(states["/coglab_master"].local_data)))

    def test_5_without_a_robot_the_master_waits_in_fault_with_the_reason(self):
        transitions = []
        rospy.Subscriber("/coglab/transitions", Transition, transitions.append)
        start = service("/coglab/start", Start)
        end = time.monotonic() + 2 * LIMIT
        while time.monotonic() < end:
            answer = start("take", "mug")
            self.assertFalse(answer.success)
            if "fault" in answer.message:
                break
            time.sleep(0.5)
        self.assertIn("fault", answer.message)
        why = service("/coglab/why", Trigger)().message
        # The same sentence on the topics and in the result file.
        with open(rospy.get_param("/coglab/result_file"), encoding="utf-8") as stream:
            written = json.loads(stream.readlines()[-1])
        self.assertEqual(written["kind"], "coglab_init_system")
        shown = json.loads(rospy.wait_for_message("/coglab/results", String, LIMIT).data)
        self.assertEqual(shown["reason"], written["reason"])
        self.assertTrue(why.startswith(written["reason"]))
        self.assertIn(written["reason_code"], SILENT)
        state = rospy.wait_for_message("/coglab/state", MasterState, LIMIT)
        self.assertEqual((state.state, state.in_hub, state.actions), ("/coglab_master/fault", True, ["initialise"]))
        self.assertEqual((state.why, state.reason_code), (why, written["reason_code"]))
        self.assertEqual(answer.reason_code, ReasonCode.WRONG_STATE)
        self.assertIn("initialise", answer.message)
        waits = []
        rospy.Subscriber("/coglab/state", MasterState, waits.append)
        self.until(lambda: waits, "the state, which is latched")
        transitions.clear()
        self.assertTrue(start("initialise", "").success)
        self.until(lambda: any(not m.state.endswith("/fault") for m in waits), "the initialisation")
        self.until(lambda: waits[-1].state.endswith("/fault") and not waits[-1].waits_for, "fault again")
        self.until(lambda: any(t.reason and t.reason_code in SILENT for t in transitions), "the reason of the fault")
        # The wait and its deadline were published during the wait.
        limited = [m for m in waits if m.waits_for]
        ahead = [(m.deadline - m.header.stamp).to_sec() for m in limited]
        self.assertTrue(all(seconds < 120.0 for seconds in ahead), ahead)
        self.assertTrue(all(bool(m.waits_for) == bool(m.waits_code) for m in waits))
        vision = [s for s, m in zip(ahead, limited, strict=True) if m.waits_code == ReasonCode.WAITS_FOR_SIGHT]
        self.assertTrue(any(0.0 < seconds <= 4.0 for seconds in vision), [(m.state, m.waits_for) for m in limited])
        self.assertEqual((waits[-1].waits_for, waits[-1].deadline.to_sec()), ("", 0.0))
        self.handover_by_a_standard_client(shown["kind"], written["reason"])

    def handover_by_a_standard_client(self, kind, reason):
        """The action in the same fault: a refusal has a reason; a failed initialisation has it as its result."""
        last = rospy.wait_for_message("/coglab/handover_results", HandoverResult, LIMIT)
        self.assertEqual((last.action, last.reason, last.success), (kind, reason, False))
        self.assertLess(abs(last.ended.to_sec() - time.time()), 2 * LIMIT, "times are of the wall clock")
        client = ActionClient("/coglab/handover", HandoverAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(LIMIT)))
        state = client.send_goal_and_wait(HandoverGoal(action="take", object_id="mug"), rospy.Duration(LIMIT))
        result = client.get_result()
        self.assertEqual((state, result.reason_code), (actionlib.GoalStatus.REJECTED, ReasonCode.WRONG_STATE))
        self.assertIn("fault", result.reason)
        state = client.send_goal_and_wait(HandoverGoal(action="initialise"), rospy.Duration(2 * LIMIT))
        result = client.get_result()
        self.assertEqual(state, actionlib.GoalStatus.ABORTED)
        self.assertIn(result.reason_code, SILENT)

    def test_6_a_second_master_in_its_own_namespace_ends_without_a_traceback(self):
        config = rospy.get_param("/coglab/config_file")
        node = subprocess.Popen(
            [
                "rosrun",
                "coglab_smach",
                "master_node.py",
                "__ns:=two",
                "__name:=coglab",
                f"_config_file:={config}",
                "_dmp_library:=none.xml",
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            start = service("/two/coglab/start", Start)
            self.assertFalse(start("take", "mug").success)
        finally:
            os.killpg(node.pid, signal.SIGINT)
            try:
                words, _ = node.communicate(timeout=LIMIT)
            except subprocess.TimeoutExpired:
                os.killpg(node.pid, signal.SIGKILL)
                words, _ = node.communicate()
                self.fail(f"it does not end: {words[-2000:]}")
        self.assertNotIn("Traceback", words)
        self.assertNotIn("closed topic", words)


if __name__ == "__main__":
    rospy.init_node("brain_nodes_rostest")
    rostest.rosrun("coglab_smach", "brain_nodes", BrainNodes, sys.argv)
