"""One console for each ROS master: two would show two operators, and a node of the same name would end the first.

A lock in ROS_HOME, which is free as soon as its process has ended, and for consoles of another ROS_HOME or computer a
parameter of the master with the address and the number of the console's process. The parameter outlives a console that
was killed; so the process is asked whether it is still there.
"""

from __future__ import annotations

import fcntl
import os
import time
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from xmlrpc.client import Error, ServerProxy, Transport

import rosgraph

PLACE = "/coglab_console_place"
PATIENCE = 2.0  # s for one that is being respawned and may still end
ANSWER_LIMIT = 2.0  # s for another console to say its process


class StartError(Exception):
    """The console cannot begin; the sentence says what to do."""


class _Brief(Transport):
    """Gives up after ANSWER_LIMIT s."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = ANSWER_LIMIT
        return connection


def only_one(home: Path) -> int:
    """A lock that one console of this ROS master holds until its process ends."""
    master = urlsplit(os.environ.get("ROS_MASTER_URI", "")).port or 11311
    lock = os.open(home / f"console_{master}.lock", os.O_RDWR | os.O_CREAT, 0o600)
    for _ in range(round(PATIENCE / 0.1)):
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return lock
        except OSError:
            time.sleep(0.1)
    raise StartError(f"another console of this ROS master runs; its link is in {home / 'console.url'}")


def announce(master: rosgraph.Master, uri: str) -> None:
    """Tells where this console's node is."""
    master.setParam(PLACE, [uri, os.getpid()])


def look_for_another(master: rosgraph.Master) -> None:
    """StartError where a console of this master runs already; before a node is made, whose name would end the other."""
    end = time.monotonic() + PATIENCE
    while True:
        found = _another(master)
        if not found:
            return
        if time.monotonic() > end:
            raise StartError(f"another console of this ROS master runs{found}; use its page, or end it first")
        time.sleep(0.1)


def _another(master: rosgraph.Master) -> str:
    """Where another console is, in words; empty where there is none, or no master to be asked."""
    try:
        uri, process = master.getParam(PLACE)
        if not isinstance(uri, str):
            return ""
        answer: Any = ServerProxy(uri, transport=_Brief()).getPid("/coglab_console")
        return f" at {uri}, process {process}" if answer[2] == process else ""
    except TimeoutError:
        return f" at {uri} but does not answer"
    except (rosgraph.MasterException, Error, HTTPException, OSError, TypeError, ValueError, IndexError):
        return ""
