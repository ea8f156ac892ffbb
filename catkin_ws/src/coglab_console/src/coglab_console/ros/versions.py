"""Versions for the page's Health: of this software, of ROS and of the Debian packages that the console stands on."""

from __future__ import annotations

import platform
import subprocess
from pathlib import Path

import rospkg

PACKAGES = (
    "python3-rospy", "python3-aiohttp", "python3-numpy", "python3-scipy", "libjs-three", "libjs-dygraphs", "graphviz",
)  # fmt: skip
LIMIT = 5.0  # s, for dpkg


def of_everything() -> dict[str, str]:
    """Version by name; what is not there says so."""
    return {
        "CogLab": _own(),
        "Debian": _text(Path("/etc/debian_version")),
        "Linux": platform.release(),
        "Python": platform.python_version(),
        **debian(PACKAGES),
    }


def debian(names: tuple[str, ...]) -> dict[str, str]:
    """Version of each Debian package, in one question to dpkg."""
    try:
        command = ["dpkg-query", "-W", "-f=${db:Status-Status} ${Package} ${Version}\n", *names]
        lines = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT).stdout.splitlines()
    except (OSError, subprocess.TimeoutExpired):
        return dict.fromkeys(names, "unknown: dpkg did not answer")
    rows = [line.split() for line in lines]
    found = {row[1]: row[2] for row in rows if len(row) == 3 and row[0] == "installed"}
    return {name: found.get(name, "not installed") for name in names}


def _own() -> str:
    """Version of the package, and the commit where this is a checkout."""
    packages = rospkg.RosPack()
    try:
        found = str(packages.get_manifest("coglab_console").version)
        here = Path(packages.get_path("coglab_console")).resolve()
    except rospkg.ResourceNotFound:
        return "unknown"
    top = next((folder for folder in here.parents if (folder / ".git").exists()), None)
    return f"{found}, commit {commit(top)}" if top is not None else found


def commit(top: Path) -> str:
    """Short name of the commit that a checkout stands at, read from its files."""
    entry = top / ".git"
    if entry.is_file():  # a worktree names its folder
        entry = top / _text(entry).removeprefix("gitdir: ")
    head = _text(entry / "HEAD")
    if not head.startswith("ref: "):
        return head[:10]
    name = head.removeprefix("ref: ")
    shared = entry / _text(entry / "commondir") if (entry / "commondir").is_file() else entry
    if (shared / name).is_file():
        return _text(shared / name)[:10]
    rows = [row.split() for row in _text(shared / "packed-refs").splitlines()]
    return next((row[0][:10] for row in rows if len(row) == 2 and row[1] == name), "unknown")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return "unknown"
