"""Conversion of the robot's messages for the page, without a ROS master."""

import io
from pathlib import Path
from types import SimpleNamespace

import pytest
from coglab_console.ros import view as ros_view
from coglab_console.ros.view import Sources
from coglab_console.scene.urdf_model import RobotModel
from coglab_msgs.msg import (
    ContactSignal,
    ControllerStatus,
    DmpFeedback,
    HandStatus,
    LwrState,
    MasterState,
    PredictedPath,
    ReasonCode,
    Transition,
    UnfinishedPtp,
)
from geometry_msgs.msg import Point, Pose, TransformStamped
from rospy import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage
from topics import Topics

URDF = Path(__file__).resolve().parents[2] / "lwr_description" / "urdf" / "lwr_ih2.urdf"


@pytest.fixture
def seen(monkeypatch):
    """A view with its topics, documents and events."""
    topics, documents, events = Topics(), {}, []
    monkeypatch.setattr(ros_view.rospy, "Subscriber", topics)
    monkeypatch.setattr(ros_view.rospy, "get_time", lambda: 100.0)
    model = RobotModel(URDF.read_text())
    frames = {"human_hand": "human_hand", "board": "board"}
    found = ros_view.RosView(
        model, frames, lambda *words: events.append(words), documents.__setitem__, lambda *_: None, lambda _: None
    )
    found.listen()
    return found, topics.send, documents, events


@pytest.mark.parametrize(
    "power, on", [(0x7F, True), (0xFF, True), (0xFFFF, True), (0x3F, False), (0x80, False), (0, False)]
)
def test_all_drives_are_on_where_each_joint_has_its_bit(seen, power, on):
    """Further bits have other meanings."""
    view, send, _, _ = seen
    send("lwr/state", LwrState(power=power))
    assert view.status()["arm"]["power"] is on


def test_each_time_the_robot_comes_to_stand_is_counted(seen):
    view, send, _, _ = seen
    send("coglab/state", MasterState(state="/coglab_master/stopped", why="hold is latched"))
    assert view.stopped() == (True, "hold is latched", 1)
    send("coglab/state", MasterState(state="/coglab_master/fault", why="no command mode"))
    assert view.stopped() == (True, "no command mode", 2)
    send("lwr/state", LwrState(hold_latched=True))
    send("lwr/state", LwrState(hold_latched=True))
    assert view.stopped()[2] == 3


TOPICS = {
    "brain": ("coglab/state", MasterState()),
    "arm": ("lwr/state", LwrState()),
    "hand": ("ih2_hand/hand_status", HandStatus()),
    "controllers": ("controller_manager/status", ControllerStatus()),
    "contact": ("contact_detector/signal", ContactSignal()),
}


@pytest.mark.parametrize("source", TOPICS)
def test_silent_source_is_reported_within_a_second(seen, monkeypatch, source):
    """The source is still connected, like a frozen program; the others continue."""
    view, send, _, _ = seen
    clock = [1000.0]
    monkeypatch.setattr(ros_view.time, "monotonic", lambda: clock[0])
    view.sources = Sources(lambda: clock[0])
    for _ in range(8):
        for name, (topic, message) in TOPICS.items():
            if name != source or clock[0] < 1000.5:
                send(topic, message)
        assert not view.frame()["silent"] or clock[0] >= 1001.0
        clock[0] += 0.25
    assert list(view.frame()["silent"]) == [source] and view.frame()["silent"][source] > 1.0


def test_values_of_a_silent_arm_are_not_shown_as_new(seen, monkeypatch):
    view, send, _, _ = seen
    clock = [1000.0]
    monkeypatch.setattr(ros_view.time, "monotonic", lambda: clock[0])
    view.sources = Sources(lambda: clock[0])
    send("lwr/state", LwrState())
    send("lwr/fri_latency", Float64(0.001))
    view.tables.latency = view.tables.answer_time = 0.002
    send("joint_states", JointState(name=["lwr_a1"], position=[0.1]))
    assert (view.frame()["fri"], view.frame()["answer"], view.frame()["live"]) == (1.0, 2.0, True)
    clock[0] += 1.0
    # As from joint_state_publisher, which repeats the last positions of a silent arm.
    send("joint_states", JointState(name=["lwr_a1"], position=[0.1]))
    frame = view.frame()
    assert (frame["fri"], frame["answer"], frame["speed"], frame["live"]) == (None, None, None, False)
    assert not view.standing().arm_alive


