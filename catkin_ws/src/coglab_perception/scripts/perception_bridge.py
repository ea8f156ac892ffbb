#!/usr/bin/python3
"""The node /perception for a real tracker: publishes its poses as the frames of the perception contract.

Subscribes tf and the topics of the mapping file. Broadcasts human_hand, object_<id> and board in ``world``, stamped
with the time of capture. Serves ~init_vision, ~locate_object, ~free_places. Poses that are too old, not finite, from
the future, or in a frame that does not reach ``world`` are dropped, with a warning at most every 5 s per frame.

Parameters: perception/frames (mapping of frames.yaml); private: mapping (file, see config/perception_bridge.yaml).
"""

from __future__ import annotations

import sys
import threading
import time
from functools import partial
from typing import Any

import numpy as np
import rospy
import tf2_ros
from coglab_msgs.srv import ListObjects
from coglab_perception.frames import CLOCK_TOLERANCE, FrameNames
from coglab_perception.ros_services import PerceptionServices
from coglab_perception.sights import Board, Sight, Sights
from coglab_perception.tf_listener import TfListener
from coglab_perception.tracker_mapping import Source, TrackerMapping, usable
from coglab_py import parameters, steady
from coglab_py.messages import pose_of
from coglab_py.node_start import init_node
from coglab_py.pose import Pose
from geometry_msgs.msg import PoseStamped
from visualization_msgs.msg import Marker, MarkerArray

TF_PERIOD = 0.01  # s between two reads of the tracker's tf frames
DATABASE_WAIT = 60.0  # s
QUIET = 5.0  # s between two warnings about the same frame
BOARD_MOVED = 1e-3  # m and rad; a board that moves more is broadcast again


