"""What makes two runs on one machine independent: an own ROS master port, ROS_HOME and log folder per run."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import tempfile
from pathlib import Path

from coglab_bringup.sources import wall_sources


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


def record_times(top: Path, command: str, seconds: float, before: str, **parts: object) -> None:
    """Keeps wall times (s) of the last ./coglab demo or test of this checkout, for ./coglab bench wall.

    `seconds` is the run itself; what installing and building took before it comes from the environment, where ./coglab
    did them in the same command. `parts` of the run are kept beside it. A first demo is one alone: that of the command
    which installed packages, built a checkout where nothing was built, and ran the first demo of it.

    `before`: what wall_sources() said when the run began. It is kept with the times, by which the bench tells those of
    other sources; empty where the sources are others now, because nobody could say which of them the times are of.
    """
    folder = top / ".coglab"
    folder.mkdir(exist_ok=True)
    path = folder / "times.json"
    times = json.loads(path.read_text()) if path.is_file() else {}
    install = float(os.environ.get("COGLAB_INSTALL_SECONDS", "0"))
    build = float(os.environ.get("COGLAB_BUILD_SECONDS", "0"))
    row: dict[str, object] = {
        "install_s": install,
        "build_s": build,
        "run_s": round(seconds, 1),
        "total_s": round(install + build + seconds, 1),
        "sources": before if before and before == wall_sources(top) else "",
        **parts,
    }
    from_nothing = install > 0.0 and build > 0.0 and os.environ.get("COGLAB_FIRST_BUILD") == "yes"
    if command == "demo" and from_nothing and "last_demo" not in times:
        times["demo_from_nothing"] = row | {"installed": os.environ.get("COGLAB_INSTALLED", "")}
    times[f"last_{command}"] = row
    path.write_text(json.dumps(times, indent=1) + "\n")
