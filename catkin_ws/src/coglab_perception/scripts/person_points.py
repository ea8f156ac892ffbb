#!/usr/bin/python3
"""The node /person_points: publishes the person's position, for the manager SafeDistance.

Publishes person/<frame> (geometry_msgs/PoseStamped, in the base frame of the arm) for each tracked frame of the person
in tf, at each new sight of the tracker, stamped with the time of capture. Parameters (private): frames (names; the
default is the person's hand of the perception contract), base (frame of the arm's base, lwr_base_link).
"""

from __future__ import annotations

import re
import sys

import rospy
import tf2_ros
from coglab_perception.frames import FrameNames
from coglab_perception.tf_listener import TfListener
from coglab_py import parameters, steady
from coglab_py.node_start import init_node
from geometry_msgs.msg import Point, PoseStamped

NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")  # frames whose name can be part of a topic's name
PERIOD = 0.01  # s between two reads of tf
QUIET = 10.0  # s between two warnings about the same frame


class PersonPointsNode:
    """Converts tf frames to the topics in the robot's signals file."""

    def __init__(self) -> None:
        names = FrameNames.from_mapping(
            parameters.read("perception/frames", dict, {}), rospy.resolve_name("perception/frames")
        )
        self.base = parameters.read("~base", str, "lwr_base_link")
        frames = rospy.get_param("~frames", [names.human_hand])
        good = isinstance(frames, list) and frames
        if not good or not all(isinstance(frame, str) and NAME.fullmatch(frame) for frame in frames):
            raise ValueError(
                f"{rospy.resolve_name('~frames')}: expected tf frames of letters, digits and '_', got {frames!r}"
            )
        self.points = {
            frame: rospy.Publisher(f"person/{frame}", PoseStamped, queue_size=1, tcp_nodelay=True) for frame in frames
        }
        self.last: dict[str, rospy.Time] = {}
        self.buffer = tf2_ros.Buffer(rospy.Duration(2.0))
        self.listener = TfListener(self.buffer, names.world)
        steady.SteadyTimer(PERIOD, self.look, "tf")

    def look(self) -> None:
        """Publishes new transforms."""
        for frame, topic in self.points.items():
            try:
                seen = self.buffer.lookup_transform(self.base, frame, rospy.Time(0))
            except tf2_ros.TransformException:
                text = f"tf does not know '{frame}' in '{self.base}' yet: the tracker does not see the person"
                rospy.loginfo_throttle(QUIET, f"person_points: {text}")
                continue
            if seen.header.stamp == self.last.get(frame):
                continue
            self.last[frame] = seen.header.stamp
            message = PoseStamped(header=seen.header)
            p = seen.transform.translation
            message.pose.position = Point(p.x, p.y, p.z)
            message.pose.orientation = seen.transform.rotation
            topic.publish(message)


def main() -> int:
    """Entry point. Exit status 1 if the parameters cannot be used."""
    init_node("person_points")
    try:
        PersonPointsNode()
    except ValueError as error:
        rospy.logfatal("person_points: %s", error)
        return 1
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
