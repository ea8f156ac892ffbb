"""Which ROS master a command means, by the records of the runs."""

import os

import pytest
from coglab_py.running_systems import NoSystem, find_master, record_run, running_systems


def test_no_system_and_several(tmp_path, monkeypatch):
    monkeypatch.setattr("coglab_py.running_systems.DEFAULT_MASTER", "http://127.0.0.1:9")
    with pytest.raises(NoSystem, match="./coglab launch"):
        find_master(tmp_path, 0, "")
    record_run(tmp_path, 4001, "launch")
    assert find_master(tmp_path, 0, "http://localhost:11999") == "http://127.0.0.1:4001"
    record_run(tmp_path, 4002, "demo")
    with pytest.raises(NoSystem, match=r"-p 4001 \(launch\), -p 4002 \(demo\)"):
        find_master(tmp_path, 0, "")
    assert find_master(tmp_path, 0, "http://127.0.0.1:4002") == "http://127.0.0.1:4002"
    # an ended system is forgotten, even if another program has its process id now
    runs = tmp_path / ".coglab" / "runs"
    (runs / "4002.json").write_text(f'{{"command": "demo", "pid": {os.getpid()}, "start_time": "1"}}')
    assert running_systems(tmp_path) == {4001: "launch"} and not (runs / "4002.json").exists()
