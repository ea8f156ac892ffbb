#!/usr/bin/python3
"""The node /coglab_sim/perception: stands in for a tracker and for the perception modules.

Subscribes truth/cell (relative name) and broadcasts the tf frames of frames.yaml: human_hand, object_<id>, board.
Serves /perception/init_vision, /perception/locate_object, /perception/free_places.
Parameters (private): settings (mapping, see PerceptionSettings), perfect, seed, frames (mapping of names), board
(xyz m, yaw_deg, slots: name -> [x, y, z] in the board frame).
"""
import sys
import threading
import time

import numpy as np
import rospy
import tf2_ros
from coglab_msgs.msg import CellTruth
from coglab_msgs.srv import (
    FreePlaces,
    FreePlacesResponse,
    InitVision,
    InitVisionResponse,
    LocateObject,
    LocateObjectResponse,
)
from coglab_sim.perception_stand_in import Board, PerceptionSettings, Sight, Tracker
from coglab_sim.rigid import Frame, quat_from_rotvec
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TransformStamped, Vector3

OLDEST = 0.5
"""s: an older sight is no answer to locate_object."""


def frame_of(pose) -> Frame:
    """geometry_msgs/Pose as a Frame."""
    p, q = pose.position, pose.orientation
    return Frame(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


class PerceptionNode:
    """Thin node over Tracker and Board."""

    def __init__(self) -> None:
        settings = dict(rospy.get_param("~settings", {}))
        settings["perfect"] = bool(rospy.get_param("~perfect", settings.get("perfect", False)))
        self.settings = PerceptionSettings.from_mapping(settings)
        self.seed = int(rospy.get_param("~seed", rospy.get_param("/coglab_sim/seed", 7)))
        names = dict(rospy.get_param("~frames", {}))
        self.human_frame = names.get("human_hand", "human_hand")
        self.board_frame = names.get("board", "board")
        self.object_pattern = names.get("object", "object_{id}")
        self.world = names.get("world", "world")
        board = dict(rospy.get_param("~board", {"xyz": [0.45, -0.55, 0.05], "yaw_deg": -90.0,
                                                "slots": {"A1": [0.0, 0.0, 0.0]}}))
        turn = quat_from_rotvec([0.0, 0.0, np.radians(float(board.get("yaw_deg", 0.0)))])
        self.board = Board(Frame(np.array(board["xyz"], dtype=float), turn),
                           {name: np.array(place, dtype=float) for name, place in board["slots"].items()})
        self.lock = threading.Condition()
        self.trackers: dict[str, Tracker] = {}
        self.object_id = ""
        self.truth_stamp = -1e9
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.static = tf2_ros.StaticTransformBroadcaster()
        self.static.sendTransform(self.transform(Sight(self.board_frame, rospy.get_time(), self.board.frame)))
        rospy.Subscriber("truth/cell", CellTruth, self.on_truth, queue_size=1, tcp_nodelay=True)
        rospy.Service("/perception/init_vision", InitVision, self.on_init)
        rospy.Service("/perception/locate_object", LocateObject, self.on_locate)
        rospy.Service("/perception/free_places", FreePlaces, self.on_places)

    def tracker(self, name: str) -> Tracker:
        """The tracker of a frame, made when it is first needed."""
        if name not in self.trackers:
            self.trackers[name] = Tracker(name, self.settings, self.seed)
        return self.trackers[name]

    def on_truth(self, message: CellTruth) -> None:
        """Capture and deliver; the capture time is the time of this node, as a camera's would be."""
        now = rospy.get_time()
        robot = frame_of(message.robot_hand)
        sights = []
        with self.lock:
            self.truth_stamp = time.monotonic()
            self.object_id = message.object_id
            sights += self.tracker(self.human_frame).step(now, frame_of(message.human_hand), robot)
            if message.object_id:
                name = self.object_pattern.format(id=message.object_id)
                sights += self.tracker(name).step(now, frame_of(message.object), robot)
            self.lock.notify_all()
        if sights:
            self.broadcaster.sendTransform([self.transform(s) for s in sights])

    def transform(self, sight: Sight) -> TransformStamped:
        """A sight as a tf message, stamped with its capture time."""
        message = TransformStamped()
        message.header.stamp = rospy.Time.from_sec(sight.captured)
        message.header.frame_id = self.world
        message.child_frame_id = sight.name
        message.transform.translation = Vector3(*sight.frame.position)
        message.transform.rotation = Quaternion(*sight.frame.orientation)
        return message

    def on_init(self, request):
        """Ready once the cell's world is visible."""
        with self.lock:
            if self.lock.wait_for(lambda: time.monotonic() - self.truth_stamp < 0.5, request.timeout):
                return InitVisionResponse(True, "tracker stand-in sees the cell")
        return InitVisionResponse(False, f"the cell was not visible within {request.timeout:.1f} s; is "
                                         "/coglab_sim/cell running?")

    def on_locate(self, request):
        """Newest sight of an object, of the person's hand or of the board, fresh enough; else why not."""
        if request.object_id == self.board_frame:
            response = LocateObjectResponse(success=True, frame_id=self.board_frame, age=0.0)
            response.pose = self.pose(self.world, rospy.get_time(), self.board.frame)
            return response
        if request.object_id == self.human_frame:
            name = self.human_frame
        else:
            name = self.object_pattern.format(id=request.object_id)

        def fresh():
            tracker = self.trackers.get(name)
            return (tracker is not None and tracker.newest is not None
                    and rospy.get_time() - tracker.newest.captured < OLDEST)

        with self.lock:
            if not self.lock.wait_for(fresh, max(0.0, request.timeout)):
                seen = sorted(n for n, t in self.trackers.items() if t.newest is not None)
                return LocateObjectResponse(success=False, message=(
                    f"'{name}' was not seen within {request.timeout:.1f} s; in view: {', '.join(seen) or 'nothing'}"))
            sight = self.trackers[name].newest
        response = LocateObjectResponse(success=True, frame_id=name, age=rospy.get_time() - sight.captured)
        response.pose = self.pose(self.world, sight.captured, sight.frame)
        return response

    def on_places(self, request):
        """Slots without an object on them."""
        with self.lock:
            objects = [t.newest.frame.position for n, t in self.trackers.items()
                       if n != self.human_frame and t.newest is not None
                       and n != self.object_pattern.format(id=request.object_id)]
        names = self.board.free(objects)
        if not names:
            return FreePlacesResponse(False, "no place on the board is free; clear one of "
                                             f"{', '.join(self.board.slots)}", [])
        places = [self.pose(self.board_frame, rospy.get_time(), Frame(self.board.slots[name])) for name in names]
        return FreePlacesResponse(True, ", ".join(names), places)

    @staticmethod
    def pose(parent: str, stamp: float, frame: Frame) -> PoseStamped:
        """PoseStamped of a frame."""
        message = PoseStamped()
        message.header.frame_id = parent
        message.header.stamp = rospy.Time.from_sec(stamp)
        message.pose.position = Point(*frame.position)
        message.pose.orientation = Quaternion(*frame.orientation)
        return message


def main() -> int:
    """Entry point."""
    rospy.init_node("perception")
    try:
        PerceptionNode()
    except (ValueError, TypeError, KeyError) as error:
        rospy.logfatal("perception stand-in: %s", error)
        return 1
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
