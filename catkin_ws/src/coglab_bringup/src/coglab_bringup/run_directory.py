"""Gives every run its own ROS master port, ROS_HOME and log folder, so that runs on one computer are independent."""

from __future__ import annotations

import fcntl
import os
import socket
import tempfile
from pathlib import Path


def free_port() -> int:
    """A TCP port on loopback that is free at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def port_is_free(port: int) -> bool:
    """True if a ROS master could bind this TCP port."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def print_load() -> None:
    """Print that nodes start slowly if this computer has more to do than its processors can."""
    load, processors = os.getloadavg()[0], os.cpu_count() or 1
    if load > processors:
        print(
            f"[coglab] this computer is busy (load {load:.1f} on {processors} processors): nodes start slowly",
            flush=True,
        )


def run_environment(port: int, home: Path | None = None) -> dict[str, str]:
    """Environment of one run. `port`: of its ROS master; `home`: ROS_HOME (default: a new temporary folder)."""
    ros_home = home or Path(tempfile.mkdtemp(prefix="coglab-run-"))
    ros_home.mkdir(parents=True, exist_ok=True)
    environment = dict(os.environ)
    environment.update(
        ROS_MASTER_URI=f"http://127.0.0.1:{port}",
        ROS_IP="127.0.0.1",
        ROS_HOME=str(ros_home),
        ROS_LOG_DIR=str(ros_home / "log"),
        ROSCONSOLE_STDOUT_LINE_BUFFERED="1",
        PYTHONUNBUFFERED="1",  # so that the last output of a killed node is in the log
    )
    environment.pop("ROS_HOSTNAME", None)
    return environment


def lasting_home(top: Path) -> tuple[Path, int]:
    """A ROS_HOME that is kept for the next run, with the object in the hand (coglab_holding.json), and its lock.

    It is the first of .coglab/home_1, home_2, ... that no other run uses. It stays locked until the file descriptor is
    closed. The descriptor is inheritable, so the lock passes to the program that replaces this one.
    """
    number = 1
    while True:
        home = top / ".coglab" / f"home_{number}"
        home.mkdir(parents=True, exist_ok=True)
        lock = os.open(home / "lock", os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            number += 1
        else:
            os.set_inheritable(lock, True)
            return home, lock
