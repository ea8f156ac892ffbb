"""What makes two runs on one machine independent: an own ROS master port, ROS_HOME and log folder per run."""

from __future__ import annotations

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


def record_times(top: Path, command: str, seconds: float) -> None:
    """Keeps wall times (s) of the first and the last ./coglab demo or test on this machine, for ./coglab bench wall.

    `seconds` is the run itself; what installing and building took before it comes from the environment.
    """
    folder = top / ".coglab"
    folder.mkdir(exist_ok=True)
    path = folder / "times.json"
    times = json.loads(path.read_text()) if path.is_file() else {}
    install = float(os.environ.get("COGLAB_INSTALL_SECONDS", "0"))
    build = float(os.environ.get("COGLAB_BUILD_SECONDS", "0"))
    row = {
        "install_s": install,
        "build_s": build,
        "run_s": round(seconds, 1),
        "total_s": round(install + build + seconds, 1),
    }
    times.setdefault(f"first_{command}", row)
    times[f"last_{command}"] = row
    longest = times.setdefault("setup", {"install_s": 0.0, "build_s": 0.0})  # whichever command had to do it
    longest.update(install_s=max(install, longest["install_s"]), build_s=max(build, longest["build_s"]))
    path.write_text(json.dumps(times, indent=1) + "\n")
