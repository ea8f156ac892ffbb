"""The contact detector node without a ROS master: messages, publications, services and learning."""

import importlib.util
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
import rospy
import tf2_ros
import yaml
from arms import SHIPPED, URDF
from coglab_contact.motion_thresholds import Thresholds
from coglab_contact.moving_contact import MotionRecorder
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import ArmContactRequest, LearnMotionRequest
from coglab_py import steady
from coglab_py.packages import package_path
from sensor_msgs.msg import JointState

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "contact_detector_node.py"
JOINTS = [f"j{i}" for i in range(7)]
ZERO = [0.0] * 7
BEGIN, END = LearnMotionRequest(gather=True), LearnMotionRequest(gather=False)


def script():
    spec = importlib.util.spec_from_file_location("contact_detector_node", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Detector:
    """Replaces the FusedDetector and stores its inputs."""

    def __init__(self):
        self.fed, self.holds, self.payload, self.armed = [], False, None, None
        self.seen = SimpleNamespace(state="watching", mode="contact", change=ZERO, threshold=ZERO, watched=[True] * 7)
        self.seen.k, self.seen.margin, self.seen.rest_samples = 6.0, 0.4, 99
        settings = SimpleNamespace(window=0.04, learn_samples=100)
        self.still = SimpleNamespace(settings=settings, learn=lambda: "learning")
        self.pull, self.gone, self.event = None, None, None
        self.share_gone, self.force, self.look = lambda: self.gone, lambda: self.pull, lambda: self.seen
        self.grip = lambda now: 3.0 if now > 5.0 else None
        self.disarm = lambda: self.fed.append("disarm")
        self.set_payload = lambda mass: setattr(self, "payload", mass)

    def __getattr__(self, name):
        if not name.startswith("feed"):
            raise AttributeError(name)
        return lambda *what: self.fed.append((name, *what)) or self.event

    def arm(self, *request):
        if request[0] == "juggle":
            raise ValueError("mode is none")
        self.armed = request


@pytest.fixture
def node(monkeypatch, tmp_path):
    """The node without a ROS master, with a double of the detector. Learning returns the shipped thresholds."""
    module = script()
    frames = yaml.safe_load(package_path("coglab_perception", "config", "frames.yaml").read_text())
    given = {"~learnt_file": str(tmp_path / "learnt.yaml"), "perception/frames": frames}
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: given.get(name, default))
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    for kind in ("Publisher", "Subscriber", "Service"):
        monkeypatch.setattr(rospy, kind, MagicMock())
    monkeypatch.setattr(tf2_ros, "Buffer", MagicMock())
    monkeypatch.setattr(module, "TfListener", MagicMock())
    monkeypatch.setattr(steady, "SteadyTimer", MagicMock())
    monkeypatch.setattr(module, "MovingContact", lambda *_: MagicMock(load=0.0))
    monkeypatch.setattr(module, "FusedDetector", lambda *_, **__: Detector())
    monkeypatch.setattr(MotionRecorder, "learn", lambda self: Thresholds.load(SHIPPED))
    return module.ContactDetectorNode(URDF)


def joints(stamp, position=0.0, velocity=(), effort=(), names=JOINTS):
    message = JointState(name=names, position=[position] * len(names), velocity=list(velocity), effort=list(effort))
    message.header.stamp = rospy.Time.from_sec(stamp)
    return message


@pytest.mark.parametrize(
    ("connected", "holding", "load", "holds", "payload"),
    [
        (True, True, 0.3, True, None),
        (True, False, 0.3, False, 0.0),
        (True, False, 0.0, False, None),
        (False, False, 0.3, False, None),
        (False, True, 0.3, False, None),
    ],
)
def test_an_empty_hand_carries_nothing(node, connected, holding, load, holds, payload):
    node.moving.load = load
    message = SimpleNamespace(connected=connected, holding=holding, motors=["m"], header=joints(1.0).header, _type="x")
    node.on_hand(message)
    assert (node.detector.holds, node.detector.payload) == (holds, payload)
    assert node.detector.fed == [("feed_hand", 1.0, ["m"])]


