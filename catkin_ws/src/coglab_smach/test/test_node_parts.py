"""The brain's two nodes and the objects' tool in parts, without a master: what they make of a message, when they
publish, and what they answer."""

import importlib.util
import json
import math
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
import tf2_ros
from coglab_msgs.msg import ReasonCode
from coglab_msgs.srv import ArmContactRequest
from coglab_objects.database import objects_folder
from coglab_py.pace import Pace
from coglab_py.pose import Pose
from coglab_smach.context.journal import ActionRecord, TransitionRecord
from coglab_smach.context.master_state import MasterState
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Polled, PortError, Ready
from geometry_msgs.msg import Point, Quaternion, TransformStamped
from sensor_msgs.msg import JointState

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
JOINTS = [f"j{i}" for i in range(7)]
ZERO = [0.0] * 7


def script(name):
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Detector:
    """In the place of the FusedDetector: keeps what it is fed with."""

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
def node(monkeypatch):
    """The contact detector's node, without ROS; ``sent``: what it publishes, by publisher."""
    module = script("contact_detector_node")
    made = module.ContactDetectorNode.__new__(module.ContactDetectorNode)
    made.pace, made.last_stamp = Pace(), rospy.Time()
    made.joints, made.position, made.velocity, made.joint_stamp = JOINTS, None, None, 0.0
    made.lock, made.last_sample, made.recorder, made.force_stamp = threading.Lock(), None, None, 0.0
    made.detector, made.base, made.grasp, made.shown = Detector(), "world", None, None
    made.heard = -math.inf
    made.moving = SimpleNamespace(load=0.0, observer=SimpleNamespace(period=0.0))
    made.torques, made.arm = SimpleNamespace(resolved_name="/lwr/external_torques"), default_arm()
    made.sent = []
    for name in ("publisher", "margin", "signal", "force"):
        setattr(made, name, name)
    monkeypatch.setattr(module, "publish", lambda to, message: made.sent.append((to, message)))
    monkeypatch.setattr(rospy, "loginfo", lambda *words: None)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *words: None)
    made.now = 10.0
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time.from_sec(made.now)))
    made.pose_of = module.pose_of
    return made


def joints(stamp, position=0.0, velocity=(), effort=(), names=JOINTS):
    message = JointState(name=names, position=[position] * len(names), velocity=list(velocity), effort=list(effort))
    message.header.stamp = rospy.Time.from_sec(stamp)
    return message


def test_velocities_are_those_of_the_message_or_of_two_positions(node):
    node.on_joints(joints(1.0, 0.1))
    assert node.velocity is None and node.position == [0.1] * 7
    node.on_joints(joints(1.5, 0.2))
    assert node.velocity == pytest.approx([0.2] * 7)
    node.on_joints(joints(1.5, 0.3))
    assert node.velocity is None, "no time has passed"
    node.on_joints(joints(2.0, 0.3, velocity=[0.5] * 7))
    assert node.velocity == [0.5] * 7 and node.detector.fed == []
    for bad in (joints(3.0, 9.0, names=JOINTS[1:]), JointState(name=JOINTS, position=[9.0] * 6)):
        node.on_joints(bad)
        assert node.position == [0.3] * 7
    mixed = joints(4.0, names=[*JOINTS[::-1], "more"])
    mixed.position = [*[float(k) for k in range(7)], 99.0]
    mixed.effort = mixed.position
    node.on_joints(mixed)
    assert node.detector.fed == [("feed_measured", 4.0, [6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0], [6, 5, 4, 3, 2, 1, 0])]


def test_forces_are_told_a_hundred_times_a_second_at_most(node):
    node.detector.pull = np.array([1.0, 2.0, 3.0])
    for stamp in (1.0, 1.005, 1.0085, 1.0095, 1.02, 0.5):
        node.on_joints(joints(stamp, effort=ZERO))
    forces = [message for to, message in node.sent if to == "force"]
    assert [round(f.header.stamp.to_sec(), 4) for f in forces] == [1.0, 1.0095, 1.02, 0.5]
    assert (forces[0].vector.y, forces[0].header.frame_id) == (2.0, "world")
    node.detector.pull = None
    node.on_joints(joints(9.0, effort=ZERO))
    assert len(node.sent) == 4


def test_torques_count_once_the_joints_are_known(node):
    node.on_torques(joints(1.0, effort=ZERO))
    node.position = ZERO
    node.on_torques(joints(1.0, effort=ZERO))
    assert node.detector.fed == [] and node.last_sample is None
    node.velocity = ZERO
    node.on_torques(joints(1.0, effort=[0.0] * 6))
    assert node.last_sample is None
    event = SimpleNamespace(source="s", contact=True, margin=2.0, confidence=0.75, code=5, message="m")
    node.detector.event = event
    node.on_torques(joints(1.0, effort=ZERO))
    ((to, told),) = node.sent
    assert (to, told.source, told.contact, told.margin, told.confidence) == ("publisher", "s", True, 2.0, 0.75)
    assert (told.reason_code, told.message, told.header.stamp.to_sec()) == (5, "m", 1.0) and node.last_sample == 1.0


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


