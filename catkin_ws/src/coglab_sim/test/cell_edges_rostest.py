#!/usr/bin/python3
"""The node /coglab_sim/cell at its edges: what it ignores on its topics, what its services answer, which parameters it
reads where, and how it ends when it cannot begin."""

import socket
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rospy
import rostest
from coglab_msgs.msg import CellTruth, HumanHand, MotorCommands, MotorStates, ReasonCode
from coglab_msgs.srv import InjectFault, PlaceObject
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3, Wrench
from rosgraph_msgs.msg import Clock

sys.path.insert(0, str(Path(__file__).resolve().parent))
from cell_rostest import cell_binary, wait_for

HERE = (1.0, 0.2, 0.5)


def pose(place, w=1.0):
    return Pose(Point(*place), Quaternion(0, 0, 0, w))


def ended(*arguments):
    """What a cell that cannot begin says; it ends with status 1."""
    run = subprocess.run(
        [cell_binary(), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=60,
        check=False,
    )
    return run.returncode, run.stdout


class CellEdges(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.silent = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # a bridge that never answers
        cls.silent.bind(("127.0.0.1", 0))
        port = cls.silent.getsockname()[1]
        cls.log = Path(cls.folder.name) / "log.csv"
        rospy.set_param("/edge/fri_period", 0.02)
        rospy.set_param("/edge/seed", 5)
        rospy.set_param("/edge/cell", {"fri_port": port, "publish_clock": True, "tactile": False, "truth_rate": 50.0})
        rospy.set_param("/edge/cell/object", {"id": "bottle"})
        rospy.set_param("/edge/cell/log_file", str(cls.log))
        cls.truth, cls.motors, cls.clock = [], [], []
        rospy.Subscriber("/edge/truth/cell", CellTruth, cls.truth.append)
        rospy.Subscriber("/edge/motor_states", MotorStates, cls.motors.append)
        rospy.Subscriber("/clock", Clock, cls.clock.append)
        cls.human = rospy.Publisher("/edge/human_hand", HumanHand, queue_size=1)
        cls.commands = rospy.Publisher("/edge/motor_commands", MotorCommands, queue_size=1)
        cls.push = rospy.Publisher("/edge/cell/push", Wrench, queue_size=1)
        cls.node = subprocess.Popen([cell_binary(), "__ns:=/edge", "__name:=cell"])
        rospy.wait_for_service("/edge/cell/place_object", 60.0)
        cls.fault = rospy.ServiceProxy("/edge/cell/fault", InjectFault)
        cls.place = rospy.ServiceProxy("/edge/cell/place_object", PlaceObject)
        assert wait_for(lambda: cls.truth and cls.motors and cls.human.get_num_connections() > 0)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.node.terminate()
        cls.node.wait(60.0)
        cls.silent.close()
        cls.folder.cleanup()

    def newer(self, count=5) -> CellTruth:
        """The truth a few messages later."""
        seen = len(self.truth)
        self.assertTrue(wait_for(lambda: len(self.truth) >= seen + count))
        return self.truth[-1]

    def hand(self) -> np.ndarray:
        place = self.newer().human_hand.position
        return np.array([place.x, place.y, place.z])

    def test_1_the_object_of_the_configuration_is_held_at_half_its_height(self) -> None:
        truth = self.newer()
        self.assertEqual((truth.object_id, truth.held_by, truth.header.frame_id), ("bottle", "human", "world"))
        height = truth.human_hand.position.z - truth.object.position.z
        self.assertAlmostEqual(height, 0.11, delta=0.03)
        self.assertAlmostEqual(truth.human_hand.position.x - truth.object.position.x, 0.08, delta=1e-3)
        self.assertTrue(wait_for(lambda: self.clock), "the clock is published on request")

    def test_2_what_no_hand_can_do_is_ignored(self) -> None:
        self.human.publish(HumanHand(pose=pose(HERE), grip=1.0, grip_force=20.0))
        self.assertTrue(wait_for(lambda: np.linalg.norm(self.hand() - HERE) < 0.01), self.hand())
        fast, spun = Twist(linear=Vector3(0, 100.5, 0)), Twist(angular=Vector3(0, 0, 100.5))
        there = pose((1.0, 0.3, 0.6))
        for wrong in (
            HumanHand(pose=there, grip=1.01, grip_force=20.0),
            HumanHand(pose=there, grip=-0.01, grip_force=20.0),
            HumanHand(pose=there, grip=1.0, grip_force=1001.0),
            HumanHand(pose=there, grip=1.0, grip_force=-1.0),
            HumanHand(pose=there, grip=1.0, grip_force=20.0, velocity=fast),
            HumanHand(pose=there, grip=1.0, grip_force=20.0, velocity=spun),
            HumanHand(pose=pose((1.0, 0.3, 0.6), 0.9), grip=1.0, grip_force=20.0),
        ):
            self.human.publish(wrong)
            self.newer(8)
            self.assertLess(np.linalg.norm(self.hand() - HERE), 0.01, wrong)
        self.human.publish(HumanHand(pose=there, grip=1.0, grip_force=1000.0))
        self.assertTrue(wait_for(lambda: np.linalg.norm(self.hand() - [1.0, 0.3, 0.6]) < 0.01))

    def test_3_what_no_motor_can_do_is_ignored(self) -> None:
        for speed, target, current in ((1.01, 0.5, 100.0), (1.0, 1.01, 100.0), (1.0, 0.5, 10001.0), (1.0, 0.5, -1.0)):
            self.commands.publish(MotorCommands(speed=[speed] * 5, target=[target] * 5, current=[current] * 5))
            self.newer(5)
        self.assertEqual(list(self.motors[-1].position), [0.0] * 5)
        self.commands.publish(MotorCommands(speed=[1.0] * 5, target=[0.2] * 5, current=[10000.0] * 5))
        self.assertTrue(wait_for(lambda: min(self.motors[-1].position) > 0.199))

    def test_4_services_answer_with_a_word_and_a_code(self) -> None:
        done = self.fault("acknowledge", 0.0, 0.0)
        self.assertEqual((done.success, done.message, done.reason_code), (True, "acknowledge done", 0))
        refused = self.fault("nothing", 0.0, 0.0)
        self.assertEqual((refused.success, refused.reason_code), (False, ReasonCode.INVALID_ARGUMENT))
        self.assertIn("unknown fault 'nothing'", refused.message)
        placed = self.place("", "world", pose((1.5, 1.0, 0.3)))
        self.assertEqual((placed.success, placed.message, placed.reason_code), (True, "bottle placed: world", 0))
        placed = self.place("bottle", "world", pose((1.5, 1.0, 0.3)))
        self.assertEqual(placed.message, "bottle placed: world")
        for request, words in (
            (("a/b", "world", pose((1.5, 1.0, 0.3))), "object id 'a/b': expected the name of an object file"),
            (("", "moon", pose((1.5, 1.0, 0.3))), "unknown placement 'moon'"),
            (("", "world", pose((1.5, 1.0, 0.3), 0.9)), "pose needs finite numbers and a quaternion of length 1"),
            (("mug", "world", pose((1.5, 1.0, -0.8))), "object 'mug' would stand"),
        ):
            answer = self.place(*request)
            self.assertEqual((answer.success, answer.reason_code), (False, ReasonCode.INVALID_ARGUMENT), request)
            self.assertIn(words, answer.message)
        self.assertEqual(self.newer().object_id, "bottle", "what could not be placed has changed nothing")
        self.assertEqual(self.place("mug", "world", pose((1.5, 1.0, 0.3))).message, "mug placed: world")
        self.assertEqual(self.newer().object_id, "mug")
        self.assertEqual(self.place("", "world", pose((1.5, 1.0, 0.3))).message, "mug placed: world")

    def test_5_every_period_of_the_parent_namespace_is_in_the_log(self) -> None:
        self.assertTrue(wait_for(lambda: len(self.log.read_text().splitlines()) > 20))
        lines = self.log.read_text().splitlines()
        joints = ("a1", "a2", "e1", "a3", "a4", "a5", "a6")
        names = [f"{kind}_lwr_{joint}" for kind in ("commanded", "measured") for joint in joints]
        self.assertEqual(lines[0].split(","), ["time", "state", "quality", "power", "control", "answered", *names])
        rows = np.array([[float(v) for v in line.split(",")] for line in lines[1:-1]])
        self.assertEqual(rows.shape[1], 20)
        self.assertTrue(np.allclose(np.diff(rows[:, 0]), 0.02, atol=1e-6))
        self.assertLess(abs(rows[0, 13] + 1.4349), 0.01)
        self.assertEqual(set(rows[:, 1]) - {0.0, 1.0}, set())
        self.assertEqual(set(rows[:, 5]), {0.0})

    def test_6_a_push_that_tears_everything_apart_is_ignored(self) -> None:
        before = self.newer().robot_hand.position
        for wrench in (Wrench(force=Vector3(1001, 0, 0)), Wrench(torque=Vector3(0, 1001, 0))):
            self.push.publish(wrench)
            after = self.newer(10).robot_hand.position
            self.assertLess(abs(after.x - before.x) + abs(after.y - before.y) + abs(after.z - before.z), 0.01)
        self.assertIsNone(self.node.poll())

    def test_7_a_cell_that_cannot_begin_says_why(self) -> None:
        code, said = ended("__name:=lonely", "_port_wait:=0.3", "_port_parameter:=nobody/port")
        self.assertEqual(code, 1)
        self.assertIn("waiting up to 0 s for the bridge's port in parameter /nobody/port", said)
        self.assertIn("no bridge published its UDP port in parameter /nobody/port within 0.3", said)
        rospy.set_param("/strange/port", 65536)
        code, said = ended("__ns:=/a/b", "__name:=strange", "_port_wait:=0.3", "_port_parameter:=/strange/port")
        self.assertIn("in parameter /strange/port within 0.3", said)
        code, said = ended("__ns:=/a/b", "__name:=deep", "_port_wait:=0.3")
        self.assertIn("in parameter /a/lwr/fri_port_bound within 0.3", said)
        code, said = ended(
            "__name:=nolog", f"_fri_port:={self.silent.getsockname()[1]}", "_log_file:=/nowhere/at/all.csv"
        )
        self.assertEqual(code, 1)
        self.assertIn("log_file /nowhere/at/all.csv cannot be written", said)
        code, said = ended("__name:=nohost", f"_fri_port:={self.silent.getsockname()[1]}", "_fri_host:=somewhere")
        self.assertIn("FRI host 'somewhere' is not an IPv4 address", said)

    def test_8_a_hand_that_cannot_come_in_is_told_and_not_there(self) -> None:
        where = self.newer().robot_hand.position
        self.assertIsNone(self.node.poll())
        self.assertGreater(np.linalg.norm(self.hand() - [where.x, where.y, where.z]), 0.1)


if __name__ == "__main__":
    rospy.init_node("cell_edges_rostest")
    rostest.rosrun("coglab_sim", "cell_edges", CellEdges, sys.argv)
