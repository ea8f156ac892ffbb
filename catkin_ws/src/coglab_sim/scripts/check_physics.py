#!/usr/bin/python3
"""check_physics.py: whether the physics of the simulated cell can be loaded.

For launch files (<param command=...>): a program whose library is missing prints nothing but the loader's line.
Prints "usable", or ends with 1 and a sentence on the error output.
"""

from __future__ import annotations

import ctypes
import sys


def complaint() -> str:
    """Why not, with what to do; empty if it can."""
    try:
        ctypes.CDLL("libcoglab_sim_plant.so")  # with what the cell is linked with
    except OSError as error:
        return (
            f"the simulated cell cannot be loaded ({error}): its library is missing or was not built; "
            "run ./coglab build, which also installs Debian's libmujoco-dev; ./coglab doctor says what else is missing"
        )
    return ""


def main() -> int:
    """Exit status: 0 usable, 1 not."""
    found = complaint()
    if found:
        print(found, file=sys.stderr)
        return 1
    sys.stdout.write("usable")
    return 0


if __name__ == "__main__":
    sys.exit(main())
