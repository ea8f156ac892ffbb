"""The master node and the objects' tool without a ROS master: what they publish and answer."""

import importlib.util
import json
import resource
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
import rospy
from coglab_objects.database import objects_folder
from coglab_py.packages import package_path
from coglab_smach.context.journal import ActionRecord, TransitionRecord
from coglab_smach.context.master_state import MasterState
from coglab_smach.ports.pending import Polled, PortError, Ready

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


def script(name):
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Clock:
    """Replaces the clock of the brain."""

    t = 100.0

    def now(self):
        return self.t

    def sleep(self, seconds):
        self.t += seconds


@pytest.fixture
def module():
    return script("master_node")


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def sent(monkeypatch, module):
    """What the node publishes, by topic, and what it logs, by level."""
    sent = []
    monkeypatch.setattr(module, "publish", lambda topic, message: sent.append((topic, message)))
    for level in ("loginfo", "logwarn", "logerr"):
        monkeypatch.setattr(rospy, level, lambda *words, level=level: sent.append((level, words)))
    return sent


@pytest.fixture
def master(monkeypatch, tmp_path, module, clock, sent):
    """The node without a ROS master and without its ports. It holds the mug."""
    given = {
        "~config_file": str(SCRIPTS.parent / "config" / "machines.yaml"),
        "~dmp_library": str(package_path("coglab_controllers", "config", "primitives.xml")),
        "~result_file": str(tmp_path / "results.jsonl"),
        "~state_file": str(tmp_path / "holding.json"),
        "~introspection": False,
    }
    monkeypatch.setattr(rospy, "has_param", given.__contains__)
    monkeypatch.setattr(rospy, "get_param", given.get)
    monkeypatch.setattr(rospy, "search_param", lambda name: None)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    for kind in ("Publisher", "Subscriber", "Service"):
        monkeypatch.setattr(rospy, kind, lambda name, *_, **__: name)
    for part in ("RosArm", "RosHand", "RosPerception", "RosDatabase", "RosContact", "ActionServer"):
        monkeypatch.setattr(module, part, MagicMock())
    monkeypatch.setattr(module, "PacedClock", lambda pace: clock)
    stamps = SimpleNamespace(stamp=lambda steady: rospy.Time.from_sec(steady + 1000.0))
    monkeypatch.setattr(module, "Stamps", lambda: stamps)
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time.from_sec(50.0)))
    node = module.MasterNode()
    node.ctx.holding = "mug"
    sent.clear()
    return node


def test_deadlines_are_published_in_ros_time(master, sent):
    for deadline, told in ((0.0, 0.0), (103.5, 53.5), (99.0, 50.001)):
        master.on_state(MasterState("s", True, ("a", "b"), "mug", "why", 3, "rain", 4, deadline))
        message = sent[-1][1]
        assert message.deadline.to_sec() == pytest.approx(told, abs=1e-6)
    assert (message.state, message.in_hub, message.actions, message.object_id) == ("s", True, ["a", "b"], "mug")
    assert (message.why, message.reason_code, message.waits_for, message.waits_code) == ("why", 3, "rain", 4)


def test_stop_is_latched_whatever_the_arm_answers(master, clock):
    def stop(answer):
        master.ctx.stop.reset()
        master.ctx.arm.hold = lambda why: answer
        answered = master.on_stop(None)
        assert master.ctx.stop.pressed()
        return answered.success, answered.message

    success, message = stop(Ready("held"))
    assert success and "held" in message
    assert stop(Polled(lambda: clock.t > 101.0, lambda: "held"))[0]
    begin = clock.t
    success, message = stop(Polled(lambda: False, lambda: None))
    assert not success and "emergency stop" in message
    assert clock.t - begin == pytest.approx(2.0, abs=0.006)
    success, message = stop(Ready(error=PortError("no line")))
    assert not success and "no line" in message


