#!/usr/bin/python3
"""The perception stand-in on ROS: frames, services, and a recording whose pattern is recognised."""

from __future__ import annotations

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
import tf2_ros
from coglab_msgs.msg import CellTruth, ReasonCode, Recognition
from coglab_msgs.srv import FreePlaces, InitVision, LocateObject
from coglab_sim.person.reach import Reach
from geometry_msgs.msg import Point, Pose, Quaternion

SOURCES = Path(__file__).resolve().parents[2]
HAND, OBJECT, PALM = (1.05, 0.20, 0.35), (0.97, 0.20, 0.30), (0.5, 0.0, 0.4)
LIMIT_S = 60.0


def pose(place):
    """A pose without rotation."""
    return Pose(Point(*place), Quaternion(0, 0, 0, 1))


class Cell(threading.Thread):
    """Publishes a constant true state."""

    def __init__(self):
        super().__init__(daemon=True)
        self.publisher = rospy.Publisher("coglab_sim/truth/cell", CellTruth, queue_size=1)
        self.object = OBJECT
        self.running = True

    def run(self):
        while self.running and not rospy.is_shutdown():
            self.publisher.publish(
                CellTruth(object_id="mug", object=pose(self.object), human_hand=pose(HAND), robot_hand=pose(PALM))
            )
            time.sleep(0.01)


class Perception(unittest.TestCase):
    """In alphabetical order: before the cell, with it, a recording."""

    @classmethod
    def setUpClass(cls):
        cls.services = {}
        for name, kind in (("init_vision", InitVision), ("locate_object", LocateObject), ("free_places", FreePlaces)):
            rospy.wait_for_service(f"perception/{name}", LIMIT_S)
            cls.services[name] = rospy.ServiceProxy(f"perception/{name}", kind)
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        cls.cell = None

    def call(self, name, **arguments):
        return self.services[name](**arguments)

    def answer(self, name, **arguments):
        """The successful answer of a service. Asks again for LIMIT_S, because a busy computer may see too late."""
        answers = []

        def succeeds():
            answers.append(self.call(name, timeout=10.0, **arguments))
            return answers[-1].success

        self.wait(succeeds, f"success of {name}")
        return answers[-1]

    def wait(self, condition, text):
        end = time.monotonic() + LIMIT_S
        while not condition():
            self.assertLess(time.monotonic(), end, text)
            time.sleep(0.02)

    def test_a_without_a_cell_everything_fails_with_a_sentence(self):
        answer = self.call("init_vision", timeout=0.2)
        self.assertFalse(answer.success)
        self.assertIn("0.2 s", answer.message)
        answer = self.call("locate_object", object_id="mug", timeout=0.2)
        self.assertFalse(answer.success)
        self.assertIn("'object_mug'", answer.message)
        answer = self.call("free_places", object_id="mug", timeout=0.2)
        self.assertFalse(answer.success)
        self.assertIn("board", answer.message)

    def test_b_with_a_cell(self):
        type(self).cell = Cell()
        self.cell.start()
        self.answer("init_vision")
        answer = self.answer("locate_object", object_id="mug")
        self.assertEqual((answer.frame_id, answer.pose.header.frame_id), ("object_mug", "world"))
        place = answer.pose.pose.position
        self.assertLess(np.linalg.norm(np.array([place.x, place.y, place.z]) - OBJECT), 0.05)
        for frame in ("human_hand", "object_mug", "board"):
            self.wait(lambda frame=frame: self.buffer.can_transform("world", frame, rospy.Time(0)), f"frame {frame}")
        answer = self.call("locate_object", object_id="nothing", timeout=0.2)
        self.assertIn("human_hand, object_mug", answer.message)
        self.assertEqual(answer.reason_code, ReasonCode.OBJECT_NOT_SEEN)
        answer = self.answer("free_places", object_id="mug")
        self.assertEqual(len(answer.places), 3)
        self.assertEqual(answer.places[0].header.frame_id, "board")

    def test_c_a_recording_is_played_and_recognised(self):
        if self.cell:
            self.cell.running = False
        path = Path(tempfile.mkdtemp()) / "reach.csv"
        reach = Reach(np.array([1.30, 0.20, 0.15]), np.array([0.86, 0.05, 0.66]), 1.0, 1.2)
        with open(path, "w", encoding="utf-8") as stream:
            stream.write("t,x,y,z\n")
            for t in np.arange(0.0, 4.0, 0.02):
                stream.write(f"{t},{','.join(str(float(v)) for v in reach.at(t)[0])}\n")
        seen = []
        rospy.Subscriber("played/perception/recognition", Recognition, seen.append)
        for name in ("settings", "board", "frames"):
            rospy.set_param(f"played/perception/{name}", rospy.get_param(f"perception/{name}"))
        frames = dict(rospy.get_param("perception/frames"), human_hand="played_hand")
        rospy.set_param("played/perception/frames", frames)
        rospy.set_param("played/perception/recording", {"file": str(path), "at_end": "loop"})
        rospy.set_param(
            "played/motion_recogniser/patterns", str(SOURCES / "coglab_perception" / "config" / "patterns.json")
        )
        scripts = [
            SOURCES / "coglab_sim" / "scripts" / "perception_stand_in.py",
            SOURCES / "coglab_perception" / "scripts" / "motion_recogniser_node.py",
        ]
        names = ("perception", "motion_recogniser")
        nodes = [
            subprocess.Popen(
                [sys.executable, str(script), "__ns:=played", f"__name:={name}"], stderr=subprocess.PIPE, text=True
            )
            for script, name in zip(scripts, names, strict=True)
        ]
        try:
            self.wait(lambda: any(m.decided and m.pattern == "high" for m in seen), "the recognition of 'high'")
            message = next(m for m in seen if m.decided)
            self.assertAlmostEqual(sum(message.probabilities), 1.0)
            self.assertEqual(list(message.names), ["centre", "high", "left", "right", "unknown"])
            self.wait(lambda: not seen[-1].decided, "the estimate forgets a reach that is over")
            locate = rospy.ServiceProxy("played/perception/locate_object", LocateObject)
            self.assertTrue(locate("played_hand", 60.0).success)
        finally:
            for node in nodes:
                node.terminate()
            errors = [node.communicate(timeout=LIMIT_S)[1] for node in nodes]
        for text in errors:
            self.assertNotIn("Traceback", text)


if __name__ == "__main__":
    rospy.init_node("perception_rostest")
    rostest.rosrun("coglab_sim", "perception", Perception, sys.argv)
