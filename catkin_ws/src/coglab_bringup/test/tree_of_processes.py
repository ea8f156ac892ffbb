"""Finds the processes of one run among all others: those that inherited a variable of its environment."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable
from pathlib import Path

VARIABLE = "COGLAB_TEST_RUN"


class Marked:
    """An environment that marks every process started with it, and the list of those that are alive."""

    def __init__(self) -> None:
        self._mark = f"{VARIABLE}={uuid.uuid4().hex}"

    def environment(self, **more: str) -> dict[str, str]:
        """This environment, marked."""
        name, value = self._mark.split("=")
        return {**os.environ, **more, name: value}

    def alive(self) -> dict[int, str]:
        """Process id and command line of every marked process that is no zombie."""
        found = {}
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                if self._mark.encode() in (folder / "environ").read_bytes().split(b"\0"):
                    found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode().strip()
            except OSError:
                continue
        return found


def wait_until(condition: Callable[[], bool], limit: float) -> bool:
    """True if the condition became true within `limit` seconds."""
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True
