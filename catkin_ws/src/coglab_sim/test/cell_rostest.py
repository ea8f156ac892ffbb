#!/usr/bin/python3
"""The node /coglab_sim/cell: UDP, truth, motors of the hand, touch, faults, placing, log file."""

import csv
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import rospy
import rostest
from coglab_msgs.msg import CellTruth, FingertipForces, HumanHand, MotorCommands, MotorStates, ReasonCode
from coglab_msgs.srv import InjectFault, PlaceObject
from coglab_objects.database import ObjectError, objects_folder, read_object
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3, Wrench
from std_msgs.msg import String

sys.path.insert(0, str(Path(__file__).resolve().parent))
from fri_client import COMMAND, MONITOR, Client, parse

ROD = "{type: cylinder, radius: 0.035, height: 0.2}"
"""no ball: higher than its file says in `size`"""


class Bridge(threading.Thread):
    """Answers on its own UDP port and publishes the port like the bridge."""

    def __init__(self, namespace: str = "") -> None:
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.2)
        self.client = Client()
        self.fields = None
        self.received = 0
        self.peers = set()
        rospy.set_param(namespace + "/lwr/fri_port_bound", self.socket.getsockname()[1])

    def run(self) -> None:
        while not rospy.is_shutdown():
            try:
                data, peer = self.socket.recvfrom(2048)
            except TimeoutError:
                continue
            self.received += 1
            self.peers.add(peer)
            self.socket.sendto(self.client.answer(data), peer)
            self.fields = parse(data)


def wait_for(condition, limit: float = 60.0) -> bool:
    """Polls until the condition holds or the limit (s, wall) is over."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def cell_binary() -> str:
    """Path of the node's program."""
    return subprocess.check_output(
        ["catkin_find", "--first-only", "--libexec", "coglab_sim", "cell_node"], text=True
    ).strip()


