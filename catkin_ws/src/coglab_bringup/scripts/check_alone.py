#!/usr/bin/python3
"""check_alone.py: checks that no CogLab system runs yet on the ROS master of a launch file.

For launch files (<param command=...>): runs before any node is started. Prints "alone", or ends with 1 and a sentence.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from coglab_py.node_start import living, refuse

NODES = ("robot", "lwr", "controller_manager", "coglab")  # every system has at least one of them
LOOKS_ONLY = {"--dump-params", "--nodes", "--files", "--args", "--find-node", "--ros-args"}  # roslaunch starts nothing


def main() -> int:
    """Exit status: 0 alone, 1 not."""
    parent = set(Path(f"/proc/{os.getppid()}/cmdline").read_bytes().decode(errors="replace").split("\0"))
    master = os.environ.get("ROS_MASTER_URI", "http://127.0.0.1:11311")
    space = os.environ.get("ROS_NAMESPACE", "").strip("/")
    for name in () if parent & LOOKS_ONLY else NODES:
        try:
            there = living(master, f"/{space}/{name}" if space else f"/{name}")
        except TimeoutError:
            refuse(f"the ROS master {master} does not answer; end the program there")
        if there:
            refuse(
                f"a system runs already on the ROS master {master}: {there}. End it first, or give this one a master "
                "of its own: ./coglab launch, or roslaunch -p PORT"
            )
    sys.stdout.write("alone")
    return 0


if __name__ == "__main__":
    sys.exit(main())