def test_touch_of_fingers_and_palm_and_the_signal_that_fingers_follow(node):
    at = lambda x: SimpleNamespace(x=x, y=0.0, z=1.0)  # noqa: E731
    message = SimpleNamespace(forces=[at(1.0), at(2.0)], palm=at(3.0), deviation=0.05, header=joints(1.0).header)
    node.on_touch(message)
    assert node.detector.fed == [("feed_touch", 1.0, [(1.0, 0.0, 1.0), (2.0, 0.0, 1.0), (3.0, 0.0, 1.0)], 0.05)]
    assert node.sent == []
    node.detector.gone, node.last_sample = 0.0, 1.0
    node.on_touch(message)
    assert [to for to, _ in node.sent] == ["margin", "signal"]
    node.on_state(SimpleNamespace(cycle_time=0.005))
    assert node.moving.observer.period == 0.005


def test_a_signal_is_told_once_for_a_sample_and_every_ten_milliseconds_at_most(node):
    node.publish_signal()
    assert [to for to, _ in node.sent] == ["margin"], "no torques have come"
    for stamp in (6.0, 6.0, 6.005, 6.011):
        node.last_sample, node.last_stamp = stamp, rospy.Time.from_sec(stamp)
        node.publish_signal()
    signals = [message for to, message in node.sent if to == "signal"]
    assert [round(s.header.stamp.to_sec(), 3) for s in signals] == [6.0, 6.011]
    assert (signals[0].margin, signals[0].window, signals[0].k, signals[0].grip) == (0.4, 0.04, 6.0, 3.0)
    assert signals[0].rest_samples == 99 and not signals[0].learnt
    node.detector.seen.rest_samples, node.detector.seen.state, node.last_sample = 100, "off", 3.0
    before = len([to for to, _ in node.sent if to == "margin"])
    node.publish_signal()
    assert node.sent[-1][1].learnt and math.isnan(node.sent[-1][1].grip)
    assert len([to for to, _ in node.sent if to == "margin"]) == before, "it does not watch"


def request(mode="contact", **fields):
    message = ArmContactRequest(mode=mode, timeout=6.0, k=1.0, joints=[2], mass=0.3, load_share=0.4, **fields)
    message.grasp.orientation.w = 1.0
    return message


def test_arming(node):
    assert node.silent()
    refused = node.on_arm(request())
    assert (refused.success, refused.reason_code) == (False, ReasonCode.NODE_SILENT)
    node.last_sample = 9.5
    for age, silent in ((1.1, True), (0.0, False)):  # by the steady clock: that of the stamps may be set
        node.heard = time.monotonic() - age
        assert node.silent() == silent, age
        assert node.on_arm(request()).success is not silent
    for mode, when in (("contact", "once the arm is still"), ("load", "once the arm is still"), ("lift", "now")):
        assert node.on_arm(request(mode)).message == f"watching for {mode} for 6.0 s, {when}"
    assert node.detector.armed[:3] == ("lift", 9.5, 6.0) and list(node.detector.armed[4]) == [2]
    assert [round(v, 3) for v in (node.detector.armed[3], *node.detector.armed[5:])] == [1.0, 0.3, 0.4]
    bad = node.on_arm(request("juggle"))
    assert (bad.success, bad.reason_code, bad.message) == (False, ReasonCode.INVALID_ARGUMENT, "mode is none")
    assert node.on_arm(request(frame="object_mug")).success and node.grasp[0] == "object_mug"
    off = node.on_arm(request("off"))
    assert (off.success, off.message, node.grasp, node.detector.fed) == (True, "off", None, ["disarm"])
    wrong = request(frame="object_mug")
    wrong.grasp.orientation.w = 2.0
    assert node.on_arm(wrong).reason_code == ReasonCode.INVALID_ARGUMENT


@pytest.mark.parametrize(
    ("place", "turn", "good"),
    [
        (0.0, (0.0, 0.0, 0.0, 1.009), True),
        (0.0, (0.0, 0.0, 0.0, 1.011), False),
        (0.0, (0.0, 0.0, 0.0, 0.989), False),
        (math.nan, (0.0, 0.0, 0.0, 1.0), False),
        (0.0, (math.inf, 0.0, 0.0, 1.0), False),
    ],
)
def test_a_pose_has_a_finite_place_and_a_unit_quaternion(node, place, turn, good):
    assert (node.pose_of(Point(place, 1.0, 2.0), Quaternion(*turn)) is not None) == good