class CellNode(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.bridge = Bridge()
        cls.bridge.start()
        cls.second = Bridge("/second")
        cls.second.start()
        cls.truth = []
        cls.motors = []
        cls.touch = []
        cls.messages = []
        rospy.Subscriber("/coglab_sim/truth/cell", CellTruth, cls.truth.append)
        rospy.Subscriber("/coglab_sim/motor_states", MotorStates, cls.motors.append)
        rospy.Subscriber("/coglab_sim/fingertip_forces", FingertipForces, cls.touch.append)
        rospy.Subscriber("/coglab_sim/cell/messages", String, lambda m: cls.messages.append(m.data))
        cls.human = rospy.Publisher("/coglab_sim/human_hand", HumanHand, queue_size=1)
        cls.commands = rospy.Publisher("/coglab_sim/motor_commands", MotorCommands, queue_size=1)
        rospy.wait_for_service("/coglab_sim/cell/fault", 60.0)
        cls.fault = rospy.ServiceProxy("/coglab_sim/cell/fault", InjectFault)
        cls.place = rospy.ServiceProxy("/coglab_sim/cell/place_object", PlaceObject)
        assert wait_for(lambda: cls.bridge.fields is not None and cls.truth)

    def command_mode(self) -> None:
        for _ in range(5):  # on a busy computer friStart may find no answer in time
            self.assertTrue(wait_for(lambda: self.bridge.fields["quality"] >= 2))
            self.bridge.client.request(1, 10)
            if wait_for(lambda: self.bridge.fields["state"] == COMMAND, 20.0):
                return
        self.fail(self.messages)

    def test_1_one_socket_and_the_period(self) -> None:
        self.assertEqual(len(self.bridge.peers), 1)
        self.assertAlmostEqual(self.bridge.fields["measurement_period"], 0.01)
        before = self.bridge.received
        self.assertTrue(wait_for(lambda: self.bridge.received > before + 70))

    def test_2_command_mode_and_faults(self) -> None:
        self.command_mode()
        self.assertTrue(self.fault("leave_command_mode", 0.0, 0.0).success)
        self.assertTrue(wait_for(lambda: self.bridge.fields["state"] == MONITOR))
        self.assertTrue(wait_for(lambda: "fault injected" in self.messages))
        self.command_mode()
        self.assertTrue(self.fault("enabling_switch", 0.0, 3.0).success)
        self.assertTrue(wait_for(lambda: self.bridge.fields["power"] == 0))
        # Undone by itself. On a busy computer the drives then need a new start.
        self.assertTrue(wait_for(lambda: "operator safety closed" in self.messages))
        self.command_mode()
        self.assertTrue(wait_for(lambda: self.bridge.fields["power"] == 0x7F))
        refused = self.fault("earthquake", 1.0, 0.0)
        self.assertFalse(refused.success)
        self.assertIn("packet_loss", refused.message)
        self.assertFalse(self.fault("packet_loss", 2.0, 0.0).success)
        self.assertFalse(self.fault("drive_error", 9.0, 0.0).success)

    def test_3_person_and_fingers(self) -> None:
        palm = self.truth[-1].robot_hand.position
        pose = Pose(Point(palm.x + 0.08, palm.y + 0.041, palm.z), Quaternion(0, 0, 0, 1))
        self.move([1.0] * 5, [245 / 255, 5 / 255, 30 / 255, 50 / 255, 50 / 255], 640.0)
        self.assertTrue(wait_for(lambda: self.motors and self.motors[-1].position[0] > 0.95))
        message = HumanHand(pose=pose, grip=1.0, grip_force=20.0)

        def show(until):
            def poll():
                message.header.stamp = rospy.Time.now()
                self.human.publish(message)
                return until()

            return wait_for(poll)

        self.assertTrue(self.place("", "human_hand", Pose(Point(-0.08, 0, -0.05), Quaternion(0, 0, 0, 1))).success)
        self.assertTrue(show(lambda: self.truth[-1].held_by == "human" and self.truth[-1].human_load_share > 0.9))
        self.assertEqual(self.truth[-1].object_id, "mug")
        self.move([1.0] * 5, [245 / 255, 1.0, 1.0, 1.0, 1.0], 240.0)
        self.assertTrue(show(lambda: self.truth[-1].held_by == "both" and all(self.motors[-1].locked[1:])))
        self.assertTrue(all(0.05 < position < 0.95 for position in self.motors[-1].position[1:]))
        self.assertEqual(len(self.touch[-1].forces), len(self.touch[-1].phalanges))
        self.assertTrue(any(abs(force.x) > 0.5 for force in self.touch[-1].forces))
        message.grip = 0.0
        self.assertTrue(show(lambda: self.truth[-1].held_by == "robot" and self.truth[-1].robot_load_share > 0.9))
        self.assertLess(self.truth[-1].palm_force.z, -2.0)
        self.move([1.0] * 5, [245 / 255, 0.0, 0.0, 0.0, 0.0], 640.0)
        self.assertTrue(show(lambda: self.truth[-1].dropped))

    def move(self, speed, target, current) -> None:
        """Commands to the motors of the hand."""
        self.commands.publish(MotorCommands(speed=speed, target=target, current=[current] * 5))

    def test_3b_what_the_database_refuses_is_no_object_of_the_cell(self) -> None:
        ball = (objects_folder() / "ball.yaml").read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            rospy.set_param("/coglab_sim/cell/objects", folder)
            try:
                for field, changed in (
                    ("mass", ball.replace("mass: 0.13", "mass: 6.0")),
                    ("size", ball.replace("size: [0.07, 0.07, 0.07]", "size: [0.08, 0.08, 1.4]")),
                    ("size", ball.replace("radius: 0.035", "radius: 0.05")),
                    ("size", ball.replace("{type: sphere, radius: 0.035}", ROD)),
                    ("shape", ball.replace("radius: 0.035", "radius: -0.05")),
                ):
                    path = Path(folder) / "ball.yaml"
                    path.write_text(changed, encoding="utf-8")
                    with self.assertRaisesRegex(ObjectError, field):
                        read_object(path)
                    answer = self.place("ball", "world", Pose(Point(), Quaternion(0, 0, 0, 1)))
                    self.assertFalse(answer.success)
                    self.assertRegex(answer.message, rf"{field}(\.radius)?( = |: a \w+ of radius)")
                    self.assertIn("./coglab object check ball", answer.message)
            finally:
                rospy.delete_param("/coglab_sim/cell/objects")

    def test_4_bad_requests_are_refused_with_words(self) -> None:
        answer = self.place("", "moon", Pose(Point(), Quaternion(0, 0, 0, 1)))
        self.assertFalse(answer.success)
        self.assertIn("human_hand", answer.message)
        self.assertEqual(answer.reason_code, ReasonCode.INVALID_ARGUMENT)
        self.assertFalse(self.place("", "world", Pose()).success)  # quaternion of length 0
        self.assertIn("objects/", self.place("unknown_thing", "world", Pose(Point(), Quaternion(0, 0, 0, 1))).message)
        self.human.publish(HumanHand(grip=float("nan")))
        self.commands.publish(MotorCommands(speed=[1.0, 2.0]))
        self.commands.publish(MotorCommands(speed=[7.0] * 5, target=[0.0] * 5, current=[0.0] * 5))
        ticks = len(self.truth)
        self.assertTrue(wait_for(lambda: len(self.truth) > ticks + 20))

    def test_5_every_period_is_in_the_log(self) -> None:
        path = rospy.get_param("/coglab_sim/cell/log_file")

        def logged() -> list:
            with open(path) as file:
                return list(csv.DictReader(file))

        self.assertTrue(wait_for(lambda: len(logged()) > 101))
        rows = logged()[:-1]
        times = np.array([float(row["time"]) for row in rows])
        self.assertGreater(len(rows), 100)
        self.assertTrue(np.allclose(np.diff(times), 0.01, atol=1e-6))
        self.assertIn("commanded_lwr_a6", rows[0])
        measured = np.array([float(row["measured_lwr_a1"]) for row in rows])
        self.assertTrue(np.all(np.abs(measured) <= 2.97))
        os.unlink(path)

    def test_91_a_simulation_that_diverges_ends_with_its_reason_and_status_1(self) -> None:
        """With or without brakes, the arm's last joints cannot resist 1000 Nm."""
        push = rospy.Publisher("/torn/push", Wrench, queue_size=1, latch=True)
        push.publish(Wrench(torque=Vector3(1000.0, 1000.0, 1000.0), force=Vector3(1000.0, 1000.0, 1000.0)))
        run = subprocess.run(
            [cell_binary(), "__name:=torn", "_fri_port:=9", "_seed:=5"],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60,
            check=False,
        )
        self.assertIn("diverged", run.stdout)
        self.assertEqual(run.returncode, 1, run.stdout)

    def test_92_a_cell_that_cannot_begin_says_why(self) -> None:
        for arguments, words in (
            (["_port_wait:=0.3", "_port_parameter:=nobody/port"], "port in parameter /nobody/port within 0.3"),
            (["__ns:=/a/b", "_port_wait:=0.3"], "in parameter /a/lwr/fri_port_bound within 0.3"),
            (["_fri_port:=9", "_log_file:=/nowhere/at/all.csv"], "log_file /nowhere/at/all.csv cannot be written"),
            (["_fri_port:=9", "_fri_host:=somewhere"], "FRI host 'somewhere' is not an IPv4 address"),
        ):
            run = subprocess.run(
                [cell_binary(), "__name:=no_cell", *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=60,
                check=False,
            )
            self.assertEqual(run.returncode, 1)
            self.assertIn(words, run.stdout)

    def test_93_a_log_that_cannot_be_written_any_more_is_reported_once_and_ends_nothing(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            text = Path(folder, "text").read_text
            with Path(folder, "text").open("w") as output:
                run = subprocess.Popen(
                    [cell_binary(), "__name:=full", "_fri_port:=9", "_log_file:=/dev/full"],
                    stdout=output,
                    stderr=subprocess.STDOUT,
                )
            try:
                self.assertTrue(wait_for(lambda: "log_file /dev/full" in text()), text())
                time.sleep(1.0)
                self.assertIsNone(run.poll(), text())
                self.assertEqual(text().count("log_file /dev/full"), 1, text())
            finally:
                run.terminate()
                run.wait(60.0)

    def test_7_two_robots_in_one_graph(self) -> None:
        """All names are relative: the cell of another namespace finds the bridge of that namespace."""
        second = self.second
        self.assertTrue(wait_for(lambda: second.fields is not None))
        self.assertFalse(second.peers & self.bridge.peers)
        rospy.wait_for_message("/second/coglab_sim/truth/cell", CellTruth, 60.0)
        self.assertTrue(rospy.ServiceProxy("/second/coglab_sim/cell/fault", InjectFault)("block", 1.0, 0.0).success)
        self.assertEqual(len(self.bridge.peers), 1)


if __name__ == "__main__":
    rospy.init_node("cell_rostest")
    rostest.rosrun("coglab_sim", "cell", CellNode)