def test_transitions_and_results_are_published_and_written(master, sent):
    for outcome, level in (
        ("succeeded", "loginfo"),
        ("failed", "logwarn"),
        ("fault", "logwarn"),
        ("stopped", "logwarn"),
    ):
        master.on_transition(TransitionRecord(1.0, "/m", "a", outcome, "b", "why", ("c",), 4))
        assert sent[-1][0] == level
    told = sent[-2][1]
    assert (told.path, told.from_state, told.outcome, told.to_state) == ("/m", "a", "stopped", "b")
    assert (told.reason, list(told.causes), told.reason_code) == ("why", ["c"], 4)
    record = ActionRecord("take", "mug", 1.0, 3.5, "succeeded", marks={"closed": 2.0})
    master.on_result(record)
    typed = next(message for to, message in sent if to == "coglab/handover_results")
    assert (typed.action, typed.success, typed.holding) == ("take", True, "mug")
    assert [t.to_sec() for t in (typed.started, typed.ended, typed.marks[0].stamp)] == [1001.0, 1003.5, 1002.0]
    master.on_result(record)
    lines = Path(master.result_file).read_text().splitlines()
    row = json.loads(lines[0])  # times in ROS time for bags, and in UTC for videos and questionnaires
    assert (row["started_ros"], row["ended_ros"]) == (1001.0, 1003.5) and row["ended_utc"] > row["started_utc"]
    assert row["marks_ros"] == {"closed": 1002.0} and typed.id == f"{row['started_utc']}_take"
    assert len(lines) == 2 and row["duration_s"] == 2.5 and sent[-1][1].data == lines[0]
    master.result_file = str(Path(master.result_file).parent)
    master.on_result(record)
    assert sent[-1][0] == "logerr"
    master.result_file = ""
    master.on_result(record)
    assert sent[-1][0] == "coglab/results"
    assert ActionRecord("take", "mug", 1.0).to_dict() == {
        **{"kind": "take", "object_id": "mug", "outcome": "", "reason": "", "reason_code": 0, "causes": []},
        "delivery": "",
        **{"started": 1.0, "ended": 0.0, "duration_s": -1.0, "marks": {}},
    }


def test_a_full_disk_leaves_no_half_result(master, sent):
    """A later result would be on the same line."""
    record, file = ActionRecord("take", "mug", 1.0, 3.5, "succeeded"), Path(master.result_file)
    master.on_result(record)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (file.stat().st_size + 30, limits[1]))
        master.on_result(record)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert sent[-1][0] == "logerr"
    master.on_result(record)
    assert [json.loads(line)["kind"] for line in file.read_text().splitlines()] == ["take", "take"]


def test_each_namespace_has_its_own_file_for_the_held_object(master, module, monkeypatch):
    read = {"~state_file": ""}
    monkeypatch.setattr(module.parameters, "read", lambda name, kind, default: read[name])
    monkeypatch.setattr(module.rospkg, "get_ros_home", lambda: "/home/ros")
    for namespace, name in (("/", "coglab_holding.json"), ("/two/arms/", "coglab_holding_two_arms.json")):
        monkeypatch.setattr(rospy, "get_namespace", lambda namespace=namespace: namespace)
        assert master.state_file() == f"/home/ros/{name}"
    read["~state_file"] = "own.json"
    assert master.state_file() == "own.json"


def test_a_node_that_cannot_be_configured_ends_with_status_1(module, monkeypatch):
    said = []
    monkeypatch.setattr(module, "init_node", lambda name: None)
    monkeypatch.setattr(rospy, "logfatal", lambda *words: said.append(words))
    monkeypatch.setattr(module.parameters, "found_above", lambda name, kind: "<robot/>")

    def bad(*_):
        raise module.parameters.ParameterError("no")

    monkeypatch.setattr(module.MasterNode, "__init__", bad)
    assert module.main() == 1 and len(said) == 1


def test_the_exit_status_of_the_object_tool(monkeypatch, tmp_path, capsys):
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
