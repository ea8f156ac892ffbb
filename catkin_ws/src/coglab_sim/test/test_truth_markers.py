"""What rviz is shown of the truth: frames, the person's body, the object in its shape, and how often."""

import math

import numpy as np
import pytest
from coglab_msgs.msg import CellTruth
from coglab_sim.person.scene import shipped
from geometry_msgs.msg import Point, Pose, Quaternion
from node_alone import Alone, script
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
        self.ros = Alone(monkeypatch, **parameters)
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


def colour(marker):
    return (marker.color.r, marker.color.g, marker.color.b, marker.color.a)


def test_ten_times_a_second_and_latched(shown):
    shown.clock = 0.0
    assert shown.show(truth())[0], "the first one at once"
    for now, published in ((0.05, False), (0.099, False), (0.1, True), (0.15, False), (0.3, True)):
        shown.clock = now
        assert bool(shown.show(truth())[0]) is published, now
    assert shown.ros.made["truth/markers"]["latch"] is True and "latch" not in shown.ros.made["truth/tf"]


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
def test_what_cannot_be_true_is_not_shown(shown, wrong):
    message = truth()
    message.object.position.x = wrong
    assert shown.show(message) == ({}, {}) and "truth/cell ignored" in shown.ros.said[0]
    message.object_id = ""
    assert shown.show(message)[0], "no object, no fault in it"


def test_the_person_from_hand_to_head(shown):
    markers, _ = shown.show(truth())
    assert list(markers) == ["human_hand", "forearm", "upper_arm", "trunk", "legs", "head", "object"]
    skin, cloth, dark = (0.80, 0.58, 0.46, 0.9), (0.35, 0.45, 0.60, 1.0), (0.25, 0.27, 0.30, 1.0)
    shoulder, elbow = shown.module.arm_of(np.array(HAND))
    trunk, head = shoulder + [0.06, -0.20, -0.28], shoulder + [0.04, -0.20, 0.24]
    legs = (trunk - [0, 0, 0.2] + [*trunk[:2], -0.75]) / 2
    for name, kind, where, large, shade in (
        ("human_hand", Marker.CUBE, HAND, (0.16, 0.09, 0.03), skin),
        ("forearm", Marker.CYLINDER, (np.array(HAND) + elbow) / 2, (0.075, 0.075, 0.36), skin),
        ("upper_arm", Marker.CYLINDER, (elbow + shoulder) / 2, (0.095, 0.095, 0.33), cloth),
        ("trunk", Marker.SPHERE, trunk, (0.26, 0.44, 0.68), cloth),
        ("legs", Marker.CYLINDER, legs, (0.26, 0.26, trunk[2] - 0.2 + 0.75), dark),
        ("head", Marker.SPHERE, head, (0.19, 0.17, 0.24), skin),
    ):
        marker = markers[name]
        assert (marker.type, marker.id, marker.action) == (kind, 0, Marker.ADD), name
        assert place(marker) == pytest.approx(where) and size(marker) == pytest.approx(large), name
        assert colour(marker) == shade and marker.header.frame_id == "world", name


def test_limbs_point_from_joint_to_joint(shown):
    for begin, end in (((0, 0, 0), (0.3, 0.1, 0.2)), ((1, 0, 0), (0.5, -0.4, -0.6)), ((0, 0, 1), (0, 0, 0))):
        limb = shown.node.limb(
            truth(), "x", np.array(end, dtype=float), np.array(begin, dtype=float), 0.1, (1, 1, 1, 1)
        )
        q = limb.pose.orientation
        along = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply([0.0, 0.0, 1.0])
        way = np.array(end, dtype=float) - begin
        assert along == pytest.approx(way / np.linalg.norm(way), abs=1e-9)
        assert limb.scale.z == pytest.approx(np.linalg.norm(way))


SHOULDER = np.array([1.42, 0.20, 0.50])


@pytest.mark.parametrize("hand", [(1.0, 0.1, 0.3), (0.9, 0.3, 0.6), (1.4, 0.1, 0.2), (0.2, 0.0, 0.4)])
def test_an_arm_has_its_lengths_and_its_elbow_hangs(shown, hand):
    hand = np.array(hand)
    shoulder, elbow = shown.module.arm_of(hand)
    assert np.linalg.norm(elbow - hand) == pytest.approx(0.36)
    assert np.linalg.norm(shoulder - elbow) == pytest.approx(0.33)
    distance = np.linalg.norm(SHOULDER - hand)
    assert np.linalg.norm(shoulder - hand) == pytest.approx(min(distance, 0.98 * 0.69))
    if distance < 0.98 * 0.69:
        assert shoulder == pytest.approx(SHOULDER)
    else:
        assert (shoulder - hand) / np.linalg.norm(shoulder - hand) == pytest.approx((SHOULDER - hand) / distance)
    axis = (shoulder - hand) / np.linalg.norm(shoulder - hand)
    aside = elbow - hand - ((elbow - hand) @ axis) * axis
    assert aside[2] <= 1e-9 and np.cross(aside, axis)[2] == pytest.approx(0.0, abs=1e-9)


def test_a_hand_at_the_shoulder_has_an_arm_all_the_same(shown):
    for hand in (SHOULDER, SHOULDER + [0.0, 0.0, 0.3], SHOULDER + [1e-7, 0.0, 0.0]):
        assert np.all(np.isfinite(shown.module.arm_of(hand.copy())))


@pytest.mark.parametrize("name, kind", [("mug", Marker.CYLINDER), ("ball", Marker.SPHERE), ("tea_box", Marker.CUBE)])
def test_an_object_has_its_shape_about_its_middle(shown, name, kind):
    turned = Rotation.from_rotvec([0.0, np.pi / 2, 0.0]).as_quat()
    message = truth(name)
    message.object = pose(MUG, turned)
    marker = shown.show(message)[0]["object"]
    large = shipped(name)["size"]
    assert marker.type == kind and size(marker) == pytest.approx(large)
    assert place(marker) == pytest.approx(np.array(MUG) + [large[2] / 2, 0.0, 0.0])
    assert colour(marker) == (0.90, 0.62, 0.0, 1.0)
    shown.clock += 1.0
    message.dropped = True
    assert colour(shown.show(message)[0]["object"]) == (0.84, 0.37, 0.0, 1.0), "it has fallen"


def test_an_object_without_a_file_is_a_box_and_said_once(shown):
    for _ in range(2):
        marker = shown.show(truth("elephant"))[0]["object"]
        assert marker.type == Marker.CUBE and size(marker) == (0.08, 0.08, 0.1) and place(marker) == pytest.approx(MUG)
        shown.clock += 1.0
    assert len(shown.ros.said) == 1 and "truth markers: 'elephant' is drawn as a box" in shown.ros.said[0]
    assert shown.show(truth("../x"))[0]["object"].type == Marker.CUBE


def test_files_come_from_the_cells_folder(monkeypatch, tmp_path):
    shown = Shown(monkeypatch, cell__objects=str(tmp_path))
    assert shown.show(truth("mug"))[0]["object"].type == Marker.CUBE and str(tmp_path) in shown.ros.said[0]
    assert math.isclose(shown.module.PERIOD, 0.1)