def request(mode="contact", **fields):
    message = ArmContactRequest(mode=mode, timeout=6.0, k=1.0, joints=[2], mass=0.3, load_share=0.4, **fields)
    message.grasp.orientation.w = 1.0
    return message


def test_arming(node):
    assert node.silent()
    refused = node.on_arm(request())
    assert (refused.success, refused.reason_code) == (False, ReasonCode.NODE_SILENT)
    node.last_sample = 9.5
    for age, silent in ((1.1, True), (0.0, False)):  # on the steady clock: the clock of the stamps may be set
        node.heard = time.monotonic() - age
        assert node.silent() == silent, age
        assert node.on_arm(request()).success is not silent
    for mode, at_once in (("contact", False), ("load", False), ("lift", True)):
        armed = node.on_arm(request(mode))
        assert (armed.success, armed.reason_code, node.detector.armed[0]) == (True, ReasonCode.NONE, mode)
        assert mode in armed.message and "6.0 s" in armed.message and ("now" in armed.message) == at_once
    assert node.detector.armed[:3] == ("lift", 9.5, 6.0) and list(node.detector.armed[4]) == [2]
    assert [round(v, 3) for v in (node.detector.armed[3], *node.detector.armed[5:])] == [1.0, 0.3, 0.4]
    bad = node.on_arm(request("juggle"))
    assert (bad.success, bad.reason_code) == (False, ReasonCode.INVALID_ARGUMENT)
    assert node.on_arm(request(frame="object_mug")).success and node.grasp[0] == "object_mug"
    off = node.on_arm(request("off"))
    assert (off.success, off.message, node.grasp, node.detector.fed) == (True, "off", None, ["disarm"])
    wrong = request(frame="object_mug")
    wrong.grasp.orientation.w = 2.0
    assert node.on_arm(wrong).reason_code == ReasonCode.INVALID_ARGUMENT


def answered(node, request):
    """(success, code, sentence)"""
    answer = node.on_learn_motion(request)
    return answer.success, answer.reason_code, answer.message


def test_learnt_thresholds_are_written_and_used(node):
    assert answered(node, BEGIN)[:2] == (True, ReasonCode.NONE)
    success, code, sentence = answered(node, END)
    assert (success, code) == (True, ReasonCode.NONE) and node.learnt_file in sentence
    assert Thresholds.load(Path(node.learnt_file)).limit == Thresholds.load(SHIPPED).limit
    assert node.moving.use.called and node.recorder is None
    assert answered(node, END)[1] == ReasonCode.NOTHING_RUNS


@pytest.mark.parametrize("place, words", [("", "is a folder"), ("none/learnt.yaml", "does not exist")])
def test_an_unwritable_file_is_refused_before_recording(node, tmp_path, place, words):
    node.learnt_file = str(tmp_path / place)
    success, code, sentence = answered(node, BEGIN)
    assert (success, code, node.recorder) == (False, ReasonCode.BAD_FILE, None)
    assert words in sentence and str(tmp_path) in sentence and "\n" not in sentence


def test_the_recording_is_kept_if_the_file_cannot_be_written(node, tmp_path):
    """The folder was deleted: it can be created again, but the motions cannot be repeated easily."""
    node.learnt_file = str(tmp_path / "gone" / "learnt.yaml")
    (tmp_path / "gone").mkdir()
    answered(node, BEGIN)
    gathering = node.recorder
    (tmp_path / "gone").rmdir()
    success, code, sentence = answered(node, END)
    assert (success, code) == (False, ReasonCode.BAD_FILE) and "call again" in sentence
    assert node.recorder is gathering and not node.moving.use.called
    (tmp_path / "gone").mkdir()
    assert answered(node, END)[:2] == (True, ReasonCode.NONE)
