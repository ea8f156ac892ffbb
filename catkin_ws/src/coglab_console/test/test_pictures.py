"""Data of the drawings: graph with and without Graphviz, kinematics, primitives, path of the next motion, tf bytes."""

import io
import random
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import yaml
from coglab_console.ros import startup
from coglab_console.ros.view import BadBytes, transforms
from coglab_console.scene import path_ahead
from coglab_console.scene.graph_layout import Container, Layout, roots
from coglab_console.scene.primitives import LibraryError, load_library, shape_map
from coglab_console.scene.urdf_model import ModelError, RobotModel, transform
from rospy import Time
from scipy.spatial.transform import Rotation

SOURCES = Path(__file__).resolve().parents[2]
URDF = SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf"
OBJECTS = SOURCES / "coglab_objects" / "objects"
LIBRARY = SOURCES / "coglab_controllers" / "config" / "primitives.xml"
MACHINE = {
    "/M": Container(
        "/M", ("A", "SUB", 'odd "name"\\'), (("ok", "A", "SUB"), ("done", "SUB", 'odd "name"\\'), ("again", "SUB", "A"))
    ),
    "/M/SUB": Container("/M/SUB", ("X", "Y"), (("next", "X", "Y"), ("out", "Y", "None"))),
}


# --- graph ----------------------------------------------------------------------------------------------------


def test_graphviz_lays_nested_machines_out():
    picture = Layout().of(MACHINE)
    assert picture["problem"] == ""
    assert {box["path"] for box in picture["boxes"]} == {"/M", "/M/SUB"}
    assert {node["path"] for node in picture["nodes"]} == {"/M/A", '/M/odd "name"\\', "/M/SUB/X", "/M/SUB/Y"}
    pairs = {(edge["from"], edge["to"]) for edge in picture["edges"]}
    assert ("/M/A", "/M/SUB") in pairs and ("/M/SUB/X", "/M/SUB/Y") in pairs and len(pairs) == 4
    inside = {box["path"]: box["box"] for box in picture["boxes"]}["/M/SUB"]
    x, y, w, h = next(node["box"] for node in picture["nodes"] if node["path"] == "/M/SUB/X")
    assert inside[0] <= x and x + w <= inside[0] + inside[2] and inside[1] <= y and y + h <= inside[1] + inside[3]
    assert roots(MACHINE) == ["/M"]


@pytest.mark.parametrize("dot", ["no-such-program", "/bin/false", "/bin/echo"])
def test_without_graphviz_the_states_are_shown_and_it_is_said(dot):
    picture = Layout(dot).of(MACHINE)
    assert "Graphviz" in picture["problem"]
    assert len(picture["nodes"]) == 5 and picture["edges"] == []


# --- robot ----------------------------------------------------------------------------------------------------


def test_kinematics_against_the_controllers():
    import coglab_controllers as cc

    text = URDF.read_text()
    arm, model = cc.Chain(text), RobotModel(text)
    chance = random.Random(1)
    for _ in range(50):
        q = [chance.uniform(-1.5, 1.5) for _ in range(7)]
        place, turn = arm.fk(np.array(q))
        found = model.place("ih2_palm", dict(zip(arm.joint_names, q, strict=True)))
        assert np.allclose(found[:3, 3], place, atol=1e-9)
        assert abs(abs(np.dot(Rotation.from_matrix(found[:3, :3]).as_quat(), turn)) - 1.0) < 1e-9


def test_the_document_of_the_robot():
    shown = RobotModel(URDF.read_text()).document()
    known = {shown["root"]}
    for joint in shown["joints"]:
        assert joint["parent"] in known
        known.add(joint["child"])
    assert "ih2_palm" in known and len(shown["shapes"]) > 10


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<robot/>",
        "no xml",
        "<robot><link name='a'/><link name='b'/></robot>",
        "<robot><link name='a'/><joint name='j' type='fixed'/></robot>",
    ],
)
def test_invalid_robot_descriptions_are_refused(text):
    with pytest.raises(ModelError):
        RobotModel(text)


