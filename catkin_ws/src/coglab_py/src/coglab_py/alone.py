"""A node does not take the place of a living one of its name: rospy would end that one, roslaunch would start it again,
and two launches on one ROS master would end each other's nodes for ever."""

from __future__ import annotations

import os
import sys
import time
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any, NoReturn
from xmlrpc.client import Error, ServerProxy, Transport

ANSWER_LIMIT = 2.0  # s for master and node to answer
PATIENCE = 2.0  # s for a node that is being started again and may still end


class _Brief(Transport):
    """Gives up after ANSWER_LIMIT s."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = ANSWER_LIMIT
        return connection


def _answer(uri: str, method: str, *words: object) -> Any:
    """The value of an XML-RPC call; None where nobody is there, or says no. TimeoutError where nobody answers."""
    try:
        code, _, value = getattr(ServerProxy(uri, transport=_Brief()), method)("/coglab_alone", *words)
    except TimeoutError:
        raise
    except (Error, HTTPException, OSError, TypeError, ValueError):
        return None
    return value if code == 1 else None


def _command(process: int) -> str:
    """The command line of a process of this computer, shortened."""
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return " ".join(Path(word.decode(errors="replace")).name for word in words if word)[:100]


def living(master: str, name: str) -> str:
    """Who has this node name with a master, in words: address, process and its command. Empty where nobody lives."""
    uri = _answer(master, "lookupNode", name)
    if not uri:
        return ""
    try:
        process = _answer(uri, "getPid")
    except TimeoutError:
        return f"{name} at {uri}, which does not answer"
    if process is None:
        return ""
    command = _command(process)
    return f"{name}, process {process}" + (f" ({command})" if command else f" at {uri}")


def refuse(sentence: str) -> NoReturn:
    """Ends the process with a sentence."""
    print(f"[coglab] error: {sentence}", file=sys.stderr, flush=True)
    sys.exit(1)


def init_node(name: str, **options: Any) -> None:
    """rospy.init_node, unless a living node has this name: then the process ends with a sentence."""
    import rosgraph.names
    import rospy

    own = rosgraph.names.load_mappings(sys.argv).get("__name", name)
    full = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), own)
    end = time.monotonic() + PATIENCE
    while there := _living(os.environ.get("ROS_MASTER_URI", ""), full):
        if time.monotonic() > end:
            refuse(f"another node has this name: {there}; end it first, or use a ROS master of your own")
        time.sleep(0.2)
    rospy.init_node(name, **options)


def _living(master: str, name: str) -> str:
    try:
        return living(master, name)
    except TimeoutError:  # of the master: rospy waits for it
        return ""
