#!/usr/bin/python3
"""Nothing that arrives by ROS ends a node or moves the arm: a sample of the campaign of ./coglab bench fuzz."""

import json
import os
import sys
import threading
import time
import unittest
from pathlib import Path

import rospkg
import rospy
import rostest
import tf2_ros
import yaml
from coglab_bringup.ros_fuzz import ARM, WHOLE, Fuzz, explained, has_time, settle
from coglab_msgs.msg import DmpFeedback, LwrState, ReasonCode
from coglab_msgs.srv import ExecuteDmp, ExecuteDmpRequest, LoadController, LoadDmps, LwrCommand, SwitchController
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import UInt8

LONG = os.environ.get("COGLAB_LONG") == "1"
WAY = os.environ.get("COGLAB_FUZZ_LAUNCH", "one")
PER_TOPIC, PER_SERVICE, LEAST = (
    {
        "one": (900, 450, 60_000),
        "split": (500, 250, 30_000),
        "ideal": (1500, 700, 10_000),
    }[WAY]
    if LONG
    else (8, 6, 50 if WAY == "ideal" else 200)
)
"""messages to each topic and to each service while the arm stands, and how many at least in all"""
BESIDE_REACH = (40, 20) if LONG else (2, 2)
"""messages to each beside a reach"""
CELL = {
    "/ih2_hand",
    "/coglab",
    "/object_database",
    "/contact_detector",
    "/perception",
    "/motion_recogniser",
    "/coglab_sim/cell",
}
NODES = {
    "one": CELL | {"/robot"},
    "split": CELL | {"/lwr", "/controller_manager", "/goal_helper"},
    "ideal": {"/robot"},
}[WAY]
ARM_NODE, MANAGER_NODE = ("/lwr", "/controller_manager") if WAY == "split" else ("/robot", "/robot")
HEARD_WITH_TIME = {
    "one": {"/tf", "/lwr/target_joint_states", "/lwr/joint_states"},
    "split": {
        *("/tf", "/lwr/target_joint_states", "/lwr/joint_states"),
        *("/lwr/state", "/lwr/external_torques", "/lwr/tool_wrench"),
    },
    "ideal": {"/tf", "/controller_manager/dmp/dmp_goal"},
}[WAY]
"""topics that matter most, of those with a stamp"""
TOLD_BY_TF = {"/controller_manager/dmp/dmp_goal": ("/goal_helper", "no goal")}
"""topics that may fall silent, if their node says why, with the node and how its words begin: a valid transform that
gives a frame another parent leaves the goal helper without a goal"""
SPARED = {"/controller_manager/dmp/cancel", "/controller_manager/ptp/cancel"}
"""services that may end a reach whatever their request says"""
REACH_LIMIT = 240.0  # s
REASONS = {
    ReasonCode.GOAL_STALE,
    ReasonCode.GOAL_FROM_FUTURE,
    ReasonCode.GOAL_JUMPED,
    ReasonCode.GOAL_LOST,
    ReasonCode.COMPUTER_LATE,
}
"""why a reach may end before its goal: what came as its goal, or a computer that was late"""
if WAY == "split":
    # What comes on lwr/state is what the arm's interface says, whoever sends it.
    REASONS |= set(range(ReasonCode.ROBOT_DISCONNECTED, ReasonCode.STALE_JOINT_STATE + 1))
READY_LIMIT = 240.0  # s
HEARD_BEFORE, HEARD_AFTER = 2.5, 60.0
"""s in which publishing topics are noted, afterwards at most; a state machine's structure comes every 2 s"""
SAID_WITHIN = HEARD_AFTER + 5.0
"""s for which a node's words count as its reason: it says them every 5 s, and may have begun before it is heard"""


class Still:
    """How far the arm's joints are from where they were, by the word of the robot's own node."""

    def __init__(self) -> None:
        self.first: tuple | None = None
        self.farthest = 0.0  # rad
        rospy.Subscriber("/lwr/joint_states", JointState, self.on_joints, queue_size=50)

    def on_joints(self, message: JointState) -> None:
        if message._connection_header.get("callerid") != ARM_NODE:
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
        if message._connection_header.get("callerid") != ARM_NODE:
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


class Reasons:
    """What the nodes of TOLD_BY_TF say of why they are silent."""

    def __init__(self) -> None:
        self.said: dict[str, tuple[float, str]] = {}  # by topic: when last (s, monotonic), and the words
        rospy.Subscriber("/rosout", Log, self.on_log, queue_size=1000)

    def on_log(self, message: Log) -> None:
        for topic, (node, words) in TOLD_BY_TF.items():
            if message.name == node and message.msg.startswith(words):
                self.said[topic] = time.monotonic(), message.msg[:160]


