"""Common parts of tests of nodes without rostest: a ROS master and the paths of the nodes."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rosgraph

LIMIT = 120.0  # s, to begin and to end


def built(*parts: str) -> Path:
    """A file below a prefix of the sourced workspace."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix).joinpath(*parts)
        if prefix and path.exists():
            return path
    pytest.fail("coglab_controllers is not built, or its workspace not sourced: ./coglab build, then ./coglab test")


def node_path(name: str) -> str:
    """Path of a node of this package in the sourced workspace."""
    return str(built("lib", "coglab_controllers", name))


@contextmanager
def own_master() -> Iterator[rosgraph.Master]:
    """On a free port, which ROS_MASTER_URI names meanwhile."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    before = os.environ.get("ROS_MASTER_URI")
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    core = subprocess.Popen(
        ["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        end = time.monotonic() + LIMIT
        while not rosgraph.is_master_online():
            assert time.monotonic() < end, f"no ROS master within {LIMIT:.0f} s"
            time.sleep(0.05)
        yield rosgraph.Master("/test")
    finally:
        core.terminate()
        core.wait(timeout=LIMIT)
        os.environ.pop("ROS_MASTER_URI")
        if before is not None:
            os.environ["ROS_MASTER_URI"] = before
