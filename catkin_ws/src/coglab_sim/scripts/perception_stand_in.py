#!/usr/bin/python3
"""The node /perception: simulates a tracker and the perception modules.

Subscribes coglab_sim/truth/cell and ~people (std_msgs/UInt8, number of people in view). Broadcasts the tf frames of
frames.yaml: human_hand, object_<id>, board. Serves ~init_vision, ~locate_object, ~free_places. It can play recorded
motion: frames of the recording replace those of the cell.

Parameters (private): frames (mapping of frames.yaml), settings (mapping, see PerceptionSettings), perfect, seed, board
(xyz m, yaw_deg, slots: name -> [x, y, z] in the board frame), people (1), others (positions of the other people's
hands, m), partner_margin (m, see PartnerChoice), recording (mapping, see PlaybackSettings; without a file nothing is
played). Names are relative.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import rospy
import tf2_ros
from coglab_msgs.msg import CellTruth
from coglab_perception.frames import FrameNames
from coglab_perception.ros_services import PerceptionServices
from coglab_perception.sights import Board, Sight, slots_of
from coglab_py import parameters, steady
from coglab_py.messages import pose_of
from coglab_py.node_start import init_node
from coglab_py.pose import Pose, about_z
from coglab_sim.person.recorded_motion import Playback, PlaybackSettings
from coglab_sim.plausible import IMPLAUSIBLE, plausible
from coglab_sim.tracker.tracker import PerceptionSettings
from coglab_sim.tracker.vision import Vision
from std_msgs.msg import UInt8

PLAYBACK_HZ = 100.0
OLDEST = 1.0  # s; an older state of the cell, or one of the future, has the stamp of another clock
OTHERS = [[1.05, 0.45, 0.35], [1.05, -0.45, 0.35]]  # m, default of ~others: hands of the other people


class PerceptionNode:
    """ROS interface of Vision and Playback."""

    def __init__(self) -> None:
        names = FrameNames.from_mapping(parameters.read("~frames", dict, {}), rospy.resolve_name("~frames"))
        settings = parameters.read("~settings", dict, {})
        settings["perfect"] = parameters.read("~perfect", bool, settings.get("perfect", False))
        seed = parameters.read("~seed", int, parameters.read("coglab_sim/seed", int, 7))
        board = parameters.read("~board", dict)
        turn = about_z(np.radians(float(board.get("yaw_deg", 0.0))))
        self.vision = Vision(
            names,
            PerceptionSettings.from_mapping(settings),
            Board(
                Pose(np.array(board["xyz"], dtype=float), turn),
                slots_of(board["slots"]),
            ),
            seed,
            time.monotonic,
            parameters.read("~partner_margin", float, 0.0, 0.0),
        )
        self.others = [Pose(np.array(place)) for place in parameters.points("~others", OTHERS)]
        self.people = parameters.read("~people", int, 1, 0, 255)
        self.truth: CellTruth | None = None
        self.last = 0.0  # s, steady time of the newest state
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.static = tf2_ros.StaticTransformBroadcaster()
        self.stamps = steady.Stamps()
        self.services = PerceptionServices(names, self.vision, self.stamps)
        board_sight = Sight(names.board, time.monotonic(), self.vision.board.frame)
        self.static.sendTransform(self.services.transform(board_sight))
        recording = {"frame": names.human_hand, **parameters.read("~recording", dict, {})}
        playback = PlaybackSettings.from_mapping(recording)
        self.playback = None
        if playback.file:
            self.playback = Playback.open(playback, names.world, names.is_tracked)
            rospy.loginfo(
                "perception plays %s: %s, %.1f s",
                playback.file,
                ", ".join(self.playback.names),
                self.playback.recording.duration,
            )
            steady.SteadyTimer(1.0 / PLAYBACK_HZ, self.see, "playback")
        rospy.Subscriber("coglab_sim/truth/cell", CellTruth, self.on_truth, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("~people", UInt8, self.on_people, queue_size=1)

    # -- seeing ----------------------------------------------------------------------------------

    def on_truth(self, message: CellTruth) -> None:
        """Takes the true state of the cell. It was captured when the cell was in it, however late this node runs."""
        seen = [message.human_hand, message.robot_hand, *([message.object] if message.object_id else [])]
        if not plausible(map(pose_of, seen)):
            rospy.logwarn_throttle(5.0, f"perception: truth/cell ignored: {IMPLAUSIBLE}")
            return
        self.truth = message
        if not self.playback:
            self.see(self.captured(message))

    def on_people(self, message: UInt8) -> None:
        """Sets the number of people in view."""
        self.people = message.data
        rospy.loginfo("perception: %d people in view", message.data)

    def captured(self, message: CellTruth) -> float:
        """Steady time (s) of a state of the cell; now if its stamp is of another clock."""
        now = time.monotonic()
        stamp = self.stamps.steady(message.header.stamp)
        self.last = max(self.last, stamp if now - OLDEST < stamp <= now else now)
        return self.last

    def see(self, captured: float | None = None) -> None:
        """Broadcasts the frames in view to tf, with the tracker's errors. ``captured``: steady time (s); None: now."""
        names, truth = self.vision.names, self.truth
        hand, robot, objects = None, None, {}
        if truth is not None:
            hand, robot = pose_of(truth.human_hand), pose_of(truth.robot_hand)
            if truth.object_id:
                objects[names.object_frame(truth.object_id)] = pose_of(truth.object)
        if self.playback:
            played = self.playback.frames(time.monotonic(), robot)
            if names.human_hand in self.playback.names:
                hand = None
            hand = played.pop(names.human_hand, hand)
            objects.update(played)
        crowd = ([hand] if hand is not None else []) + self.others
        hands = {f"person {i + 1}": each for i, each in enumerate(crowd[: self.people])}
        sights = self.vision.see(hands, objects, robot, captured)
        try:
            if sights:
                self.broadcaster.sendTransform([self.services.transform(sight) for sight in sights])
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():
                raise  # during shutdown, rospy has already closed tf


def main() -> int:
    """Entry point. Exit status 1 if the parameters or the recording cannot be used."""
    init_node("perception")
    try:
        PerceptionNode()
    except (ValueError, TypeError, KeyError) as error:
        rospy.logfatal("perception stand-in: %s", error)
        return 1
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
