#!/usr/bin/python3
"""The node /coglab_sim/truth_markers: shows the true poses of person and object in rviz.

Subscribes truth/cell. Publishes truth/markers (visualization_msgs/MarkerArray, 10 Hz) and truth/tf (tf2_msgs/TFMessage:
frames truth/human_hand, truth/object_<id>, truth/robot_hand). The topic is not /tf, so that control code cannot look
these frames up. Names are relative to the node's namespace. Sizes come from the object's file in the folder of the
parameter cell/objects.
"""

import sys
import time
from pathlib import Path

import numpy as np
import rospy
from coglab_msgs.msg import CellTruth
from coglab_objects.database import ObjectError, cell_parameters, objects_folder, read_object
from coglab_py import parameters
from coglab_py.messages import pose_message, pose_of
from coglab_py.node_start import init_node
from coglab_py.pose import Pose as Frame
from coglab_sim.person.body import arm_of
from coglab_sim.plausible import IMPLAUSIBLE, plausible
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3
from scipy.spatial.transform import Rotation
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

PERIOD = 0.1  # s between two publications
KINDS = {"box": Marker.CUBE, "cylinder": Marker.CYLINDER, "sphere": Marker.SPHERE}
ORANGE, RED, SKIN = (0.90, 0.62, 0.0, 1.0), (0.84, 0.37, 0.0, 1.0), (0.80, 0.58, 0.46, 0.9)
HAND_SIZE = (0.16, 0.09, 0.03)
CLOTH, DARK = (0.35, 0.45, 0.60, 1.0), (0.25, 0.27, 0.30, 1.0)
FLOOR = -0.75  # m, height of the cell's floor in world


class TruthMarkers:
    """Publishes markers of the newest true state at 10 Hz."""

    def __init__(self) -> None:
        self.markers = rospy.Publisher("truth/markers", MarkerArray, queue_size=1, latch=True)
        self.frames = rospy.Publisher("truth/tf", TFMessage, queue_size=1)
        self.due = 0.0
        self.shapes: dict[str, dict] = {}
        rospy.Subscriber("truth/cell", CellTruth, self.on_truth, queue_size=1, tcp_nodelay=True)

    def on_truth(self, truth: CellTruth) -> None:
        """Publishes markers and frames if a publication is due."""
        now = time.monotonic()
        if now < self.due:
            return
        shown = [truth.human_hand, truth.robot_hand, *([truth.object] if truth.object_id else [])]
        if not plausible(map(pose_of, shown)):
            rospy.logwarn_throttle(5.0, f"truth markers: truth/cell ignored: {IMPLAUSIBLE}")
            return
        self.due = now + PERIOD
        array = MarkerArray(markers=[self.hand(truth), *self.person(truth)])
        if truth.object_id:
            array.markers.append(self.object(truth))
        self.markers.publish(array)
        poses = {"human_hand": truth.human_hand, "robot_hand": truth.robot_hand}
        if truth.object_id:
            poses[f"object_{truth.object_id}"] = truth.object
        self.frames.publish(TFMessage([self.transform(truth, name, pose) for name, pose in poses.items()]))

    def marker(self, truth: CellTruth, name: str, kind: int, pose, size, colour) -> Marker:
        """Creates a marker in the frame of the message."""
        marker = Marker(
            ns=name, id=0, type=kind, action=Marker.ADD, pose=pose, scale=Vector3(*size), color=ColorRGBA(*colour)
        )
        marker.header.frame_id = truth.header.frame_id or "world"
        marker.header.stamp = truth.header.stamp
        return marker

    def hand(self, truth: CellTruth) -> Marker:
        """The person's hand: a flat box."""
        return self.marker(truth, "human_hand", Marker.CUBE, truth.human_hand, HAND_SIZE, SKIN)

    def person(self, truth: CellTruth) -> list[Marker]:
        """Arm, trunk, legs and head of the person."""
        p = truth.human_hand.position
        hand = np.array([p.x, p.y, p.z])
        shoulder, elbow = arm_of(hand)
        trunk, head = shoulder + [0.06, -0.20, -0.28], shoulder + [0.04, -0.20, 0.24]
        return [
            self.limb(truth, "forearm", hand, elbow, 0.075, SKIN),
            self.limb(truth, "upper_arm", elbow, shoulder, 0.095, CLOTH),
            self.marker(truth, "trunk", Marker.SPHERE, at(trunk), (0.26, 0.44, 0.68), CLOTH),
            self.limb(truth, "legs", trunk - [0.0, 0.0, 0.2], np.array([*trunk[:2], FLOOR]), 0.26, DARK),
            self.marker(truth, "head", Marker.SPHERE, at(head), (0.19, 0.17, 0.24), SKIN),
        ]

    def limb(self, truth: CellTruth, name: str, end: np.ndarray, begin: np.ndarray, width: float, colour) -> Marker:
        """A cylinder from one joint to the next."""
        along = end - begin
        length = float(np.linalg.norm(along))
        marker = self.marker(truth, name, Marker.CYLINDER, at((begin + end) / 2), (width, width, length), colour)
        x, y, z = along
        # A cylinder lies along z. It is tilted about y by the angle to the vertical, then turned about the vertical.
        turn = Rotation.from_euler("yz", [np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)])
        marker.pose.orientation = Quaternion(*turn.as_quat())
        return marker

    def object(self, truth: CellTruth) -> Marker:
        """The object in its shape, red after it has been dropped."""
        shape = self.shape(truth.object_id)
        middle = pose_message(pose_of(truth.object) * Frame(np.array(shape.get("center", (0.0, 0.0, 0.0)))))
        marker = self.marker(
            truth,
            "object",
            KINDS.get(str(shape.get("shape")), Marker.CUBE),
            middle,
            shape.get("size", (0.08, 0.08, 0.1)),
            RED if truth.dropped else ORANGE,
        )
        return marker

    def shape(self, object_id: str) -> dict:
        """Returns shape, size and centre of an object in the database."""
        if object_id not in self.shapes:
            folder = Path(parameters.read("cell/objects", str, str(objects_folder())))
            try:
                self.shapes[object_id] = cell_parameters(read_object(folder / f"{object_id}.yaml")[0])
            except (ObjectError, ValueError) as error:  # a name that no file can have
                rospy.logwarn("truth markers: '%s' is drawn as a box: %s", object_id, error)
                self.shapes[object_id] = {}
        return self.shapes[object_id]

    @staticmethod
    def transform(truth: CellTruth, name: str, pose) -> TransformStamped:
        """Converts a true pose to the frame truth/<name>."""
        out = TransformStamped(child_frame_id=f"truth/{name}")
        out.header.frame_id = truth.header.frame_id or "world"
        out.header.stamp = truth.header.stamp
        p = pose.position
        out.transform.translation, out.transform.rotation = Vector3(p.x, p.y, p.z), pose.orientation
        return out


def at(point: np.ndarray) -> Pose:
    """Pose at a point (m) without rotation."""
    return Pose(Point(*point), Quaternion(w=1.0))


def main() -> int:
    """Entry point."""
    init_node("truth_markers")
    TruthMarkers()
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
