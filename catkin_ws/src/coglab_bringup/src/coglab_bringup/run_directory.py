"""What makes two runs on one machine independent: an own ROS master port, ROS_HOME and log folder per run."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import tempfile
from pathlib import Path


def free_port() -> int:
    """A TCP port on loopback that nobody holds at the moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def port_is_free(port: int) -> bool:
    """Whether a ROS master could bind this TCP port."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def run_environment(port: int, home: Path | None = None) -> dict[str, str]:
    """The environment of one run: `port` of its ROS master, `home` for ROS_HOME (default: a new temporary folder)."""
    ros_home = home or Path(tempfile.mkdtemp(prefix="coglab-run-"))
    ros_home.mkdir(parents=True, exist_ok=True)
    environment = dict(os.environ)
    environment.update(
        ROS_MASTER_URI=f"http://127.0.0.1:{port}",
        ROS_IP="127.0.0.1",
        ROS_HOME=str(ros_home),
        ROS_LOG_DIR=str(ros_home / "log"),
        ROSCONSOLE_STDOUT_LINE_BUFFERED="1",
        PYTHONUNBUFFERED="1",  # what a node said last is in the log, also when it was killed
    )
    environment.pop("ROS_HOSTNAME", None)
    return environment


def lasting_home(top: Path) -> tuple[Path, int]:
    """A ROS_HOME that the next run finds again, with what the hand holds (coglab_holding.json), and its lock.

    The first of .coglab/home_1, home_2, ... that no other run has. It is taken until the file descriptor is closed,
    which is inheritable: so it belongs to the program that replaces this one.
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


def _start_time(process: int) -> str:
    """When a process began, in ticks since boot, which tells it from a later one of its id; empty if it ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    return fields[19] if fields[0] != "Z" else ""


def record_run(top: Path, port: int, command: str) -> None:
    """Notes that this process, or what replaces it, runs a system whose ROS master listens on `port`."""
    folder = top / ".coglab" / "runs"
    folder.mkdir(parents=True, exist_ok=True)
    row = {"command": command, "pid": os.getpid(), "start_time": _start_time(os.getpid())}
    (folder / f"{port}.json").write_text(json.dumps(row) + "\n")


def running_systems(top: Path) -> dict[int, str]:
    """Command (launch, demo) by port of the ROS master, of the systems that run; forgets those that have ended."""
    found = {}
    for path in sorted((top / ".coglab" / "runs").glob("*.json")):
        try:
            row = json.loads(path.read_text())
            alive = _start_time(int(row["pid"])) == row["start_time"] != ""
        except (OSError, ValueError, KeyError, TypeError):
            alive = False
        if alive:
            found[int(path.stem)] = row["command"]
        else:
            path.unlink(missing_ok=True)
    return found