@pytest.mark.parametrize(("age", "told"), [(0.14, True), (0.16, False), (-0.16, False)])
def test_a_sight_of_the_object_tells_for_15_hundredths_of_a_second(node, age, told):
    q = np.array([0.0, 0.5, 0.0, 1.0, 0.0, 0.5, 0.0])
    palm = Pose(*default_arm().fk(q))
    transform = TransformStamped()
    transform.header.stamp = rospy.Time.from_sec(10.0 - age)
    place = transform.transform.translation
    place.x, place.y, place.z = palm.position + [0.0, 0.03, 0.0]
    transform.transform.rotation = Quaternion(*palm.orientation)
    node.buffer = SimpleNamespace(lookup_transform=lambda base, frame, at: transform)
    node.look_at_object()
    node.grasp = ("object_mug", Pose())
    node.look_at_object()
    assert node.detector.fed == [], "the joints are not known yet"
    node.position, node.velocity = list(q), [0.1, *[0.0] * 6]
    node.look_at_object()
    assert bool(node.detector.fed) == told
    if told:
        name, stamp, distance, angle, speed = node.detector.fed[0]
        assert (name, stamp) == ("feed_sight", 10.0) and distance == pytest.approx(0.03) and angle < 1e-6
        assert speed == pytest.approx(0.1 * np.hypot(*palm.position[:2]), rel=1e-3)
    node.detector.fed.clear()
    node.buffer.lookup_transform = lambda *a: (_ for _ in ()).throw(tf2_ros.TransformException("none"))
    node.look_at_object()
    assert node.detector.fed == []


def test_what_learning_answers(node):
    assert node.on_learn(None).success and node.on_learn(None).message == "learning"
    node.detector.still.learn = lambda: (_ for _ in ()).throw(ValueError("moves"))
    assert node.on_learn(None).reason_code == ReasonCode.NODE_SILENT
    node.heard = time.monotonic()
    assert node.on_learn(None).reason_code == ReasonCode.BUSY


# --- the master -------------------------------------------------------------------------------------------------------


@pytest.fixture
def master(monkeypatch, tmp_path):
    module = script("master_node")
    made = module.MasterNode.__new__(module.MasterNode)
    made.sent, made.now = [], 100.0
    monkeypatch.setattr(module, "publish", lambda to, message: made.sent.append((to, message)))
    for level in ("loginfo", "logwarn", "logerr"):
        monkeypatch.setattr(rospy, level, lambda *words, level=level: made.sent.append((level, words)))
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time.from_sec(50.0)))
    clock = SimpleNamespace(now=lambda: made.now, sleep=lambda s: setattr(made, "now", made.now + s))
    made.pressed = []
    stop = SimpleNamespace(press=made.pressed.append)
    made.ctx = SimpleNamespace(clock=clock, stop=stop, arm=SimpleNamespace(hold=lambda why: made.hold))
    made.states, made.transitions, made.results, made.spoken = "states", "transitions", "results", "spoken"
    made.result_file = str(tmp_path / "results.jsonl")
    made.stamps = SimpleNamespace(stamp=lambda steady: rospy.Time.from_sec(steady + 1000.0))
    made.module = module
    return made


def test_a_deadline_of_the_steady_clock_is_told_in_the_clock_of_ros(master):
    for deadline, told in ((0.0, 0.0), (103.5, 53.5), (99.0, 50.001)):
        master.on_state(MasterState("s", True, ("a", "b"), "mug", "why", 3, "rain", 4, deadline))
        message = master.sent[-1][1]
        assert message.deadline.to_sec() == pytest.approx(told, abs=1e-6)
    assert (message.state, message.in_hub, message.actions, message.object_id) == ("s", True, ["a", "b"], "mug")
    assert (message.why, message.reason_code, message.waits_for, message.waits_code) == ("why", 3, "rain", 4)


def test_stop_is_latched_whatever_the_arm_answers(master):
    master.hold = Ready("held")
    answer = master.on_stop(None)
    assert answer.success and answer.message == "STOP: held; to go on type: ./coglab start reset"
    master.hold = Polled(lambda: master.now > 101.0, lambda: "held")
    assert master.on_stop(None).success
    master.hold, begin = Polled(lambda: False, lambda: None), master.now
    answer = master.on_stop(None)
    assert not answer.success and "did not answer within 2 s: use the emergency stop" in answer.message
    assert master.now - begin == pytest.approx(2.0, abs=0.006)
    master.hold = Ready(error=PortError("no line"))
    answer = master.on_stop(None)
    assert not answer.success and answer.message == "STOP is latched in the machine, but: no line"
    assert len(master.pressed) == 4


