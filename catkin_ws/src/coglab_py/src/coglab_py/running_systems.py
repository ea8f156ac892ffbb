"""Finds the running systems of this computer, and the ROS master that a command means.

Each run records itself in .coglab/runs/PORT.json of its checkout. Standard library only: a command to brake is quick.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from urllib.parse import urlparse

from coglab_py.node_start import answer

DEFAULT_MASTER = "http://127.0.0.1:11311"  # of a plain roslaunch


class NoSystem(Exception):
    """No system runs, or several do. The message says what to do."""


def _start_time(process: int) -> str:
    """Start of a process in ticks since boot, to distinguish it from a later one with its id; empty if it ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    return fields[19] if fields[0] != "Z" else ""


def record_run(top: Path, port: int, command: str) -> None:
    """Record that this process, or its replacement, runs a system whose ROS master listens on `port`."""
    folder = top / ".coglab" / "runs"
    folder.mkdir(parents=True, exist_ok=True)
    row = {"command": command, "pid": os.getpid(), "start_time": _start_time(os.getpid())}
    (folder / f"{port}.json").write_text(json.dumps(row) + "\n")


def running_systems(top: Path) -> dict[int, str]:
    """Running systems: command (launch, demo) by port of the ROS master. Removes the records of ended systems."""
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


def brain_of(master: str) -> bool:
    """True if a ROS master answers at this address and the brain is registered there."""
    try:
        return bool(answer(master, "lookupService", "/coglab/start"))
    except TimeoutError:
        return False


def find_master(top: Path, port: int, users_own: str) -> str:
    """Address of the ROS master to use: the given port, the user's ROS_MASTER_URI if a brain runs there, the only
    running system, or a plain roslaunch. NoSystem if there is none or more than one."""
    systems = running_systems(top)
    if port:
        return f"http://127.0.0.1:{port}"
    if users_own and urlparse(users_own).port not in systems and brain_of(users_own):
        return users_own
    if urlparse(users_own).port in systems:
        return users_own
    if len(systems) > 1:
        there = ", ".join(f"-p {number} ({command})" for number, command in systems.items())
        raise NoSystem(f"several systems run; choose one: {there}")
    if systems:
        return f"http://127.0.0.1:{next(iter(systems))}"
    if brain_of(DEFAULT_MASTER):
        return DEFAULT_MASTER
    raise NoSystem("no system runs; start one: ./coglab launch")
