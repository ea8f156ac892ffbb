#!/usr/bin/python3
"""A recorded hand on ROS: the real cell puts the object into it at the recorded pose, and both follow the recording.
The person then holds an object that is placed later."""

import socket
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np
import rospy
import rostest
from coglab_msgs.msg import CellTruth, HumanHand
from coglab_msgs.srv import PlaceObject
from coglab_py.messages import pose_message, pose_of
from coglab_py.pose import Pose, about_z
from coglab_sim.person.grip import GripForce
from coglab_sim.person.participant import Participant
from coglab_sim.person.reach import Reach
from coglab_sim.person.scene import Scene, shipped
from std_msgs.msg import String

SEED = 7
IN_HAND = Pose(np.array([-0.085, 0.01, -0.045]), about_z(0.3))
"""not where a simulated person holds the mug, nor turned as there"""
REACH = Reach(np.array([1.30, 0.20, 0.15]), np.array([0.95, 0.10, 0.35]), 0.0, 1.2)


def write_recording(path: Path) -> None:
    """A reach with the mug in the hand, at 50 Hz, then half a second at its end."""
    lines = ["t,x,y,z,qx,qy,qz,qw,frame"]
    for t in np.arange(0.0, 1.7, 0.02):
        hand = Pose(REACH.at(t)[0])
        for name, pose in (("human_hand", hand), ("object_mug", hand * IN_HAND)):
            lines.append(",".join(repr(float(v)) for v in (t, *pose.position, *pose.orientation)) + f",{name}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def wait_for(condition, limit: float = 60.0) -> bool:
    """Polls until the condition holds or the limit (s, wall) is over."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


class RecordedHand(unittest.TestCase):
    """In alphabetical order."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.truth, cls.hand, cls.phases = [], [], []
        cls.bridge = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # one that never answers
        cls.bridge.bind(("127.0.0.1", 0))
        rospy.set_param("/lwr/fri_port_bound", cls.bridge.getsockname()[1])
        rospy.Subscriber("/coglab_sim/truth/cell", CellTruth, cls.truth.append)
        rospy.Subscriber("/coglab_sim/human_hand", HumanHand, cls.hand.append)
        rospy.Subscriber("/coglab_sim/human_state", String, lambda m: cls.phases.append(m.data))
        cls.ask = rospy.Publisher("/coglab_sim/human_command", String, queue_size=1, latch=True)
        cls.folder = tempfile.TemporaryDirectory()
        file = Path(cls.folder.name) / "reach.csv"
        write_recording(file)
        rospy.set_param("/coglab_sim/virtual_human", {"seed": SEED, "recording": {"file": str(file), "person": "wait"}})
        program = Path(__file__).resolve().parents[1] / "scripts" / "virtual_human.py"
        cls.person = subprocess.Popen([str(program), "__ns:=/coglab_sim"])

    @classmethod
    def tearDownClass(cls) -> None:
        cls.person.terminate()
        cls.person.wait(60.0)
        cls.bridge.close()
        cls.folder.cleanup()

    def held_as_recorded(self) -> float:
        """Distance (m) between actual and recorded position of the object in the person's hand, or 0.1 m per rad of the
        turn between them if that is larger. Before the person comes, the cell's own object is in the hand."""
        now = self.truth[-1]
        in_hand = pose_of(now.human_hand).inverse() * pose_of(now.object)
        turn = abs((in_hand.rotation * IN_HAND.rotation.inv()).magnitude())
        return max(float(np.linalg.norm(in_hand.position - IN_HAND.position)), 0.1 * float(turn))

    def test_1_the_object_lies_in_the_hand_as_it_was_recorded(self) -> None:
        self.assertTrue(wait_for(lambda: self.hand and self.truth), "no person, or no cell")
        self.assertTrue(wait_for(lambda: self.truth[-1].held_by == "human"), self.truth[-1].held_by)
        self.assertTrue(wait_for(lambda: self.held_as_recorded() < 0.005), self.held_as_recorded())

    def test_2_hand_and_object_go_as_recorded(self) -> None:
        self.ask.publish("give mug")
        end = np.array(REACH.end)
        there = lambda: np.linalg.norm(pose_of(self.truth[-1].human_hand).position - end) < 0.02  # noqa: E731
        self.assertTrue(wait_for(lambda: "waiting" in self.phases and there()), self.phases)
        self.assertEqual(self.truth[-1].held_by, "human")
        self.assertTrue(wait_for(lambda: self.held_as_recorded() < 0.01), self.held_as_recorded())

    def test_3_another_object_is_the_one_that_the_person_holds(self) -> None:
        ball = Scene.of(shipped("ball"))
        grip = GripForce(Participant.from_mapping({"seed": SEED}), ball, True).force
        self.assertGreater(self.hand[-1].grip_force, 1.5 * grip)
        place = rospy.ServiceProxy("/coglab_sim/cell/place_object", PlaceObject)
        answer = place("ball", "human_hand", pose_message(Pose(ball.object_in_hand)))
        self.assertTrue(answer.success, answer.message)
        self.assertTrue(wait_for(lambda: self.truth[-1].object_id == "ball" and self.truth[-1].held_by == "human"))
        self.assertTrue(wait_for(lambda: abs(self.hand[-1].grip_force / grip - 1.0) < 0.15), self.hand[-1].grip_force)
        self.assertIsNone(self.person.poll())


if __name__ == "__main__":
    rospy.init_node("recorded_hand_rostest")
    rostest.rosrun("coglab_sim", "recorded_hand", RecordedHand)
