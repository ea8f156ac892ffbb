"""`./coglab controller run FILE`: finds the running system, then calls coglab.control.run."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from coglab.control.run import run
from coglab_py.running_systems import NoSystem, find_master


def main(words: list[str]) -> int:
    """Command line. A user's own ROS master counts even if no brain runs there."""
    if {"-h", "--help"} & set(words):
        return run(["--help"])
    own = os.environ.get("COGLAB_USER_MASTER", "")
    try:
        os.environ["ROS_MASTER_URI"] = find_master(Path(os.environ["COGLAB_TOP"]), 0, own)
    except NoSystem as error:
        if not own:
            print(f"error: {error}", file=sys.stderr)
            return 1
        os.environ["ROS_MASTER_URI"] = own
    return run(words)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