class Limits:
    """How near the arm's joints come to the ends of their ranges, and their speeds to what the table lets them have."""

    def __init__(self) -> None:
        table = yaml.safe_load(
            Path(rospkg.RosPack().get_path("lwr_description"), "config/joint_limits.yaml").read_text()
        )
        self.table = table["default"]
        self.speed = 0.0  # share of the limit
        self.room = 1e9  # rad
        rospy.Subscriber("/lwr/joint_states", JointState, self.on_joints, queue_size=50)

    def on_joints(self, message: JointState) -> None:
        if message._connection_header.get("callerid") != ARM_NODE:
            return
        low, high, most = (self.table[name] for name in ("lower_position", "upper_position", "velocity"))
        self.speed = max(self.speed, *(abs(v) / most[i] for i, v in enumerate(message.velocity)))
        self.room = min(self.room, *(min(q - low[i], high[i] - q) for i, q in enumerate(message.position)))


class Reach:
    """A slow motion of the arm toward a goal that is seen 30 times a second."""

    GOAL = (0.75, 0.1, 0.45)  # m

    def __init__(self) -> None:
        self.feedback = DmpFeedback()
        self.states: list[str] = []
        rospy.Subscriber("/controller_manager/dmp/feedback", DmpFeedback, self.on_feedback, queue_size=50)
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.timer = rospy.Timer(rospy.Duration(1.0 / 30.0), self.show)

    def show(self, _event: object) -> None:
        message = TransformStamped()
        message.header.stamp = rospy.Time.now()
        message.header.frame_id, message.child_frame_id = "lwr_base_link", "reach_goal"
        place = message.transform.translation
        place.x, place.y, place.z = self.GOAL
        message.transform.rotation.w = 1.0
        self.broadcaster.sendTransform(message)

    def on_feedback(self, message: DmpFeedback) -> None:
        if message._connection_header.get("callerid") != MANAGER_NODE:
            return
        self.feedback = message
        if self.states[-1:] != [message.state]:
            self.states.append(message.state)

    def begin(self) -> None:
        library = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
        ask("/controller_manager/dmp/load_dmps", LoadDmps, library)
        ask("/controller_manager/switch_controller", SwitchController, "dmp")
        self.states.clear()
        ask(
            "/controller_manager/dmp/execute_dmp",
            ExecuteDmp,
            ExecuteDmpRequest(primitive_id="reach_human", goal_frame="reach_goal", dmp_ratio=2.0),
        )

    def ended(self) -> bool:
        return "running" in self.states and self.states[-1] in ("reached", "aborted")


def ask(service: str, kind: type, *arguments: object) -> None:
    """Until it succeeds."""
    end = time.monotonic() + 60.0
    while not (answer := rospy.ServiceProxy(service, kind)(*arguments)).success:
        if "in use" in answer.message:  # the brain was faster
            return
        assert time.monotonic() < end, f"{service}: {answer.message}"
        time.sleep(0.2)