def test_a_transition_belongs_to_the_phase_that_has_ended(seen):
    view, send, _, events = seen
    path = "/coglab_master/exchange_human_to_robot"
    send("coglab/state", MasterState(state=f"{path}/hand_close"))
    send(
        "coglab/transitions", Transition(path=path, from_state="set_dmp_goal", outcome="succeeded", to_state="approach")
    )
    assert events == [("machine", "now: reaches", "info", "waits until it is offered")]
    reason = "the arm is blocked"
    told = Transition(path=path, from_state="approach", outcome="failed", to_state="recover", reason=reason)
    told.causes = ["hold is latched"]
    send("coglab/transitions", told)
    words = "the arm is blocked, because hold is latched (reaches: failed; now: recovers)"
    assert events[1:] == [("machine", words, "warning", "reaches")]


@pytest.mark.parametrize(
    "code, level",
    [
        (ReasonCode.CANCELLED, "info"),
        (ReasonCode.SUPERSEDED, "info"),
        (ReasonCode.WORKSPACE_BORDER, "warning"),
        (ReasonCode.HELD, "warning"),
    ],
)
def test_requested_end_of_a_motion_is_not_a_warning(seen, code, level):
    """The brain cancels the reach when something touches the hand: that is how an exchange succeeds."""
    view, send, _, events = seen
    send(
        "controller_manager/dmp/feedback",
        DmpFeedback(state="aborted", reason_code=code, reason="something touches the hand"),
    )
    send(
        "controller_manager/ptp/unfinished_ptp", UnfinishedPtp(ptp_id=1, reason_code=code, reason="the weight has come")
    )
    assert [event[2] for event in events] == [level, level]


def tf_of(*children, stamp=100.0):
    """A tf message as raw bytes."""
    frames = [TransformStamped(child_frame_id=child) for child in children]
    for frame in frames:
        frame.header.frame_id, frame.header.stamp = "world", Time(stamp)
        frame.transform.translation.x, frame.transform.rotation.w = 0.5, 1.0
    stream = io.BytesIO()
    TFMessage(frames).serialize(stream)
    return SimpleNamespace(_buff=stream.getvalue())


def test_the_picture_follows_its_frames_beside_a_motion_capture_system(seen):
    """Hundreds of markers, and of joints of other robots, are published first and repeatedly."""
    view, send, _, _ = seen
    view.entry = lambda: {"frame": "object_mug"}
    view.named |= {"object_mug"}
    markers = [f"marker_{number}" for number in range(300)]
    send("joint_states", JointState(name=markers, position=[0.0] * 300))
    for stamp in (98.0, 99.0):
        send("/tf", tf_of(*markers, stamp=stamp))
        send("/tf", tf_of("human_hand", "board", "object_mug", "dmp_goal", stamp=stamp))
    send("joint_states", JointState(name=[*markers, "lwr_a1"], position=[0.0] * 300 + [0.1]))
    frame = view.frame()
    assert frame["ages"] == {"hand": 1.0, "object": 1.0, "board": 1.0, "goal": 1.0} and frame["q"][0] == 0.1
    assert set(view.frames) == {"human_hand", "board", "object_mug", "dmp_goal"}


def path_of(motion, *places):
    found = PredictedPath(motion=motion, times=[0.1 * i for i in range(len(places))])
    found.header.frame_id = "lwr_base_link"
    found.poses = [Pose(position=Point(*place)) for place in places]
    return found


def test_a_path_is_shown_until_its_own_controller_ends_it(seen):
    view, send, documents, _ = seen
    send("controller_manager/dmp/predicted_path", path_of("reach_human", (0.1, 0, 0.3), (0.4, 0, 0.3)))
    assert view.path_runs() and documents["path"]["motion"] == "reach_human" and documents["path"]["kind"] == "running"
    send("controller_manager/ptp/predicted_path", path_of(""))
    assert view.path_runs() and documents["path"] is not None
    send("controller_manager/ptp/predicted_path", path_of("ptp 3", (0.4, 0, 0.3), (0.1, 0, 0.3)))
    send("controller_manager/dmp/predicted_path", path_of(""))
    assert view.path_runs() and documents["path"]["motion"] == "ptp 3"
    send("controller_manager/ptp/predicted_path", path_of(""))
    assert not view.path_runs() and documents["path"] is None


def test_a_path_of_a_controller_that_fell_silent_is_over(seen, monkeypatch):
    view, send, _, _ = seen
    send("controller_manager/dmp/predicted_path", path_of("reach_human", (0.1, 0, 0.3), (0.4, 0, 0.3)))
    later = ros_view.time.monotonic() + 1.5
    monkeypatch.setattr(ros_view.time, "monotonic", lambda: later)
    assert not view.path_runs()


def test_invalid_path_is_not_drawn(seen):
    view, send, _, _ = seen
    elsewhere = path_of("x", (0.1, 0, 0.3), (0.4, 0, 0.3))
    elsewhere.header.frame_id = "somewhere"
    without_times = path_of("x", (0.1, 0, 0.3))
    without_times.times = []
    for path in (elsewhere, without_times, path_of("x"), path_of("x", *[(0.0, 0.0, 0.0)] * 1000)):
        assert view.shown("ahead", path) is None
