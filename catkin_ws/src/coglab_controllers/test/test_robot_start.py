"""A failed start of /robot is reported at once with its cause, and ends the process and its FRI thread."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import rosgraph

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "lwr_fri_bridge" / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parent))
from own_master import node_path, own_master
from udp_controller import UdpController

SOURCES = Path(__file__).resolve().parents[2]
LIMIT = 60.0  # s


@pytest.fixture(scope="module")
def master() -> Iterator[rosgraph.Master]:
    with own_master() as running:
        running.setParam("/robot_description", (SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf").read_text())
        yield running


def failed_start(master: rosgraph.Master, **parameters: object) -> list[str]:
    """Output lines of a start that must fail; in parameter names __ means /."""
    master.setParam("/lwr", {"rt_priority": 0, "lock_memory": False})
    master.setParam("/controller_manager", {"cycle_time": 0.005})
    for name, value in parameters.items():
        master.setParam("/" + name.replace("__", "/"), value)
    ended = subprocess.run(
        [node_path("robot_node")],
        text=True,
        timeout=LIMIT,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert ended.returncode == 1, (ended.returncode, ended.stdout[-3000:])
    return [line for line in ended.stdout.splitlines() if line.strip()]


def test_a_busy_port_is_said_first(master):
    """A start that waits for the time limit of a request says that first."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        lines = failed_start(master, lwr__fri_port=port)
    assert f":{port} (Address already in use)" in lines[0], lines


@pytest.mark.parametrize("name, value", [("lwr__hot_drive", -300.0), ("controller_manager__cycle_time", 7.0)])
def test_bad_parameter_ends_the_start_with_a_running_fri_thread(master, name, value):
    """A controller sends at 1 kHz meanwhile. The memory is watched in test_start_failure.py (./coglab test --long)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    controller = UdpController(port, period=0.001).start()
    try:
        lines = failed_start(master, lwr__fri_port=port, **{name: value})
    finally:
        controller.close()
    assert any(name.rpartition("__")[2] in line for line in lines), lines
