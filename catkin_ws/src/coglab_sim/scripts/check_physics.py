#!/usr/bin/python3
"""check_physics.py: checks that the physics library of the simulated cell can be loaded.

For launch files (<param command=...>), because a program with a missing library prints only the loader's line.
Prints "usable", or writes a sentence to stderr and exits with 1.
"""

from __future__ import annotations

import ctypes
import sys


def complaint() -> str:
    """Returns the reason and the remedy if the library cannot be loaded, else an empty string."""
    try:
        ctypes.CDLL("libcoglab_sim_plant.so")  # also loads the libraries that the cell links
    except OSError as error:
        return (
            f"the simulated cell cannot be loaded ({error}): its library is missing or was not built; "
            "run ./coglab build, which also installs Debian's libmujoco-dev; ./coglab doctor says what else is missing"
        )
    return ""


def main() -> int:
    """Returns the exit status: 0 usable, 1 not usable."""
    found = complaint()
    if found:
        print(found, file=sys.stderr)
        return 1
    sys.stdout.write("usable")
    return 0


if __name__ == "__main__":
    sys.exit(main())
