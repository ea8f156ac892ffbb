"""True state in rviz: frames, the person's body, shape of the object, rate."""

import numpy as np
import pytest
from coglab_msgs.msg import CellTruth
from coglab_sim.person.scene import shipped
from geometry_msgs.msg import Point, Pose, Quaternion
from ros_double import RosDouble, script
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker

ROBOT, HAND, MUG = (0.5, 0.0, 0.4), (0.9, 0.1, 0.45), (0.82, 0.1, 0.40)


def pose(place, turn=(0, 0, 0, 1)):
    return Pose(Point(*place), Quaternion(*turn))


def truth(object_id="mug", frame="", **fields):
    message = CellTruth(object_id=object_id, object=pose(MUG), human_hand=pose(HAND), robot_hand=pose(ROBOT), **fields)
    message.header.frame_id, message.header.stamp.secs = frame, 7
    return message


class Shown:
    """The node, whose clock the test sets."""

    def __init__(self, monkeypatch, **parameters):
        self.ros = RosDouble(monkeypatch, **parameters)
        self.module = script("truth_markers")
        self.clock = 100.0
        monkeypatch.setattr(self.module.time, "monotonic", lambda: self.clock)
        self.node = self.module.TruthMarkers()

    def show(self, message):
        """Markers by name, and frames by child; empty if nothing was published."""
        before = len(self.ros.published["truth/markers"])
        self.ros.subscribed["truth/cell"](message)
        if len(self.ros.published["truth/markers"]) == before:
            return {}, {}
        markers = {marker.ns: marker for marker in self.ros.published["truth/markers"][-1].markers}
        return markers, {each.child_frame_id: each for each in self.ros.published["truth/tf"][-1].transforms}


@pytest.fixture
def shown(monkeypatch):
    return Shown(monkeypatch)


def place(marker):
    return np.array([marker.pose.position.x, marker.pose.position.y, marker.pose.position.z])


def size(marker):
    return (marker.scale.x, marker.scale.y, marker.scale.z)


def test_frames_of_the_truth_have_names_of_their_own(shown):
    _, frames = shown.show(truth(frame="map"))
    assert sorted(frames) == ["truth/human_hand", "truth/object_mug", "truth/robot_hand"]
    for name, where in (("human_hand", HAND), ("robot_hand", ROBOT), ("object_mug", MUG)):
        frame = frames[f"truth/{name}"]
        found = frame.transform.translation
        assert (found.x, found.y, found.z) == where and frame.header.frame_id == "map"
        assert frame.header.stamp.to_sec() == 7.0 and frame.transform.rotation.w == 1.0
    shown.clock += 1.0
    markers, frames = shown.show(truth(object_id=""))
    assert sorted(frames) == ["truth/human_hand", "truth/robot_hand"] and "object" not in markers
    assert frames["truth/robot_hand"].header.frame_id == "world"


@pytest.mark.parametrize("wrong", [float("nan"), 1e9])
def test_implausible_truth_is_not_shown(shown, wrong):
    message = truth()
    message.object.position.x = wrong
    assert shown.show(message) == ({}, {}) and "truth/cell ignored" in shown.ros.said[0]
    message.object_id = ""
    assert shown.show(message)[0], "no object, no fault in it"


@pytest.mark.parametrize("name, kind", [("mug", Marker.CYLINDER), ("ball", Marker.SPHERE), ("tea_box", Marker.CUBE)])
def test_an_object_has_its_shape_about_its_middle(shown, name, kind):
    turned = Rotation.from_rotvec([0.0, np.pi / 2, 0.0]).as_quat()
    message = truth(name)
    message.object = pose(MUG, turned)
    marker = shown.show(message)[0]["object"]
    large = shipped(name)["size"]
    assert marker.type == kind and size(marker) == pytest.approx(large)
    assert place(marker) == pytest.approx(np.array(MUG) + [large[2] / 2, 0.0, 0.0])
