#!/usr/bin/python3
"""check_files.py ARGUMENT:=VALUE ...: checks that the files in the arguments of a launch file are usable.

For launch files (<param command=...>): runs before any node is started, because a node with an unreadable file
restarts again and again, or runs without it. Prints "usable", or ends with 1 and one sentence. The nodes themselves
check the contents of controllers, signals, primitives, patterns and objects.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType

from coglab_bringup.launch_files import check
from coglab_py.node_start import refuse

LIMIT = 60  # s. It imports modules of the user; one that waits for ever would block the launch.


def late(_signal: int, _frame: FrameType | None) -> None:
    """Ends an import that takes too long. Raises TimeoutError there."""
    raise TimeoutError(f"checking the files took over {LIMIT} s; does a module wait while it is imported?")


def main(words: list[str]) -> int:
    """Exit status: 0 usable, 1 not."""
    signal.signal(signal.SIGALRM, late)
    signal.alarm(LIMIT)
    try:
        check(dict(word.split(":=", 1) for word in words))
    except (ValueError, TimeoutError) as error:
        refuse(str(error))
    sys.stdout.write("usable")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
