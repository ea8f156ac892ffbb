"""The recorder without ROS: each handover becomes one complete folder, despite faults of disk, results and system."""

import io
import json
import time

import pytest
import rosbag
import rospy
from coglab_msgs.msg import Transition
from coglab_py.steady import Stamps
from coglab_tools.trial.record import TrialRecord, find_trials
from coglab_tools.trial.recorder import Raw, Recorder, configuration_hash
from coglab_tools.trial.recorder_node import RecorderNode
from rospy import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import String

ACTION = "exchange_human_to_robot"
PARAMETERS = {
    "coglab": {"trial": {"participant": "P03", "condition": "brisk", "study": "timing"}, "speed": 0.5},
    "coglab_sim": {"person": {"seed": 7}},
    "run_id": "x",
}


class Cell:
    """A recorder and its input. `disk`: free bytes."""

    def __init__(self, folder, disk=1e12):
        self.disk, self.said = disk, []
        self.clock = 0.0  # s by which this computer's clock was set
        self.recorder = Recorder(
            folder, lambda: PARAMETERS, lambda text, wrong: self.said.append((wrong, text)), free=lambda _: self.disk
        )

    def send(self, time, topic, message, latching="0"):
        stream = io.BytesIO()
        message.serialize(stream)
        header = {
            "type": message._type, "md5sum": message._md5sum, "message_definition": message._full_text,
            "callerid": "/coglab", "latching": latching,
        }  # fmt: skip
        self.recorder.put(Raw(time, topic, stream.getvalue(), header, time + self.clock))

    def move(self, time, source, outcome, target):
        message = Transition(path="/coglab_master", from_state=source, outcome=outcome, to_state=target)
        message.header.stamp = Time.from_sec(time)
        self.send(time, "/coglab/transitions", message)

    def result(self, begun, ended, **changes):
        row = {
            "kind": ACTION, "object_id": "mug", "outcome": "succeeded", "reason": "done", "reason_code": 0,
            "causes": [], "started": begun - 1000.0, "ended": ended - 1000.0, "started_ros": begun,
            "ended_ros": ended, "marks": {"contact": begun - 1000.0 + 2.0},
        }  # fmt: skip
        self.send(ended, "/coglab/results", String(json.dumps({**row, **changes})), latching="1")

    def run(self, begin, end, step=0.1):
        """Send joint states at 10 Hz, and step the recorder."""
        for k in range(round((end - begin) / step)):
            now = begin + k * step
            self.send(now, "/lwr/joint_states", JointState(position=[0.0] * 7, velocity=[0.0] * 7))
            self.recorder.step(now)


def handover(cell, begun=2020.0, ended=2024.0, **changes):
    cell.send(begun - 15.0, "/tf_static", String("kept, as it is latched"), latching="1")
    cell.run(begun - 10.0, begun)
    cell.move(begun, "wait_without_object", ACTION, ACTION)
    cell.run(begun, ended)
    cell.result(begun, ended, **changes)
    cell.move(ended + 0.01, ACTION, "succeeded", "wait_with_object")
    cell.run(ended, ended + 4.0)


def test_a_handover_becomes_a_complete_folder_with_the_seconds_before(tmp_path):
    cell = Cell(tmp_path)
    handover(cell)
    (place,) = find_trials(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == [place.name] == [f"19700101T003340Z_{ACTION}_mug"]
    record = TrialRecord.load(place)
    assert record.outcome.success and record.duration_s == 4.0 and record.object == "mug" and record.simulated
    assert (record.participant, record.condition, record.study, record.seed) == ("P03", "brisk", "timing", 7)
    assert record.marks == ({"name": "contact", "time_s": 2.0},)
    with rosbag.Bag(str(place / "trial.bag")) as bag:
        stamps = [t.to_sec() for _, _, t in bag.read_messages("/lwr/joint_states")]
        assert stamps[0] == pytest.approx(2015.0, abs=0.2) and stamps[-1] == pytest.approx(2025.0, abs=0.2)
        (latched,) = bag.read_messages("/tf_static")
        assert latched.message.data.startswith("kept") and latched.timestamp.to_sec() >= 2014.8
        assert len(list(bag.read_messages("/coglab/transitions"))) == 2


@pytest.mark.parametrize("step", [7200.0, -7200.0, -2.5])
def test_a_step_of_the_clock_neither_cuts_nor_loses_a_handover(tmp_path, step):
    cell = Cell(tmp_path)
    cell.clock = 1e9  # set before the handover: all times of the recording are of the new clock
    cell.run(2010.0, 2020.0)
    cell.move(2020.0, "wait_without_object", ACTION, ACTION)
    cell.run(2020.0, 2022.0)
    cell.clock += step
    cell.run(2022.0, 2024.0)
    begun, ended = 2020.0 + cell.clock, 2024.0 + cell.clock  # the brain converts both times by its clock of the end
    cell.result(2020.0, 2024.0, started_ros=begun, ended_ros=ended)
    cell.move(2024.01, ACTION, "succeeded", "wait_with_object")
    cell.run(2024.0, 2028.0)
    (place,) = find_trials(tmp_path)
    record = TrialRecord.load(place)
    assert record.outcome.success and record.object == "mug" and record.duration_s == 4.0
    assert record.marks == ({"name": "contact", "time_s": 2.0},)
    assert record.started.startswith("2001-09-09T02:20:20.000")
    assert record.notes.startswith(f"this computer's clock was set by {step:+.2f} s")
    with rosbag.Bag(str(place / "trial.bag")) as bag:
        stamps = [t.to_sec() - 1e9 for _, _, t in bag.read_messages("/lwr/joint_states")]
        assert stamps == sorted(stamps)
        assert stamps[0] == pytest.approx(2015.0, abs=0.2) and stamps[-1] == pytest.approx(2025.0, abs=0.2)


@pytest.mark.parametrize("simulated", [False, True])
def test_the_node_follows_simulated_time_but_no_step_of_this_computers_clock(monkeypatch, simulated):
    node, ahead = RecorderNode.__new__(RecorderNode), 0.0
    node._stamps = Stamps()
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: not simulated)
    monkeypatch.setattr(rospy, "get_time", lambda: 1e9 + time.monotonic() + ahead)
    before, ros = node._clocks()
    ahead = -3600.0
    after, ros_after = node._clocks()
    assert ros_after - ros == pytest.approx(-3600.0, abs=60.0)
    assert after - before == pytest.approx(-3600.0 if simulated else 0.0, abs=60.0)
    assert (after == ros_after) is simulated


