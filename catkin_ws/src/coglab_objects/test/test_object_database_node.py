"""The database's node with a parameter server that accepts only XML-RPC types: no file ends the node or its timer."""

import importlib.util
import shutil
import xmlrpc.client
from pathlib import Path
from types import SimpleNamespace

import pytest
import rospy
from coglab_msgs.msg import ReasonCode
from coglab_py import steady

SHARE = Path(__file__).resolve().parent.parent
HOSTILE = {
    "list_key": "? [a, b]\n: 1\n",
    "date": "id: date\nname: 2024-02-31\n",
    "deep": "a: " + "[" * 50_000,
    "binary": "\x00\x01",
    "nan": None,
    "huge": "x" * 1_000_000,
    "tag": "!!python/object/apply:os.system [true]",
}


class Master:
    """The parameter server, and a switch that makes it fail."""

    def __init__(self, folder):
        self.values, self.down, self.calls = {"~folder": str(folder), "~objects": {"elephant": {}}}, False, 0

    def get_param(self, name, default=None):
        return self.values.get(name, default)

    def has_param(self, name):
        return name in self.values

    def set_param(self, name, value):
        self.calls += 1
        if self.down:
            raise OSError("the master does not answer")
        xmlrpc.client.loads(xmlrpc.client.dumps((value,)))
        self.values[name] = value

    def delete_param(self, name):
        if self.down:
            raise OSError("the master does not answer")
        del self.values[name]

    def objects(self):
        return sorted(name.rpartition("/")[2] for name in self.values if name.startswith("~objects"))


@pytest.fixture
def make(tmp_path, monkeypatch):
    """A started node with its master and folder."""
    shutil.copy(SHARE / "objects" / "mug.yaml", tmp_path)
    shutil.copy(SHARE / "objects" / "ball.yaml", tmp_path)
    master, warnings = Master(tmp_path), []
    for name in ("get_param", "has_param", "set_param", "delete_param"):
        monkeypatch.setattr(rospy, name, getattr(master, name))
    begun = []
    monkeypatch.setattr(rospy, "Service", lambda *args: begun.append(args))
    monkeypatch.setattr(steady, "SteadyTimer", lambda *args: begun.append(args))
    for name in ("logwarn", "logerr_throttle"):
        monkeypatch.setattr(rospy, name, lambda *args: warnings.append(args))
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    spec = importlib.util.spec_from_file_location("node", SHARE / "scripts" / "object_database_node.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    there = {"module": module, "master": master, "folder": tmp_path, "warnings": warnings, "begun": begun}
    return lambda node=True: SimpleNamespace(node=module.ObjectDatabaseNode() if node else None, **there)


def hostile(folder):
    for name, text in HOSTILE.items():
        good = (SHARE / "objects" / "mug.yaml").read_text().replace("id: mug", f"id: {name}")
        (folder / f"{name}.yaml").write_text(good.replace("mass: 0.31", "mass: .nan") if text is None else text)


def test_entries_of_an_earlier_run_are_removed(make):
    assert make().master.objects() == ["ball", "mug"]


def test_no_file_ends_the_node_at_its_start(make, tmp_path):
    hostile(tmp_path)
    started = make()
    assert started.node.database.ids() == ["ball", "mug"] and len(started.warnings) == len(HOSTILE)


def test_no_file_ends_the_timer_and_each_is_reported_once(make):
    started = make()
    hostile(started.folder)
    for _ in range(3):
        started.node.on_timer()
    assert len(started.warnings) == len(HOSTILE)
    assert started.node.on_get(SimpleNamespace(object_id="x" * 1_000_000)).success is False


def test_deleted_objects_leave_the_parameter_server_and_only_changes_go_there(make):
    started = make()
    before = started.master.calls
    (started.folder / "mug.yaml").unlink()
    started.node.on_timer()
    assert started.master.objects() == ["ball"] and started.node.database.ids() == ["ball"]
    assert started.master.calls == before


def test_copy_is_updated_when_the_master_is_back(make):
    started = make()
    started.master.down = True
    (started.folder / "mug.yaml").unlink()
    started.node.on_timer()
    started.node.on_timer()
    assert started.node.database.ids() == ["ball"] and started.master.objects() == ["ball", "mug"]
    assert len(started.warnings) == 1
    started.master.down = False
    started.node.on_timer()
    assert started.master.objects() == ["ball"]


def test_unexpected_error_is_logged_and_the_timer_continues(make, monkeypatch):
    started = make()
    monkeypatch.setattr(started.node.database, "changed", lambda: 1 / 0)
    started.node.on_timer()
    assert "ZeroDivisionError" in started.warnings[-1][1]


def test_the_list_names_the_files_that_do_not_fit(make, tmp_path):
    started = make()
    (tmp_path / "mug.yaml").write_text("id: mug\nmass: heavy\n")
    started.node.on_timer()
    listed = started.node.on_list(None)
    assert listed.object_ids == ["ball", "mug"] and len(listed.problems) == 1
    assert "mug.yaml" in listed.problems[0]
    assert listed.problem_codes == [ReasonCode.BAD_FILE]


def test_reading_again_says_by_a_code_whether_all_files_fit(make, tmp_path):
    started = make()
    read = started.node.on_reload(None)
    assert (read.success, read.reason_code, read.message) == (True, ReasonCode.NONE, "2 objects")
    (tmp_path / "mug.yaml").write_text("id: mug\nmass: heavy\n")
    read = started.node.on_reload(None)
    assert (read.success, read.reason_code) == (False, ReasonCode.BAD_FILE) and "mug.yaml" in read.message


def test_a_file_that_is_written_is_read_at_the_next_tick_and_mirrored_once(make):
    started = make()
    assert started.master.values["~objects/mug"]["mass"] == 0.31 and started.master.calls == 2
    path = started.folder / "mug.yaml"
    path.write_text(path.read_text().replace("mass: 0.31", "mass: 0.3333"))
    for _ in range(3):
        started.node.on_timer()
    assert started.master.values["~objects/mug"]["mass"] == 0.3333 and started.master.calls == 3
    assert started.warnings == []
