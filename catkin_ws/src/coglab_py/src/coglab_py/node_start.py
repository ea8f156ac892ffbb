"""Starts a node so that it replaces no other and can be ended at any moment.

If a node with its name ran, rospy would end that one, roslaunch would restart it, and two launches on one ROS master
would end each other's nodes again and again."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any, NoReturn
from xmlrpc.client import Error, ServerProxy, Transport

ANSWER_LIMIT = 2.0  # s, longest wait for master or node
HELD = 5.0  # s, longest time that the end of a node holds its main thread, or takes before the node is complete
PATIENCE = 2.0  # s in which a node that is being restarted may end


class _Brief(Transport):
    """HTTP transport with a time limit of ANSWER_LIMIT."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = ANSWER_LIMIT
        return connection


def answer(uri: str, method: str, *words: object) -> Any:
    """Value of an XML-RPC call; None if there is no server or it refuses. TimeoutError if it does not answer."""
    try:
        code, _, value = getattr(ServerProxy(uri, transport=_Brief()), method)("/coglab_alone", *words)
    except TimeoutError:
        raise
    except (Error, HTTPException, OSError, TypeError, ValueError):
        return None
    return value if code == 1 else None


def _command(process: int) -> str:
    """Command line of a process of this computer, shortened."""
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return " ".join(Path(word.decode(errors="replace")).name for word in words if word)[:100]


def living(master: str, name: str) -> str:
    """The running node with this name at a master, as text: address, process and command. Empty if there is none."""
    uri = answer(master, "lookupNode", name)
    if not uri:
        return ""
    try:
        process = answer(uri, "getPid")
    except TimeoutError:
        return f"{name} at {uri}, which does not answer (if its computer is off, remove it: rosnode cleanup)"
    if process is None:
        return ""
    command = _command(process)
    return f"{name}, process {process}" + (f" ({command})" if command else f" at {uri}")


def refuse(sentence: str) -> NoReturn:
    """Print an error and end the process with exit status 1."""
    print(f"[coglab] error: {sentence}", file=sys.stderr, flush=True)
    sys.exit(1)


def init_node(name: str, **options: Any) -> None:
    """rospy.init_node, unless a running node has this name. Then the process ends with an error message.

    `options` are those of rospy. Unless they contain disable_signals, SIGINT and SIGTERM end the node.
    """
    import rosgraph.names
    import rospy

    own = rosgraph.names.load_mappings(sys.argv).get("__name", name)
    full = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), own)
    end = time.monotonic() + PATIENCE
    while there := _living(os.environ.get("ROS_MASTER_URI", ""), full):
        if time.monotonic() > end:
            refuse(f"another node has this name: {there}; end it first, or use your own ROS master")
        time.sleep(0.2)
    signals = () if options.get("disable_signals") else (signal.SIGINT, signal.SIGTERM)
    for number in signals:
        signal.signal(number, _give_up)
    rospy.init_node(name, **{**options, "disable_signals": True})
    for number in signals:
        signal.signal(number, _shut_down)
    log_without_raising()


def _give_up(number: int, _frame: object) -> None:
    """End a process whose node is not complete: its main thread waits for the master and holds rospy's locks."""
    late = threading.Timer(HELD, os._exit, (1,))
    late.daemon = True
    late.start()
    sys.exit(0)


def _shut_down(number: int, _frame: object) -> None:
    """End the node in a thread of its own. rospy does it inside the signal handler, and so interrupts the main thread:
    if that one calls the master at this moment, it holds the lock that rospy then waits for, for ever.

    The main thread stands meanwhile, as with rospy, so that it publishes on no closed topic; but HELD s at most.
    """
    import rospy

    end = threading.Thread(target=rospy.signal_shutdown, args=(f"signal {number}",), name="shutdown")
    end.start()
    end.join(HELD)


def log_without_raising() -> None:
    """Make the log handlers of this process drop what they cannot write. rospy's own handlers raise from the log call,
    so that a full disk would end the thread that logs."""
    logging.raiseExceptions = False
    loggers = [logging.getLogger(), *map(logging.getLogger, logging.Logger.manager.loggerDict)]
    for handler in {handler for logger in loggers for handler in logger.handlers}:
        _drop_unwritable(handler)


def _drop_unwritable(handler: logging.Handler) -> None:
    emit = handler.emit

    def emit_or_drop(record: logging.LogRecord) -> None:
        try:
            emit(record)
        except OSError:
            pass

    handler.emit = emit_or_drop  # type: ignore[assignment]


def _living(master: str, name: str) -> str:
    try:
        return living(master, name)
    except TimeoutError:  # the master did not answer: rospy waits for it
        return ""
