#!/usr/bin/python3
"""check_files.py ARGUMENT:=VALUE ...: whether the files that a launch file names can be used.

For launch files (<param command=...>): runs before any node is started, because a node that cannot read its file is
started again and again, or runs without it. Prints "usable", or ends with 1 and one sentence. What controllers,
signals, primitives, patterns and objects mean is checked by the nodes that read them.
"""

from __future__ import annotations

import sys

from coglab_bringup.launch_files import check
from coglab_py.alone import refuse


def main(words: list[str]) -> int:
    """Exit status: 0 usable, 1 not."""
    try:
        check(dict(word.split(":=", 1) for word in words))
    except ValueError as error:
        refuse(str(error))
    sys.stdout.write("usable")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