# --- primitives -----------------------------------------------------------------------------------------------


def test_roll_out_against_the_controllers():
    import coglab_controllers as cc

    library = cc.Library()
    library.load(str(LIBRARY))
    chance = np.random.default_rng(3)
    for name, one in load_library(LIBRARY).items():
        start = chance.uniform([0.2, -0.3, 0.2], [0.4, 0.3, 0.6])
        goal = start + chance.uniform([0.2, -0.2, -0.1], [0.4, 0.2, 0.2])
        times, points = one.roll_out(start, goal)
        peer_times, peer, _ = cc.Dmp(library[name], position=start, goal=goal).roll_out(goal, times[-1], 0.001)
        peer_times, peer = np.asarray(peer_times), np.asarray(peer)
        expected = np.array([np.interp(times, peer_times, peer[:, axis]) for axis in range(3)]).T
        assert np.abs(points - expected).max() < 0.006, name


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<dmp_library><primitive/></dmp_library>",
        "<dmp_library><primitive id='a'><system/></primitive></dmp_library>",
    ],
)
def test_bad_libraries_are_refused_in_words(tmp_path, text):
    path = tmp_path / "x.xml"
    path.write_text(text)
    with pytest.raises(LibraryError, match="x.xml"):
        load_library(path)


def test_a_shape_is_turned_to_the_line_it_is_for():
    chance = np.random.default_rng(4)
    for mapping in ("similarity", "upright"):
        for _ in range(100):
            before, after = chance.normal(size=3), chance.normal(size=3)
            assert np.allclose(shape_map(mapping, before, after) @ before, after)
    assert np.allclose(shape_map("similarity", np.array([1.0, 0, 0]), np.array([-1.0, 0, 0])) @ [1, 0, 0], [-1, 0, 0])


MUG = {
    "frame": "object_mug",
    "default_grasp": "side",
    "default_delivery": "d",
    "dmp": {"receive": "r", "give": "g", "take": "t"},
    "grasps": {
        "side": {
            "pose": {"xyz": [0.0, -0.04, 0.05], "quaternion": [0.5, 0.5, 0.5, 0.5]},
            "approach": {"axis": [0.0, 1.0, 0.0], "distance": 0.025},
        }
    },
    "deliveries": {"d": {"pose": {"xyz": [-0.1, 0.0, -0.05], "rpy_deg": [0, 0, 0]}}},
}


@pytest.mark.parametrize("name", sorted(path.stem for path in OBJECTS.glob("*.yaml")))
def test_predicted_goal_is_the_one_of_the_brain(name):
    """For every object of the database, and both roles: the goal that the state machines make."""
    from coglab_smach.kinematics.goals import delivery_goal, grasp_goal

    entry = yaml.safe_load((OBJECTS / f"{name}.yaml").read_text())
    grasp = entry["grasps"][entry["default_grasp"]]
    goals = {"exchange_human_to_robot": grasp_goal(entry, grasp, entry["frame"], "receive")}
    if entry.get("default_delivery"):
        delivery = entry["deliveries"][entry["default_delivery"]]
        goals["exchange_robot_to_human"] = delivery_goal(entry, grasp, delivery, "human_hand")
    for action, goal in goals.items():
        asked = path_ahead.aim(action, entry, "human_hand")
        assert (asked["primitive_id"], asked["goal_frame"]) == (goal["primitive"], goal["frame"])
        assert asked["dmp_ratio"] == goal["dmp_ratio"]
        assert np.allclose(asked["goal_offset"], goal["offset"])
        assert np.allclose(asked["target_orientation"], goal["orientation"])


@pytest.mark.parametrize(
    "entry",
    [{}, {"grasps": None}, {**MUG, "frame": None, "dmp": 3}, {**MUG, "grasps": {"side": {"pose": {"xyz": "x"}}}}],
)
def test_unknown_goal_gives_no_path(entry):
    assert path_ahead.aim("take", entry, "human_hand") is None


