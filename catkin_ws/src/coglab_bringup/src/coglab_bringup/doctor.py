"""./coglab doctor: says in words what is missing on this machine and how to get it. Needs nothing but Python."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

OPTIONAL = {
    "browser": "no browser is installed (only needed to test the console)",
    "viz": "rviz is not installed (only needed where there is a screen)",
    "docs": "Sphinx is not installed (only needed to build the documentation site)",
    "film": "nothing is installed to draw pictures without a screen (only needed for ./coglab film)",
}


def package_groups(top: Path) -> dict[str, list[str]]:
    """Groups of debian-packages.txt with their packages."""
    groups: dict[str, list[str]] = {}
    for line in (top / "debian-packages.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            group, names = line.split(":", 1)
            groups.setdefault(group, []).extend(names.split())
    return groups


def installed(packages: list[str]) -> set[str]:
    """Those of these Debian packages that are installed."""
    query = ["dpkg-query", "-W", "-f=${db:Status-Status} ${Package}\n", *packages]
    found = subprocess.run(query, capture_output=True, text=True, check=False).stdout  # unknown names are left out
    return {line.split()[1] for line in found.splitlines() if line.startswith("installed ")}


def release() -> dict[str, str]:
    """Fields of /etc/os-release."""
    lines = Path("/etc/os-release").read_text().splitlines()
    return {key: value.strip('"') for key, _, value in (line.partition("=") for line in lines)}


def smach_copies(top: Path) -> list[Path]:
    """Folders outside our own, in the workspace or ROS paths, that hold a package smach, smach_msgs or smach_ros."""
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


def package_findings(top: Path) -> list[tuple[bool, str]]:
    """Whether the Debian packages of each group are installed."""
    result: list[tuple[bool, str]] = []
    for group, packages in package_groups(top).items():
        there = installed(packages)
        missing = [package for package in packages if package not in there]
        if missing and group in OPTIONAL:
            result.append((True, f"{OPTIONAL[group]}: ./coglab install {group}"))
        elif missing:
            result.append(
                (False, f"packages to {group}: missing {' '.join(missing)}; get them: ./coglab install {group}")
            )
        else:
            result.append((True, f"packages to {group}: all {len(packages)} installed"))
    return result


def findings(top: Path) -> list[tuple[bool, str]]:
    """Each finding: whether it is fine, and a sentence (with what to do where it is not)."""
    result: list[tuple[bool, str]] = []
    system = release()
    fine = system.get("VERSION_CODENAME") in ("bookworm", "trixie")
    name = system.get("PRETTY_NAME", "unknown")
    result.append((fine, f"release: {name}" + ("" if fine else "; use Debian 12 or 13, or a container: docker/run")))
    result += package_findings(top)
    built = (top / "catkin_ws" / "devel" / "setup.bash").exists()
    result.append((built, "workspace: built" if built else "workspace: not built yet; do it: ./coglab build"))
    python = shutil.which("python3")
    if python != "/usr/bin/python3":
        result.append(
            (
                True,
                f"python3 in your PATH is {python}; ./coglab uses /usr/bin/python3 anyway, as does devel/setup.bash",
            )
        )
    # The environment of this workspace names /opt/ros itself, where it was built with --upstream-smach.
    own = f"{top}/catkin_ws/"
    foreign = [
        v
        for v in ("ROS_DISTRO", "ROS_ROOT", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH")
        if "/opt/ros" in os.environ.get(v, "") and own not in os.environ.get(v, "")
    ]
    if foreign:
        result.append(
            (
                False,
                f"a ROS from /opt/ros is in {', '.join(foreign)}; open a shell without it and source devel/setup.bash",
            )
        )
    cache = top / "catkin_ws" / "build" / "CMakeCache.txt"
    upstream = cache.is_file() and "=smach;smach_msgs;smach_ros" in cache.read_text()
    if upstream:
        result.append((True, "smach: upstream's, as built with --upstream-smach; ours again: ./coglab build"))
    for copy in [] if upstream else smach_copies(top):
        result.append(
            (
                False,
                f"a second copy of {copy.name} lies in {copy}; remove it, or use it: ./coglab build --upstream-smach",
            )
        )
    try:
        socket.getaddrinfo(socket.gethostname(), None)
    except OSError:
        result.append(
            (True, f"the host name {socket.gethostname()} does not resolve; harmless, because ROS_IP=127.0.0.1 is set")
        )
    load, cores = os.getloadavg()[0], os.cpu_count() or 1
    if load > cores:
        result.append(
            (
                True,
                f"this computer is busy: load {load:.1f} on {cores} cores; a simulated cell runs slower than real time "
                "and answers to a robot may come late: end other programs",
            )
        )
    if shutil.disk_usage(top).free < 2e9:
        result.append((False, "less than 2 GB free where this folder lies; make room before building"))
    return result


def main(arguments: list[str]) -> int:
    """Prints the findings; exit status 0 if all are fine."""
    found = findings(Path(arguments[0]))
    for fine, sentence in found:
        print(("ok       " if fine else "MISSING  ") + sentence)
    if all(fine for fine, _ in found):
        print("Everything is here: ./coglab demo")
        return 0
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
