"""Start of the console: one console per ROS master, a free port, and the versions that the page shows.

Two consoles of one master would show two operators, and a node of the same name would end the first. A lock in ROS_HOME
prevents a second one; it is free as soon as its process has ended. A parameter of the master holds the address and the
process number of the console, for consoles of another ROS_HOME or computer. The parameter outlives a console that was
killed, so a new console checks that this process still runs.
"""

from __future__ import annotations

import fcntl
import os
import platform
import socket
import subprocess
import time
from http.client import HTTPException
from pathlib import Path
from urllib.parse import urlsplit
from xmlrpc.client import Error

import rosgraph
import rospkg
from coglab_py.node_start import answer

PLACE = "/coglab_console_place"
PATIENCE = 2.0  # s to wait for another console to end, for example while it is respawned
PACKAGES = (
    "python3-rospy", "python3-aiohttp", "python3-numpy", "python3-scipy", "libjs-three", "libjs-dygraphs", "graphviz",
)  # fmt: skip
DPKG_LIMIT = 5.0  # s


class StartError(Exception):
    """The console cannot start. The message says what to do."""


def only_one(home: Path) -> int:
    """Takes the lock of this ROS master and returns its file descriptor. The process holds it until its end."""
    master = urlsplit(os.environ.get("ROS_MASTER_URI", "")).port or 11311
    lock = os.open(home / f"console_{master}.lock", os.O_RDWR | os.O_CREAT, 0o600)
    for _ in range(round(PATIENCE / 0.1)):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return lock
        except OSError:
            time.sleep(0.1)
    raise StartError(f"another console of this ROS master runs; its link is in {home / 'console.url'}")


def announce(master: rosgraph.Master, uri: str) -> None:
    """Writes the address and process number of this console to the master."""
    master.setParam(PLACE, [uri, os.getpid()])


def look_for_another(master: rosgraph.Master) -> None:
    """Raises StartError if this master has a console. Call it before init_node, which would end the other one."""
    end = time.monotonic() + PATIENCE
    while True:
        found = _another(master)
        if not found:
            return
        if time.monotonic() > end:
            raise StartError(f"another console of this ROS master runs{found}; use its page, or end it first")
        time.sleep(0.1)


def _another(master: rosgraph.Master) -> str:
    """Address of another console, in words; empty if there is none, or no master."""
    try:
        uri, process = master.getParam(PLACE)
        if not isinstance(uri, str):
            return ""
        found = answer(uri, "getPid")
        return f" at {uri}, process {process}" if found is not None and found == process else ""
    except TimeoutError:
        return f" at {uri} but does not answer"
    except (rosgraph.MasterException, Error, HTTPException, OSError, TypeError, ValueError):
        return ""


def bind(address: str, port: int, fixed: bool) -> socket.socket:
    """Returns a listening socket. If the port is taken and not `fixed`: one of the next nine, or any free port."""
    wanted = [port] if fixed or port == 0 else [*range(port, port + 10), 0]
    for number in wanted:
        found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((address, number))
            found.listen(64)
            return found
        except OSError as error:
            found.close()
            problem = error.strerror
    raise StartError(f"{address}:{port} cannot be used ({problem}); choose another console_port, or leave it out")


def exposure(address: str) -> str:
    """Warning about an address that other computers reach; empty for loopback."""
    if address in ("127.0.0.1", "localhost"):
        return ""
    return f"the console listens on {address}: anybody with the link can move the robot, and nothing is encrypted"


def versions() -> dict[str, str]:
    """Version by name. The text says so if a version is unknown."""
    return {
        "CogLab": _own_version(),
        "Debian": _file_text(Path("/etc/debian_version")),
        "Linux": platform.release(),
        "Python": platform.python_version(),
        **debian_versions(PACKAGES),
    }


def debian_versions(names: tuple[str, ...]) -> dict[str, str]:
    """Version of each Debian package, by one call of dpkg-query."""
    try:
        command = ["dpkg-query", "-W", "-f=${db:Status-Status} ${Package} ${Version}\n", *names]
        lines = subprocess.run(command, capture_output=True, text=True, timeout=DPKG_LIMIT).stdout.splitlines()
    except (OSError, subprocess.TimeoutExpired):
        return dict.fromkeys(names, "unknown: dpkg did not answer")
    rows = [line.split() for line in lines]
    found = {row[1]: row[2] for row in rows if len(row) == 3 and row[0] == "installed"}
    return {name: found.get(name, "not installed") for name in names}


def _own_version() -> str:
    """Version of the package, and the commit if this is a checkout."""
    packages = rospkg.RosPack()
    try:
        found = str(packages.get_manifest("coglab_console").version)
        here = Path(packages.get_path("coglab_console")).resolve()
    except rospkg.ResourceNotFound:
        return "unknown"
    top = next((folder for folder in here.parents if (folder / ".git").exists()), None)
    return f"{found}, commit {commit(top)}" if top is not None else found


def commit(top: Path) -> str:
    """Short hash of the checked-out commit, read from the files of git."""
    entry = top / ".git"
    if entry.is_file():  # a worktree names its folder
        entry = top / _file_text(entry).removeprefix("gitdir: ")
    head = _file_text(entry / "HEAD")
    if not head.startswith("ref: "):
        return head[:10]
    name = head.removeprefix("ref: ")
    shared = entry / _file_text(entry / "commondir") if (entry / "commondir").is_file() else entry
    if (shared / name).is_file():
        return _file_text(shared / name)[:10]
    rows = [row.split() for row in _file_text(shared / "packed-refs").splitlines()]
    return next((row[0][:10] for row in rows if len(row) == 2 and row[1] == name), "unknown")


def _file_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return "unknown"