def test_a_predicted_path_for_the_page():
    from coglab_msgs.msg import PredictedPath
    from geometry_msgs.msg import Point, Pose

    path = PredictedPath(motion="reach_human", times=[0.0, 0.5])
    path.header.stamp = Time(5, 250000000)
    path.poses = [Pose(position=Point(0.1, 0.2, 0.3)), Pose(position=Point(0.4, 0.2, 0.3))]
    base = transform([1.0, 0.0, 0.0], Rotation.from_euler("z", 90, degrees=True))
    shown = path_ahead.document("running", path, base)
    assert shown["points"] == [[0.8, 0.1, 0.3], [0.8, 0.4, 0.3]] and shown["goal"] == shown["points"][-1]
    assert (shown["kind"], shown["motion"], shown["stamp"], shown["times"]) == (
        "running",
        "reach_human",
        5.25,
        [0, 0.5],
    )
    shown = path_ahead.refused("goal frame 'x' is not known; start perception " + 300 * "!")
    assert shown == {"kind": "refused", "reason": "goal frame 'x' is not known", "points": []}
    for frame, words in (
        ("object_tea_box", "tea_box is not seen"),
        ("human_hand", "the hand of the person is not seen"),
    ):
        shown = path_ahead.refused(f"goal frame '{frame}' is not known in 'lwr_base_link': lookupTransform; start it")
        assert shown["reason"] == words


# --- bytes and words ------------------------------------------------------------------------------------------


def test_bytes_against_the_messages_own_decoding():
    from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
    from tf2_msgs.msg import TFMessage

    message = TFMessage()
    for i in range(3):
        one = TransformStamped(child_frame_id=f"child_{i}")
        one.header.frame_id, one.header.stamp = "world", Time(5, 250000000)
        one.transform.translation, one.transform.rotation = Vector3(i, 2, 3), Quaternion(0, 0, 0, 1)
        message.transforms.append(one)
    stream = io.BytesIO()
    message.serialize(stream)
    found = list(transforms(stream.getvalue()))
    assert found[2] == ("world", "child_2", 5.25, (2.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0))


def test_invalid_bytes_are_refused():
    chance = random.Random(6)
    for size in (0, 3, 4, 20, 100):
        for _ in range(200):
            data = bytes(chance.randrange(256) for _ in range(size))
            try:
                list(transforms(data))
            except BadBytes:
                pass
    with pytest.raises(BadBytes):
        list(transforms(struct.pack("<I", 4000000000)))


def test_versions_of_debian_packages_and_of_a_checkout(tmp_path):
    found = startup.debian_versions(("python3-numpy", "no-such-package-here"))
    assert found["python3-numpy"][0].isdigit() and found["no-such-package-here"] == "not installed"
    assert startup.commit(tmp_path) == "unknown"
    (tmp_path / ".git" / "refs" / "heads").mkdir(parents=True)
    (tmp_path / ".git" / "HEAD").write_text("ref: refs/heads/x\n")
    (tmp_path / ".git" / "packed-refs").write_text("# pack\n1234567890abcdef refs/heads/x\n")
    assert startup.commit(tmp_path) == "1234567890"
    (tmp_path / ".git" / "refs" / "heads" / "x").write_text("abcdef1234567890\n")
    assert startup.commit(tmp_path) == "abcdef1234"


def test_health_shows_the_version_of_the_release():
    """That of package.xml, which is one for all packages and the newest of CHANGELOG.md."""
    (newest, *_) = re.findall(r"^## (\d\S*)", (SOURCES.parents[1] / "CHANGELOG.md").read_text(), re.M)
    assert startup.versions()["CogLab"].split(",")[0] == newest
    told = [re.search("<version>(.*)</version>", path.read_text()).group(1) for path in SOURCES.glob("*/package.xml")]
    assert set(told) == {newest}
