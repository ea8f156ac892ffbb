"""A ROS master for tests that are no rostests."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager

import rosgraph

LIMIT = 120.0  # s, to begin and to end


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
