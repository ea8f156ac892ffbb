"""The controller manager as a separate node: sources of model, feedback file and priority, and its shutdown."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rosgraph

sys.path.insert(0, str(Path(__file__).resolve().parent))
from own_master import node_path, own_master

SOURCES = Path(__file__).resolve().parents[2]
URDF = SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf"
SERVICE = "/controller_manager/list_controllers"


@pytest.fixture(scope="module")
def master() -> Iterator[rosgraph.Master]:
    with own_master() as running:
        yield running


@pytest.fixture(autouse=True)
def clean(master: rosgraph.Master) -> None:
    """No parameters but those of the test."""
    for name in ("/robot_description", "/controller_manager", "/lwr"):
        if master.hasParam(name):
            master.deleteParam(name)


def refused() -> str:
    """Output of a failed start, which ends with status 1."""
    ended = subprocess.run([node_path("controller_manager_node")], capture_output=True, text=True, timeout=600)
    assert ended.returncode == 1, ended.stderr[-2000:]
    return ended.stderr


def started(master: rosgraph.Master, end: signal.Signals = signal.SIGINT) -> str:
    """Output of a successful start; the node is then ended by a signal, with status 0."""
    node = subprocess.Popen(
        [node_path("controller_manager_node")], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        limit = time.monotonic() + 60.0
        while SERVICE not in [name for name, _ in master.getSystemState()[2]]:
            assert node.poll() is None, node.communicate()[1][-2000:]
            assert time.monotonic() < limit, "no service within 30 s"
            time.sleep(0.02)
        node.send_signal(end)
        _, told = node.communicate(timeout=60.0)
    finally:
        node.kill()
        node.wait(timeout=60.0)
    assert node.returncode == 0, told
    return told


@pytest.mark.parametrize(
    "parameters, words",
    [
        ({"urdf_file": "/nowhere/arm.urdf"}, "'/nowhere/arm.urdf'"),
        ({"feedback_file": "package://nowhere/f.yaml"}, "'package://nowhere/f.yaml': package 'nowhere'"),
        (
            {"feedback_file": "package://coglab_controllers"},
            "'package://coglab_controllers': package 'coglab_controllers'",
        ),
        ({"cycle_time": 7.0}, "parameter controller_manager/cycle_time: expected"),
    ],
)
def test_a_file_that_is_not_there_ends_the_start_and_is_named(
    master: rosgraph.Master, parameters: dict[str, object], words: str
) -> None:
    master.setParam("/controller_manager", parameters)
    told = [line for line in refused().splitlines() if line.startswith("controller_manager_node: ")]
    assert len(told) == 1 and words in told[0], told


def test_starts_with_the_packages_own_model(master: rosgraph.Master) -> None:
    master.setParam("/lwr", {"rt_priority": 0})
    master.setParam("/controller_manager", {"priority": 0})
    assert "lwr/rt_priority" not in started(master, signal.SIGTERM), "none is asked for, none is left"


@pytest.mark.parametrize(
    "name, path",
    [
        ("nowhere.yaml", "/config/nowhere.yaml"),
        ("/nowhere/absent.yaml", "/nowhere/absent.yaml"),
        ("package://lwr_description/nowhere.yaml", "lwr_description/nowhere.yaml"),
    ],
)
def test_a_feedback_file_is_looked_for_where_it_says(master: rosgraph.Master, name: str, path: str) -> None:
    master.setParam("/lwr", {"rt_priority": 3})
    master.setParam("/controller_manager", {"priority": 3, "feedback_file": name})
    told = started(master)
    errors = [line for line in told.splitlines() if "feedback controllers: " in line]
    assert len(errors) == 1 and path in told and "package://" not in told, told
    assert ("coglab_controllers/config" in told) == (name == "nowhere.yaml"), "a whole path is one"
    assert re.search(r"controller_manager: priority 3\b.*\b2\b.*lwr/rt_priority", told)