def test_transitions_and_results_are_told_and_written(master):
    for outcome, level in (
        ("succeeded", "loginfo"),
        ("failed", "logwarn"),
        ("fault", "logwarn"),
        ("stopped", "logwarn"),
    ):
        master.on_transition(TransitionRecord(1.0, "/m", "a", outcome, "b", "why", ("c",), 4))
        assert master.sent[-1][0] == level
    told = master.sent[-2][1]
    assert (told.path, told.from_state, told.outcome, told.to_state) == ("/m", "a", "stopped", "b")
    assert (told.reason, list(told.causes), told.reason_code) == ("why", ["c"], 4)
    record = ActionRecord("take", "mug", 1.0, 3.5, "succeeded")
    master.on_result(record)
    master.on_result(record)
    lines = Path(master.result_file).read_text().splitlines()
    row = json.loads(lines[0])  # beside bags, and beside videos and questionnaires
    assert (row["started_ros"], row["ended_ros"]) == (1001.0, 1003.5) and row["ended_utc"] > row["started_utc"]
    assert len(lines) == 2 and row["duration_s"] == 2.5 and master.sent[-1][1].data == lines[0]
    master.result_file = str(Path(master.result_file).parent)
    master.on_result(record)
    assert master.sent[-1][0] == "logerr"
    master.result_file = ""
    master.on_result(record)
    assert master.sent[-1][0] == "results"
    assert ActionRecord("take", "mug", 1.0).to_dict() == {
        **{"kind": "take", "object_id": "mug", "outcome": "", "reason": "", "reason_code": 0, "causes": []},
        **{"started": 1.0, "ended": 0.0, "duration_s": -1.0, "marks": {}},
    }


def test_what_is_held_is_noted_in_one_file_for_each_namespace(master, monkeypatch):
    read = {"~state_file": ""}
    monkeypatch.setattr(master.module.parameters, "read", lambda name, kind, default: read[name])
    monkeypatch.setattr(master.module.rospkg, "get_ros_home", lambda: "/home/ros")
    for namespace, name in (("/", "coglab_holding.json"), ("/two/arms/", "coglab_holding_two_arms.json")):
        monkeypatch.setattr(rospy, "get_namespace", lambda namespace=namespace: namespace)
        assert master.state_file() == f"/home/ros/{name}"
    read["~state_file"] = "own.json"
    assert master.state_file() == "own.json"


@pytest.mark.parametrize("name", ["master_node", "contact_detector_node"])
def test_a_node_that_cannot_be_configured_ends_with_status_1(monkeypatch, name):
    module, said = script(name), []
    monkeypatch.setattr(rospy, "init_node", lambda name: None)
    monkeypatch.setattr(rospy, "spin", lambda: said.append("spin"))
    monkeypatch.setattr(rospy, "logfatal", lambda *words: said.append(words))
    monkeypatch.setattr(module.parameters, "found_above", lambda name, kind: "<robot/>")
    kind = module.MasterNode if name == "master_node" else module.ContactDetectorNode

    def bad(*_):
        raise module.parameters.ParameterError("no")

    monkeypatch.setattr(kind, "__init__", bad)
    assert module.main() == 1 and len(said) == 1
    monkeypatch.setattr(kind, "__init__", lambda *_: None)
    monkeypatch.setattr(kind, "run", lambda self: None, raising=False)
    assert module.main() == 0
    if name == "contact_detector_node":
        monkeypatch.setattr(module.parameters, "found_above", lambda name, kind: None)
        assert module.main() == 1 and "robot_description" in said[-1][0]


# --- objects ----------------------------------------------------------------------------------------------------------


def test_the_objects_tool_tells_by_its_exit_status_how_it_went(monkeypatch, tmp_path, capsys):
    tool = script("object_tool")
    run = lambda *words: (monkeypatch.setattr("sys.argv", ["object_tool", *words]), tool.main())[1]  # noqa: E731
    folder = ("--folder", str(tmp_path))
    assert run("list") == 0 and "mug" in capsys.readouterr().out
    assert run(*folder, "new", "no name!") == 2 and not list(tmp_path.iterdir())
    assert run(*folder, "new", "cup") == 0 and run(*folder, "new", "cup") == 1
    (tmp_path / "bad.yaml").write_text("id: bad\n")
    capsys.readouterr()
    assert run(*folder, "list") == 1 and "bad.yaml" in capsys.readouterr().err
    monkeypatch.setattr(tool, "reachability_report", lambda entry: [("a line", entry["id"] != "mug")])
    assert run(*folder, "check") == 1 and "1 problems" in capsys.readouterr().out
    assert run(*folder, "check", "cup") == 0 and "all fine" in capsys.readouterr().out
    (tmp_path / "mug.yaml").write_text((objects_folder() / "mug.yaml").read_text())
    assert run(*folder, "check", "mug") == 1 and "  a line" in capsys.readouterr().out
    assert run(*folder, "check", "mug", "bad") == 1 and "2 problems" in capsys.readouterr().out