def test_a_note_belongs_to_the_running_or_the_last_handover(tmp_path):
    cell = Cell(tmp_path)
    cell.send(2000.0, "/coglab/note", String("before the first"))
    cell.run(2000.0, 2001.0)
    cell.move(2020.0, "wait_without_object", ACTION, ACTION)
    cell.run(2020.0, 2021.0)
    cell.send(2021.0, "/coglab/note", String("looked\naway"), latching="1")  # as `rostopic pub` does
    cell.result(2020.0, 2024.0)
    cell.run(2021.0, 2026.0)
    cell.send(2030.0, "/coglab/note", String("let go early"))
    cell.run(2030.0, 2031.0)
    (place,) = find_trials(tmp_path)
    record = TrialRecord.load(place)
    assert sorted(record.notes.split("; ")) == ["before the first", "let go early", "looked away"]
    assert [mark for mark in record.marks if "note" in mark["name"]] == [{"name": "note: looked away", "time_s": 1.0}]


def test_failures_keep_their_code_and_have_their_own_folders(tmp_path):
    cell = Cell(tmp_path)
    handover(cell, outcome="failed_empty", reason_code=40, reason="nobody let go")
    handover(cell, 2020.5, 2023.0, started_ros=2020.0)
    first, second = map(TrialRecord.load, find_trials(tmp_path))
    assert (first.outcome.success, first.outcome.code, first.outcome.text) == (False, 40, "nobody let go")
    assert second.id == f"{first.id}_2" and second.outcome.success


@pytest.mark.parametrize("text", ["no JSON", '{"kind": 3}', "[]", '{"kind": "exchange_human_to_robot"}'])
def test_an_invalid_result_is_ignored_and_the_transition_has_the_outcome(tmp_path, text):
    cell = Cell(tmp_path)
    cell.move(2020.0, "wait_without_object", ACTION, ACTION)
    cell.run(2020.0, 2021.0)
    cell.send(2021.0, "/coglab/results", String(text))
    cell.move(2022.0, ACTION, "failed_empty", "wait_without_object")
    cell.run(2021.0, 2027.0)
    (place,) = find_trials(tmp_path)
    record = TrialRecord.load(place)
    assert not record.outcome.success and record.duration_s == pytest.approx(2.0)


def test_a_full_disk_is_reported_and_ends_only_the_recording(tmp_path):
    cell = Cell(tmp_path, disk=400e6)
    handover(cell)
    assert not any(tmp_path.iterdir()) and "400 MB left" in cell.said[0][1] and cell.said[0][0]
    cell.disk = 1e12
    cell.run(2030.0, 2031.0)
    cell.move(2031.0, "wait_without_object", ACTION, ACTION)
    cell.run(2031.0, 2033.0)
    cell.disk = 1e6
    cell.run(2033.0, 2036.0)
    (place,) = find_trials(tmp_path)
    assert "stopped" in TrialRecord.load(place).notes


def test_a_disk_error_leaves_no_incomplete_file_and_recording_continues(tmp_path, monkeypatch):
    cell = Cell(tmp_path)

    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(rosbag.Bag, "write", full)
        handover(cell)
    assert not any(tmp_path.iterdir()) and "No space left" in cell.said[0][1]
    handover(cell, 2040.0, 2044.0)
    assert len(find_trials(tmp_path)) == 1


def test_the_end_of_the_system_keeps_the_recording(tmp_path):
    cell = Cell(tmp_path)
    cell.run(2018.0, 2020.0)
    cell.move(2020.0, "wait_without_object", ACTION, ACTION)
    cell.run(2020.0, 2021.0)
    cell.recorder.close()
    (place,) = find_trials(tmp_path)
    record = TrialRecord.load(place)
    assert "before" in record.outcome.text and record.duration_s == pytest.approx(0.9)


def test_a_handover_that_began_before_the_recorder_is_reported_as_missing(tmp_path):
    cell = Cell(tmp_path)
    cell.move(2020.0, ACTION, "succeeded", "wait_with_object")
    cell.run(2020.0, 2021.0)
    assert [wrong for wrong, _ in cell.said] == [True] and ACTION in cell.said[0][1]
    handover(cell)
    assert len(find_trials(tmp_path)) == 1 and not cell.said[-1][0]


def test_the_hash_changes_only_with_a_setting():
    same = configuration_hash({"/a": 1, "/fri_port_bound": 4000})
    assert same == configuration_hash({"/fri_port_bound": 4001, "/a": 1}) != configuration_hash({"/a": 2})
