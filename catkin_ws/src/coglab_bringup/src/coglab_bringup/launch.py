"""./coglab launch: the plain launch file on a master port of its own, so that several run side by side."""

from __future__ import annotations

import os
import sys

from coglab_bringup.run_directory import free_port, port_is_free, run_environment


def main(arguments: list[str]) -> int:
    """Replaces this process by roslaunch; `-p PORT` picks the master port, all else goes to roslaunch."""
    port = 0
    if "-p" in arguments:
        at = arguments.index("-p")
        try:
            port = int(arguments[at + 1])
        except (IndexError, ValueError):
            print("[coglab] error: -p expects a port number, such as -p 11411", file=sys.stderr)
            return 2
        del arguments[at : at + 2]
        if not port_is_free(port):
            print(
                f"[coglab] error: port {port} is in use by another program; leave out -p for a free one",
                file=sys.stderr,
            )
            return 1
    port = port or free_port()
    environment = run_environment(port)
    print(f"[coglab] in another terminal: export ROS_MASTER_URI={environment['ROS_MASTER_URI']}", flush=True)
    command = ["roslaunch", "-p", str(port), "coglab_bringup", "coglab.launch", *arguments]
    os.execvpe(command[0], command, environment)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