class BridgeNode:
    """ROS interface of Sights for a tracker."""

    def __init__(self) -> None:
        self.names = FrameNames.from_mapping(
            parameters.read("perception/frames", dict, {}), rospy.resolve_name("perception/frames")
        )
        path = parameters.read("~mapping", str, "")
        if not path:
            raise ValueError(f"{rospy.resolve_name('~mapping')} is not set: give the path of a mapping file")
        self.mapping = TrackerMapping.load(path, self.names)
        self.sights = Sights(self.names, time.monotonic)
        self.stamps = steady.Stamps()
        self.services = PerceptionServices(self.names, self, self.stamps)
        self.buffer = tf2_ros.Buffer(rospy.Duration(2.0))
        self.listener = TfListener(self.buffer, self.names.world)
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.static = tf2_ros.StaticTransformBroadcaster()
        self._captured: dict[str, float] = {}  # s, by frame: capture of the newest published pose
        self._tf_stamps: dict[str, float] = {}  # s, by frame: newest stamp of its tf frame
        self._warned: dict[str, float] = {}
        markers: dict[str, list[Source]] = {}
        for source in self.mapping.sources:
            if source.type == "PoseStamped":
                rospy.Subscriber(
                    source.topic, PoseStamped, partial(self.on_pose, source), queue_size=5, tcp_nodelay=True
                )
            elif source.type == "MarkerArray":
                markers.setdefault(source.topic, []).append(source)
        for topic, sources in markers.items():
            rospy.Subscriber(topic, MarkerArray, partial(self.on_markers, sources), queue_size=5, tcp_nodelay=True)
        threading.Thread(target=self.name_unknown_objects, daemon=True).start()
        self._tf_sources = [source for source in self.mapping.sources if source.tf]
        steady.SteadyTimer(TF_PERIOD, self.look_at_tf, "tf")

    def name_unknown_objects(self) -> None:
        """Warn of objects in the mapping that the object database does not have."""
        try:
            known = steady.call_service("object_database/list_objects", ListObjects, wait=DATABASE_WAIT).object_ids
        except (rospy.ROSException, rospy.ServiceException):  # no database: perception alone
            return
        frames = {self.names.object_frame(each) for each in known}
        for source in self.mapping.sources:
            if source.frame not in frames | {self.names.human_hand, self.names.board}:
                rospy.logwarn(
                    f"{source.frame} of the mapping belongs to no object of the database; it has: {', '.join(known)}"
                )

    # -- seeing ----------------------------------------------------------------------------------

    def on_pose(self, source: Source, message: PoseStamped) -> None:
        """Takes a pose of the tracker."""
        self._take(source, message.header.frame_id, message.header.stamp, pose_of(message.pose))

    def on_markers(self, sources: list[Source], message: MarkerArray) -> None:
        """Takes the markers that the mapping names."""
        found = {(marker.ns, marker.id): marker for marker in message.markers if marker.action == Marker.ADD}
        for source in sources:
            marker = found.get(source.marker)  # type: ignore[arg-type]
            if marker is not None:
                self._take(source, marker.header.frame_id, marker.header.stamp, pose_of(marker.pose))

    def look_at_tf(self) -> None:
        """Takes the newest poses of the tracker's tf frames."""
        for source in self._tf_sources:
            try:
                seen = self.buffer.lookup_transform(self.names.world, source.tf, rospy.Time(0))
            except tf2_ros.TransformException as error:
                self._warn(source.frame, f"tf does not know '{source.tf}' in '{self.names.world}': {error}")
                continue
            stamp = seen.header.stamp
            if stamp.is_zero():  # static: always current
                stamp = rospy.Time.now()
            elif stamp.to_sec() == self._tf_stamps.get(source.frame):
                continue
            self._tf_stamps[source.frame] = stamp.to_sec()
            self._pass_on(source, stamp, _pose_of(seen.transform))

    def _take(self, source: Source, parent: str, stamp: rospy.Time, pose: Pose) -> None:
        if not usable(pose):
            self._warn(source.frame, "a pose is not finite, or its quaternion is not of unit length")
            return
        parent = parent.lstrip("/") or self.names.world
        if parent != self.names.world:
            try:
                seen = self.buffer.lookup_transform(self.names.world, parent, rospy.Time(0)).transform
            except tf2_ros.TransformException as error:
                self._warn(source.frame, f"tf does not know '{parent}' in '{self.names.world}': {error}")
                return
            pose = _pose_of(seen) * pose
        self._pass_on(source, stamp, pose)

    def _pass_on(self, source: Source, stamp: rospy.Time, pose: Pose) -> None:
        now = time.monotonic()
        captured = self.mapping.captured(self.stamps.steady(stamp), now)
        if captured > now + CLOCK_TOLERANCE:
            self._warn(source.frame, f"a pose is {captured - now:.2f} s from the future; use stamp: arrival")
            return
        if now - captured > source.largest_age:
            age = (
                "has no stamp"
                if stamp.is_zero()
                else f"is {now - captured:.2f} s old, at most {source.largest_age:g} s"
            )
            self._warn(
                source.frame, f"the newest pose {age}; a tracker without this computer's clock needs stamp: arrival"
            )
            return
        if captured <= self._captured.get(source.frame, 0.0):
            return
        self._captured[source.frame] = captured
        sight = Sight(source.frame, captured, pose * source.offset)
        if sight.name == self.names.board:
            self._see_board(sight, not source.is_there)
        elif not source.is_there:
            self.broadcaster.sendTransform(self.services.transform(sight))
        self.sights.add([sight])

    def _see_board(self, sight: Sight, broadcast: bool) -> None:
        """Broadcasts the board when it is first seen and when it has moved."""
        known = self.sights.board
        if known is None or max(known.frame.distance(sight.frame)) > BOARD_MOVED:
            self.sights.board = Board(sight.frame, self.mapping.slots)
            if broadcast:
                self.static.sendTransform(self.services.transform(sight))

    def _warn(self, frame: str, text: str) -> None:
        now = time.monotonic()
        if now - self._warned.get(frame, -QUIET) >= QUIET:
            self._warned[frame] = now
            rospy.logwarn("perception bridge: %s: %s", frame, text)

    # -- queries ---------------------------------------------------------------------------------

    def init_vision(self, timeout: float) -> str:
        """Waits until the tracker delivers a pose; returns what is in view. Raises NotSeen."""
        self.sights.wait_until_it_works(timeout, "any frame of the mapping")
        return f"in view: {', '.join(self.sights.in_view())}"

    def locate(self, target: str, timeout: float) -> tuple[str, Sight, float]:
        """See Sights."""
        return self.sights.locate(target, timeout)

    def free_places(self, object_id: str, timeout: float) -> list[tuple[str, np.ndarray]]:
        """Returns the free places once the tracker works. Raises NotSeen."""
        self.sights.wait_until_it_works(timeout, "the board")
        return self.sights.free_places(object_id)


def _pose_of(transform: Any) -> Pose:
    """Converts geometry_msgs/Transform."""
    p, q = transform.translation, transform.rotation
    return Pose(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def main() -> int:
    """Entry point. Exit status 1 if the parameters or the mapping cannot be used."""
    init_node("perception")
    try:
        BridgeNode()
    except ValueError as error:
        rospy.logfatal("perception bridge: %s", error)
        return 1
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
