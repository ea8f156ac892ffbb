"""New processes that find the packages of this workspace."""

from __future__ import annotations

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor


def search_workspace_first() -> None:
    """Moves the folders of PYTHONPATH to the front of ``sys.path``. A new process takes over this path. The packages of
    catkin's devel space put their source folders before it, in which there are no compiled modules."""
    first = [one for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one in sys.path]
    sys.path[:] = first + [one for one in sys.path if one not in first]


def processes(count: int) -> ProcessPoolExecutor:
    """Returns ``count`` new processes for functions of modules. The main script needs
    ``if __name__ == "__main__":``, because each process imports it."""
    search_workspace_first()
    return ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"))
