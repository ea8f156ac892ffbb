#!/usr/bin/python3
"""The perception bridge with a tracker, played from a bag, that has its own frames and topics."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rosbag
import rospy
import rostest
import tf2_ros
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import FreePlaces, InitVision, LocateObject
from coglab_py.steady import wait_for
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

LIMIT = 60.0  # s
TRACKER = (1.0, 0.0, 0.0)  # m, place of the tracker's origin in world
HAND, MUG, BOTTLE, BOARD = (-0.2, 0.1, 0.4), (-0.2, 0.3, 0.2), (-0.55, -0.55, 0.05), (-0.55, -0.55, 0.05)


def transform(stamp, parent, child, place):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, parent, child
    message.transform.translation = Vector3(*place)
    message.transform.rotation = Quaternion(0, 0, 0, 1)
    return message


def stamped(kind, stamp, place, **fields):
    message = kind(**fields)
    message.header.stamp, message.header.frame_id = stamp, "tracker"
    message.pose = Pose(Point(*place), Quaternion(0, 0, 0, 1))
    return message


def write_bag(path):
    """Writes two minutes of a tracker with stamps of years ago."""
    with rosbag.Bag(path, "w") as bag:
        for i in range(3600):
            stamp = rospy.Time.from_sec(1.6e9 + i / 30.0)
            tree = [transform(stamp, "world", "tracker", TRACKER)]
            tree += [transform(stamp, "tracker", "tracker_hand", HAND)]
            tree += [transform(stamp, "tracker", "tracker_board", BOARD)]
            bag.write("/tf", TFMessage(tree), stamp)
            bag.write("/tracker/mug", stamped(PoseStamped, stamp, MUG), stamp)
            bag.write("/tracker/ball", stamped(PoseStamped, stamp, (float("nan"), 0, 0)), stamp)
            markers = [stamped(Marker, stamp, place, ns="things", id=n) for n, place in ((3, MUG), (7, BOTTLE))]
            bag.write("/tracker/markers", MarkerArray(markers), stamp)


class Bridge(unittest.TestCase):
    """In alphabetical order: before the tracker runs, with it, after it."""

    @classmethod
    def setUpClass(cls):
        cls.buffer = tf2_ros.Buffer()
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        cls.services = {}
        for name, kind in (("init_vision", InitVision), ("locate_object", LocateObject), ("free_places", FreePlaces)):
            rospy.wait_for_service(f"perception/{name}", LIMIT)
            cls.services[name] = rospy.ServiceProxy(f"perception/{name}", kind)
        cls.folder = tempfile.TemporaryDirectory()
        cls.bag = Path(cls.folder.name) / "tracker.bag"
        write_bag(str(cls.bag))
        cls.player = None

    @classmethod
    def tearDownClass(cls):
        cls.stop_playing()
        cls.folder.cleanup()

    @classmethod
    def stop_playing(cls):
        """End the player, if it runs."""
        if cls.player is not None and cls.player.poll() is None:
            os.killpg(cls.player.pid, signal.SIGKILL)
            cls.player.wait()

    def play(self):
        """Play the bag."""
        cls = type(self)
        command = ["rosbag", "play", "--quiet", str(self.bag)]
        # In its own process group, because `rosbag play` starts another program.
        cls.player = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
        self.answer("init_vision")

    def answer(self, service, *arguments):
        """The successful answer of a service. Asks again for LIMIT, because a busy computer may see too late."""
        answers = []

        def succeeds():
            answers.append(self.services[service](*arguments, 10.0))
            return answers[-1].success

        self.assertTrue(wait_for(succeeds, LIMIT), answers[-1])
        return answers[-1]

    def locate(self, name):
        answer = self.answer("locate_object", name)
        p = answer.pose.pose.position
        return [round(v, 6) for v in (p.x, p.y, p.z)]

    def test_a_nothing_is_seen_before_the_tracker_runs(self):
        answer = self.services["init_vision"](0.1)
        self.assertEqual((answer.success, answer.reason_code), (False, ReasonCode.NOT_PERCEIVED))
        self.assertIn("tracker", answer.message)

    def test_b_frames_of_the_contract_come_from_tf_topics_and_markers(self):
        self.play()
        self.assertEqual(self.locate("human_hand"), [0.8, 0.1, 0.35])
        self.assertEqual(self.locate("mug"), [0.8, 0.3, 0.2])
        self.assertEqual(self.locate("bottle"), [0.45, -0.55, 0.05])
        self.assertEqual(self.locate("board"), [0.45, -0.55, 0.05])

        def frames():
            return all(
                self.buffer.can_transform("world", frame, rospy.Time(0))
                for frame in ("human_hand", "object_mug", "object_bottle", "board")
            )

        self.assertTrue(wait_for(frames, LIMIT))

    def test_c_a_place_on_the_board_is_free_beside_the_bottle(self):
        answer = self.answer("free_places", "mug")
        self.assertEqual((answer.success, answer.message), (True, "A2"))

    def test_d_invalid_poses_are_dropped(self):
        answer = self.services["locate_object"]("ball", 0.2)
        self.assertEqual((answer.success, answer.reason_code), (False, ReasonCode.OBJECT_NOT_SEEN))
        self.assertFalse(self.buffer.can_transform("world", "object_ball", rospy.Time(0)))

    def test_e_stopped_tracker_has_no_frames_in_view(self):
        self.stop_playing()
        for each in ("mug", "human_hand"):
            self.assertTrue(wait_for(lambda e=each: not self.services["locate_object"](e, 0.0).success, LIMIT), each)
        answer = self.services["locate_object"]("human_hand", 0.0)
        self.assertEqual((answer.success, answer.reason_code), (False, ReasonCode.OBJECT_NOT_SEEN))


if __name__ == "__main__":
    rospy.init_node("bridge_rostest")
    rostest.rosrun("coglab_perception", "bridge", Bridge, sys.argv)
