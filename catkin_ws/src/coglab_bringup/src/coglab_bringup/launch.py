"""./coglab launch: runs the launch file on its own master port, so that several systems can run side by side."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from coglab_py.running_systems import record_run

from coglab_bringup.launch_arguments import judge_launch, split_port, whole_path
from coglab_bringup.run_directory import free_port, lasting_home, port_is_free, print_load, run_environment
from coglab_bringup.usage import Refused


def main(arguments: list[str]) -> int:
    """Replace this process by roslaunch. `-p PORT` selects the master port; other arguments go to roslaunch."""
    top = Path(os.environ["COGLAB_TOP"])
    try:
        judge_launch(top, arguments)
        port, words = split_port(arguments)
    except Refused as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 2
    if port and not port_is_free(port):
        print(f"[coglab] error: port {port} is in use by another program; leave out -p for a free one", file=sys.stderr)
        return 1
    port = port or free_port()
    home, _lock = lasting_home(top)  # kept between runs: it stores which object the hand holds
    environment = run_environment(port, home)
    record_run(top, port, "launch")
    print_load()
    print(
        "[coglab] in another terminal: ./coglab status, ./coglab start; for ROS tools: ./coglab shell, and in it",
        flush=True,
    )
    print(f"[coglab]   export ROS_MASTER_URI={environment['ROS_MASTER_URI']}", flush=True)
    command = ["roslaunch", "-p", str(port), "coglab_bringup", "coglab.launch", *map(whole_path, words)]
    os.execvpe(command[0], command, environment)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
