#!/usr/bin/python3
"""check_physics.py: whether the physics of the simulated cell can be loaded.

For launch files (<param command=...>): of a library that is missing a program says no more than the loader's own line.
Prints "usable", or ends with 1 and a sentence on the error output.
"""

from __future__ import annotations

import sys


def complaint() -> str:
    """Why not, with what to do; empty if it can."""
    try:
        import coglab_sim._cell  # noqa: F401  (linked with what the cell is linked with)
    except ImportError as error:
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