class FuzzTest(unittest.TestCase):
    """One campaign, in setUpClass."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("fuzz")
        settle(READY_LIMIT, ARM if WAY == "ideal" else WHOLE)
        ask("/controller_manager/load_controller", LoadController, "dmp", "coglab/DmpController")
        ask("/controller_manager/load_controller", LoadController, "ptp", "coglab/PtpController")
        ask("/lwr/command", LwrCommand, "start")
        ask("/controller_manager/switch_controller", SwitchController, "ptp")
        cls.fuzz = Fuzz(seed=1)
        cls.arm, cls.motion, cls.thrown, reasons = Still(), MayMove(), Thrown(cls.fuzz.nodes), Reasons()
        cls.before = cls.fuzz.talking(HEARD_BEFORE)
        cls.allowed_before = cls.motion.allowed
        cls.report = cls.fuzz.run(PER_TOPIC, PER_SERVICE, limit=60.0)
        cls.moved, cls.allowed, cls.refusals = cls.arm.farthest, cls.motion.allowed, list(cls.motion.refusals)
        cls.reach_beside()
        # Every number of people is a valid one, also none; with none in view there is nothing to recognise.
        people = rospy.Publisher("/perception/people", UInt8, queue_size=1, latch=True)
        people.publish(1)
        silent = cls.before - cls.fuzz.talking(HEARD_AFTER, cls.before)
        cls.explained = explained(silent, dict(reasons.said), time.monotonic(), SAID_WITHIN)
        cls.silent = silent - set(cls.explained)
        report = cls.words()
        print(json.dumps(report), flush=True)
        if "COGLAB_FUZZ_REPORT" in os.environ:
            Path(os.environ["COGLAB_FUZZ_REPORT"]).write_text(json.dumps(report))

    @classmethod
    def reach_beside(cls):
        """The same while the arm reaches."""
        cls.limits, cls.reach = Limits(), Reach()
        cls.reach.begin()
        begun = time.monotonic()
        cls.fuzz.run(*BESIDE_REACH, limit=60.0, spared=SPARED)
        cls.running_beside = "running" in cls.reach.states
        cls.fuzz_took = time.monotonic() - begun
        while not cls.reach.ended() and time.monotonic() < begun + REACH_LIMIT:
            time.sleep(0.05)
        cls.reach.timer.shutdown()

    @classmethod
    def words(cls):
        """What the bench reads."""
        end = cls.reach.feedback
        return {
            "way": WAY,
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
            "spoke": len(cls.before),
            "silent": sorted(cls.silent),
            "explained": cls.explained,
            "left_out": cls.fuzz.left_out,
            "spared": sorted(SPARED & set(cls.fuzz.services)),
            "moved": cls.moved,
            "motion_allowed": cls.allowed,
            "motion_refused": cls.refusals,
            "computer_late": cls.motion.late,
            "thrown": cls.thrown.words,
            "reach": {
                "states": cls.reach.states,
                "code": end.reason_code,
                "reason": end.reason,
                "distance": end.remaining_distance,
                "speed": cls.limits.speed,
                "room": cls.limits.room,
                "beside": round(cls.fuzz_took, 1),
            },
        }

    def test_1_everything_is_there(self):
        self.assertEqual(NODES - set(self.fuzz.nodes), set())
        self.assertTrue(HEARD_WITH_TIME <= set(self.fuzz.topics))
        self.assertGreaterEqual(sum(self.report.sent.values()), LEAST)

    def test_1_odd_stamps_with_all_else_fine_reached_everybody_who_takes_a_time(self):
        kinds = {**self.fuzz.topics, **{name: kind._request_class for name, kind in self.fuzz.services.items()}}
        timed = {name for name, kind in kinds.items() if has_time(kind)}
        self.assertTrue(HEARD_WITH_TIME <= timed, timed)
        self.assertEqual({name for name in timed if not self.report.odd_stamps[name]}, set())

    def test_2_no_node_ended(self):
        self.assertEqual(self.report.ended, [])

    def test_3_whoever_spoke_still_speaks_or_says_why_not(self):
        self.assertEqual(self.silent, set())

    def test_4_every_service_answered(self):
        missing = {name: n for name, n in self.report.unanswered.items() if n}
        self.assertEqual(missing, {}, f"late, s: {self.report.late}; lost: {self.report.lost}")

    def test_5_the_arm_stood(self):
        self.assertIsNotNone(self.arm.first)
        self.assertLess(self.moved, 0.01)

    def test_5_the_arm_would_have_moved_all_the_while(self):
        self.assertTrue(self.allowed_before)
        self.assertEqual(self.refusals, [])
        self.assertTrue(self.allowed)

    def test_6_nothing_threw(self):
        self.assertEqual(self.thrown.words, [])

    def test_7_no_malformed_request_succeeds(self):
        self.assertEqual(dict(self.report.accepted), {})

    def test_8_a_reach_beside_it_ends_at_its_goal_or_says_what_came_as_its_goal(self):
        end = self.reach.feedback
        self.assertTrue(self.running_beside, self.reach.states)
        self.assertTrue(self.reach.ended(), (self.reach.states, end))
        if self.reach.states[-1] == "reached":
            self.assertLess(end.remaining_distance, 0.02)
        else:
            self.assertIn(end.reason_code, REASONS, end.reason)
            self.assertTrue(end.reason)

    def test_8_no_limit_was_passed_on_the_way(self):
        self.assertGreater(self.limits.speed, 0.02)
        self.assertLess(self.limits.speed, 1.0)
        self.assertGreater(self.limits.room, 0.0)


if __name__ == "__main__":
    rostest.rosrun("coglab_bringup", "fuzz", FuzzTest, sys.argv)
