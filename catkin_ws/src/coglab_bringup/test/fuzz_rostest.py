#!/usr/bin/python3
"""Nothing that arrives by ROS ends a node or moves the arm: a sample of the campaign of ./coglab bench fuzz."""

import json
import os
import sys
import threading
import time
import unittest
from pathlib import Path

import rospy
import rostest
from coglab_bringup.ros_fuzz import Fuzz, has_time, settle
from coglab_msgs.msg import LwrState, ReasonCode
from coglab_msgs.srv import LoadController, LwrCommand, SwitchController
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import UInt8

LONG = os.environ.get("COGLAB_LONG") == "1"
PER_TOPIC, PER_SERVICE = (1500, 700) if LONG else (8, 6)
LEAST = 100_000 if LONG else 200
"""messages that make the figure"""
READY_LIMIT = 60.0  # s
HEARD_BEFORE, HEARD_AFTER = 2.5, 3.0
"""s in which who speaks is noted; the rarest word that comes by itself is a state machine's structure, every 2 s"""


class Still:
    """How far the arm's joints are from where they were, by the word of the robot's own node."""

    def __init__(self) -> None:
        self.first: tuple | None = None
        self.farthest = 0.0  # rad
        rospy.Subscriber("/lwr/joint_states", JointState, self.on_joints, queue_size=50)

    def on_joints(self, message: JointState) -> None:
        if message._connection_header.get("callerid") != "/robot":
            return
        self.first = self.first or message.position
        self.farthest = max(self.farthest, *(abs(a - b) for a, b in zip(message.position, self.first, strict=True)))


class MayMove:
    """Whether the arm would have followed a motion: where it would not, a standing arm shows nothing.

    What this computer has ended by being late is begun again, and counted apart.
    """

    def __init__(self) -> None:
        self.allowed = False
        self.refusals: list[str] = []  # why not, each time that it began
        self.late, self.late_begins = 0, False
        rospy.Subscriber("/lwr/state", LwrState, self.on_state, queue_size=50)

    def on_state(self, message: LwrState) -> None:
        if message._connection_header.get("callerid") != "/robot":
            return
        if self.late_begins and message.motion_allowed:
            # Begun again by the arm's interface itself, which does so for nothing but a computer that was late.
            self.late_begins = False
            self.refusals.pop()
            self.late += 1
        if self.allowed and not message.motion_allowed:
            self.late_begins = message.reason_code != ReasonCode.COMPUTER_LATE
            if not self.late_begins:
                self.late += 1
                threading.Thread(target=rospy.ServiceProxy("/lwr/command", LwrCommand), args=("start",)).start()
            else:
                self.refusals.append(message.reason)
        self.allowed = message.motion_allowed


class Thrown:
    """Callbacks and handlers of ours that ended with an exception, as rospy tells it."""

    def __init__(self, nodes: list[str]) -> None:
        self.nodes = nodes
        self.words: list[str] = []
        rospy.Subscriber("/rosout", Log, self.on_log, queue_size=1000)

    def on_log(self, message: Log) -> None:
        if message.name in self.nodes and message.msg.startswith(("bad callback", "Error processing request")):
            self.words.append(f"{message.name}: {message.msg[:160]}")


class FuzzTest(unittest.TestCase):
    """One campaign, in setUpClass."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("fuzz")
        settle(READY_LIMIT)
        for service, kind, arguments in (
            ("/controller_manager/load_controller", LoadController, ("dmp", "coglab/DmpController")),
            ("/controller_manager/load_controller", LoadController, ("ptp", "coglab/PtpController")),
            ("/lwr/command", LwrCommand, ("start",)),
            ("/controller_manager/switch_controller", SwitchController, ("ptp",)),
        ):
            end = time.monotonic() + 20.0
            while not (answer := rospy.ServiceProxy(service, kind)(*arguments)).success:
                if "in use" in answer.message:  # the brain was faster
                    break
                assert time.monotonic() < end, answer.message
                time.sleep(0.2)
        cls.fuzz = Fuzz(seed=1)
        cls.arm, cls.motion, cls.thrown = Still(), MayMove(), Thrown(cls.fuzz.nodes)
        cls.before = cls.fuzz.talking(HEARD_BEFORE)
        cls.allowed_before = cls.motion.allowed
        cls.report = cls.fuzz.run(PER_TOPIC, PER_SERVICE, limit=20.0)
        # Every number of people is a valid one, also none; with none in view there is nothing to recognise.
        people = rospy.Publisher("/perception/people", UInt8, queue_size=1, latch=True)
        people.publish(1)
        cls.after = cls.fuzz.talking(HEARD_AFTER)
        report = {
            "nodes": len(cls.fuzz.nodes),
            "topics": len(cls.fuzz.topics),
            "services": len(cls.fuzz.services),
            "sent": cls.report.sent,
            "answers": cls.report.answers,
            "unanswered": sum(cls.report.unanswered.values()),
            "late": cls.report.late,
            "lost": cls.report.lost,
            "accepted": cls.report.accepted,
            "ended": cls.report.ended,
            "silent": sorted(cls.before - cls.after),
            "moved": cls.arm.farthest,
            "motion_allowed": cls.motion.allowed,
            "motion_refused": cls.motion.refusals,
            "computer_late": cls.motion.late,
            "thrown": cls.thrown.words,
        }
        print(json.dumps(report), flush=True)
        if "COGLAB_FUZZ_REPORT" in os.environ:
            Path(os.environ["COGLAB_FUZZ_REPORT"]).write_text(json.dumps(report))

    def test_1_everything_is_there(self):
        for node in (
            "/robot",
            "/ih2_hand",
            "/coglab",
            "/object_database",
            "/contact_detector",
            "/perception",
            "/motion_recogniser",
            "/coglab_sim/cell",
        ):
            self.assertIn(node, self.fuzz.nodes)
        self.assertTrue({"/tf", "/tf_static", "/lwr/target_joint_states"} <= set(self.fuzz.topics))
        self.assertGreaterEqual(sum(self.report.sent.values()), LEAST)

    def test_1_odd_stamps_with_all_else_fine_reached_everybody_who_takes_a_time(self):
        kinds = {**self.fuzz.topics, **{name: kind._request_class for name, kind in self.fuzz.services.items()}}
        timed = {name for name, kind in kinds.items() if has_time(kind)}
        self.assertTrue({"/tf", "/lwr/target_joint_states", "/lwr/joint_states"} <= timed, timed)
        self.assertEqual({name for name in timed if not self.report.odd_stamps[name]}, set())

    def test_2_no_node_ended(self):
        self.assertEqual(self.report.ended, [])

    def test_3_whoever_spoke_still_speaks(self):
        self.assertEqual(self.before - self.after, set())

    def test_4_every_service_answered(self):
        missing = {name: n for name, n in self.report.unanswered.items() if n}
        self.assertEqual(missing, {}, f"late, s: {self.report.late}; lost: {self.report.lost}")

    def test_5_the_arm_stood(self):
        self.assertIsNotNone(self.arm.first)
        self.assertLess(self.arm.farthest, 0.01)

    def test_5_the_arm_would_have_moved_all_the_while(self):
        self.assertTrue(self.allowed_before)
        self.assertEqual(self.motion.refusals, [])
        self.assertTrue(self.motion.allowed)

    def test_6_nothing_threw(self):
        self.assertEqual(self.thrown.words, [])


if __name__ == "__main__":
    rostest.rosrun("coglab_bringup", "fuzz", FuzzTest, sys.argv)
