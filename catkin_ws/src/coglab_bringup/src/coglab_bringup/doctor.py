"""./coglab doctor: reports what is missing on this computer and how to install it. Standard library only."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

Finding = tuple[bool, str]  # True if it is fine; a sentence, with the remedy if it is not


def package_groups(top: Path) -> dict[str, list[str]]:
    """Package names by group, from debian-packages.txt."""
    groups: dict[str, list[str]] = {}
    for line in (top / "debian-packages.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            group, names = line.split(":", 1)
            groups.setdefault(group, []).extend(names.split())
    return groups


def installed(packages: list[str]) -> set[str]:
    """The installed ones of these Debian packages."""
    query = ["dpkg-query", "-W", "-f=${db:Status-Status} ${Package}\n", *packages]
    found = subprocess.run(query, capture_output=True, text=True, check=False).stdout  # lacks unknown packages
    return {line.split()[1] for line in found.splitlines() if line.startswith("installed ")}


def release() -> dict[str, str]:
    """Fields of /etc/os-release."""
    lines = Path("/etc/os-release").read_text().splitlines()
    return {key: value.strip('"') for key, _, value in (line.partition("=") for line in lines)}


def smach_copies(top: Path) -> list[Path]:
    """Foreign folders in the workspace or the ROS paths that contain a package smach, smach_msgs or smach_ros."""
    ours = top / "catkin_ws" / "src" / "executive_smach"
    places = [top / "catkin_ws" / "src", Path("/opt/ros"), Path("/usr/share")]
    places += [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if p]
    copies: set[Path] = set()
    for place in places:
        for name in ("smach", "smach_msgs", "smach_ros"):
            patterns = (f"{name}/package.xml", f"*/{name}/package.xml", f"*/share/{name}/package.xml")
            for pattern in patterns:
                copies.update(found.parent for found in place.glob(pattern) if ours not in found.parents)
    return sorted(copies)


def package_findings(top: Path) -> Iterator[Finding]:
    """Findings on the Debian packages of each group."""
    optional = {
        "browser": "no browser is installed (only needed to test the console)",
        "viz": "rviz is not installed (only needed where there is a screen)",
        "docs": "Sphinx is not installed (only needed to build the documentation site)",
        "film": "nothing is installed to draw pictures without a screen (only needed for ./coglab film)",
    }
    for group, packages in package_groups(top).items():
        there = installed(packages)
        missing = [package for package in packages if package not in there]
        get = f"./coglab install {group}"
        if missing and group in optional:
            yield True, f"{optional[group]}: {get}"
        elif missing:
            yield False, f"packages to {group}: missing {' '.join(missing)}; get them: {get}"
        else:
            yield True, f"packages to {group}: all {len(packages)} installed"


def environment_findings(top: Path) -> Iterator[Finding]:
    """Findings on other Pythons, other ROS distributions and other copies of smach."""
    python = shutil.which("python3")
    if python != "/usr/bin/python3":
        yield True, f"python3 in your PATH is {python}; ./coglab uses /usr/bin/python3 anyway, as does devel/setup.bash"
    # If it was built with --upstream-smach, the environment of this workspace contains /opt/ros.
    own, names = f"{top}/catkin_ws/", ("ROS_DISTRO", "ROS_ROOT", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH")
    values = {name: os.environ.get(name, "") for name in names}
    foreign = [name for name, value in values.items() if "/opt/ros" in value and own not in value]
    if foreign:
        what = f"a ROS from /opt/ros is in {', '.join(foreign)}"
        yield False, f"{what}; open a shell without it and source devel/setup.bash"
    cache = top / "catkin_ws" / "build" / "CMakeCache.txt"
    if cache.is_file() and "=smach;smach_msgs;smach_ros" in cache.read_text():
        yield True, "smach: upstream's, as built with --upstream-smach; ours again: ./coglab build"
        return
    for copy in smach_copies(top):
        what = f"a second copy of {copy.name} lies in {copy}"
        yield False, f"{what}; remove it, or use it: ./coglab build --upstream-smach"


def findings(top: Path) -> Iterator[Finding]:
    """All findings."""
    system = release()
    fine = system.get("VERSION_CODENAME") in ("bookworm", "trixie")
    name = system.get("PRETTY_NAME", "unknown")
    yield fine, f"release: {name}" + ("" if fine else "; use Debian 12 or 13, or a container: docker/run")
    yield from package_findings(top)
    built = (top / "catkin_ws" / "devel" / "setup.bash").exists()
    yield built, "workspace: built" if built else "workspace: not built yet; do it: ./coglab build"
    yield from environment_findings(top)
    host = socket.gethostname()
    try:
        socket.getaddrinfo(host, None)
    except OSError:
        yield True, f"the host name {host} does not resolve; harmless, because ROS_IP=127.0.0.1 is set"
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    if load > cores:
        slow = "a simulated cell runs slower than real time and answers to a robot may come late"
        yield True, f"this computer is busy: load {load:.1f} on {cores} cores; {slow}: end other programs"
    if shutil.disk_usage(top).free < 2e9:
        yield False, "less than 2 GB free on the disk of this folder; make room before building"


def main(arguments: list[str]) -> int:
    """Print the findings. Exit status 0 if all are fine."""
    found = list(findings(Path(arguments[0])))
    for fine, sentence in found:
        print(("ok       " if fine else "MISSING  ") + sentence)
    if all(fine for fine, _ in found):
        print("Everything is here: ./coglab demo")
        return 0
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
