"""The recorder without a ROS master: what it keeps, writes, and does when the disk is full."""

import json
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest
import rosbag
import rospy
from coglab_msgs.msg import MasterState, ReasonCode
from coglab_tools.command import CheckFailed
from coglab_tools.trial import recorder as module
from coglab_tools.trial.bag import series_of
from coglab_tools.trial.explain import explain
from coglab_tools.trial.record import BAG, TrialRecord, find_trial, trials_in
from coglab_tools.trial.recorder import Memory, Recorder, Stored
from std_msgs.msg import Float64, String

RESULT = {
    "kind": "exchange_human_to_robot",
    "object_id": "mug",
    "outcome": "succeeded",
    "reason": "",
    "reason_code": 0,
    "causes": [],
    "started": 50.0,
    "ended": 53.0,
    "started_ros": 1000.0,
    "ended_ros": 1003.0,
    "marks": {"contact": 52.0, "offered": 51.0},
}


def stored(topic: str, time: float, message: object, latching: str = "0") -> Stored:
    stream = BytesIO()
    message.serialize(stream)
    header = {"type": message._type, "md5sum": message._md5sum, "message_definition": message._full_text}
    header |= {"latching": latching, "callerid": "/maker", "topic": topic}
    return Stored(topic, rospy.Time.from_sec(time), stream.getvalue(), header)


@pytest.fixture
def made(tmp_path, monkeypatch) -> tuple[Recorder, Memory]:
    settings = {"coglab_sim": {"cell": {"seed": 7}}, "trial": {"condition": "calm", "participant": "P03"}}
    monkeypatch.setattr(rospy, "get_param", lambda _name: settings | {"robot_description": "long"})
    monkeypatch.setattr(rospy, "get_namespace", lambda: "/")
    rospy.rostime.set_rostime_initialized(True)
    memory = Memory(5.0)
    return Recorder(tmp_path / "trials", memory, post_roll=1.0), memory


def handover(recorder: Recorder, memory: Memory, result: dict) -> None:
    memory.take(stored("/latched", 900.0, String("still true"), latching="1"))
    for t in range(990, 1000):
        memory.take(stored("/number", float(t), Float64(t)))
    recorder.state(MasterState(in_hub=True))
    recorder.step(0.0)
    recorder.state(MasterState(in_hub=False))
    recorder.step(0.1)
    for t in range(1000, 1004):
        memory.take(stored("/number", float(t), Float64(t)))
        recorder.step(t - 999.0)
    recorder.result(String(json.dumps(result)))
    recorder.step(5.0)
    memory.take(stored("/number", 1003.5, Float64(1003.5)))
    recorder.step(6.0)
    recorder.step(7.0)


def test_a_handover_leaves_a_bag_with_pre_roll_and_a_record(made) -> None:
    recorder, memory = made
    handover(recorder, memory, RESULT)
    (place,) = trials_in(recorder.folder)
    assert [each.name for each in recorder.folder.iterdir()] == [place.name], "nothing half done is left"
    record = TrialRecord.load(place)
    assert place.name == record.id == "19700101T001640_exchange_human_to_robot_mug"
    assert (record.success, record.duration_s, record.object, record.seed) == (True, 3.0, "mug", 7)
    assert (record.participant, record.condition, record.simulated) == ("P03", "calm", True)
    assert [(m["name"], m["time_s"]) for m in record.marks] == [("offered", 1.0), ("contact", 2.0)]
    assert "robot_description" not in record.configuration and len(record.configuration_hash) == 16
    with rosbag.Bag(str(place / BAG)) as bag:
        found = [(topic, message.data) for topic, message, _ in bag.read_messages()]
    assert ("/latched", "still true") in found
    assert [data for topic, data in found if topic == "/number"] == [*map(float, range(994, 1004)), 1003.5]
    assert find_trial(str(place)) == place
    handover(recorder, memory, RESULT | {"started_ros": 2000.0, "ended_ros": 2003.0})
    assert len(list(trials_in(recorder.folder))) == 2


def test_a_failure_is_explained(made) -> None:
    recorder, memory = made
    because = {"outcome": "failed_empty", "reason": "the goal is lost", "reason_code": ReasonCode.GOAL_LOST}
    handover(recorder, memory, RESULT | because | {"causes": ["the tracker is silent"]})
    (place,) = trials_in(recorder.folder)
    lines = explain(TrialRecord.load(place))
    assert len(lines) == 4
    assert lines[0] == "00:16:40 UTC: receive mug ended as failed_empty after 3.0 s (participant P03, condition calm)"
    assert "the goal is lost, because the tracker is silent (GOAL_LOST" in lines[-1]


def test_a_full_disk_ends_the_record_and_nothing_else(made, monkeypatch) -> None:
    recorder, memory = made
    disk = SimpleNamespace(free=1e12)
    monkeypatch.setattr(module.shutil, "disk_usage", lambda _folder: disk)
    recorder.state(MasterState(in_hub=True))
    recorder.state(MasterState(in_hub=False))
    recorder.step(0.1)
    disk.free = 1e6
    recorder.step(0.2)
    assert list(recorder.folder.iterdir()) == []
    handover(recorder, memory, RESULT)
    assert list(recorder.folder.iterdir()) == [], "no record begins"
    disk.free = 1e12
    handover(recorder, memory, RESULT)
    assert len(list(trials_in(recorder.folder))) == 1


def test_the_end_of_the_system_ends_a_record(made) -> None:
    recorder, memory = made
    recorder.state(MasterState(in_hub=True))
    recorder.state(MasterState(in_hub=False))
    recorder.step(0.1)
    memory.take(stored("/number", 1000.0, Float64(1.0)))
    recorder.finish()
    (place,) = trials_in(recorder.folder)
    record = TrialRecord.load(place)
    assert (record.success, record.outcome, record.action) == (False, "interrupted", "unknown")


@pytest.mark.parametrize("content", [b"", b"no bag", b"#ROSBAG V2.0\n"])
def test_a_bag_that_is_none_is_refused_in_words(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / BAG
    file.write_bytes(content)
    with pytest.raises(CheckFailed, match=BAG):
        series_of(file)
