"""Log functions of the engine, and its check for a shutdown of the process.

The engine keeps no reference to a logger. It looks the functions up as attributes of the package
(`smach.logerr(...)`) at each call, so that `set_loggers` takes effect everywhere at once.

Example::

    import logging, smach
    log = logging.getLogger("machine")
    smach.set_loggers(log.info, log.warning, log.debug, log.error)
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TextIO

Logger = Callable[[str], object]


def _write(level: str, message: object, stream: TextIO) -> None:
    print(f"[ {level} ] : {message}", file=stream)


def loginfo(message: object) -> None:
    """Print information to stdout. Example: `smach.loginfo("started")`."""
    _write("INFO", message, sys.stdout)


def logwarn(message: object) -> None:
    """Print a warning to stderr. Example: `smach.logwarn("key 'x' is missing")`."""
    _write("WARN", message, sys.stderr)


def logdebug(message: object) -> None:
    """Print a debug message to stdout. Example: `smach.logdebug("released the children")`."""
    _write("DEBUG", message, sys.stdout)


def logerr(message: object) -> None:
    """Print an error to stderr. Example: `smach.logerr("state 'A' raised")`."""
    _write("ERROR", message, sys.stderr)


def is_shutdown() -> bool:
    """True while the process shuts down. Always False without ROS. See `set_shutdown_check`.

    Example: `while not smach.is_shutdown(): ...`.
    """
    return False


def set_loggers(info: Logger, warn: Logger, debug: Logger, error: Logger) -> None:
    """Replace the engine's log functions. Note the order of the four.

    Example: `set_loggers(rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr)`.
    Raises TypeError if one of them is not callable; then no function is replaced.
    """
    functions = {"loginfo": info, "logwarn": warn, "logdebug": debug, "logerr": error}
    for name, function in functions.items():
        if not callable(function):
            raise TypeError(f"set_loggers: {name} must be callable, got {type(function).__name__}")
    _rebind(functions)


def set_shutdown_check(check: Callable[[], bool]) -> None:
    """Replace `smach.is_shutdown`. Machines call it between states and while they wait.

    Example: `set_shutdown_check(rospy.is_shutdown)`. Raises TypeError if `check` is not callable.
    """
    if not callable(check):
        raise TypeError(f"set_shutdown_check: expected a callable, got {type(check).__name__}")
    _rebind({"is_shutdown": check})


def _rebind(functions: dict[str, Callable]) -> None:
    package = sys.modules[__package__]
    for module in (package, sys.modules[__name__]):
        for name, function in functions.items():
            setattr(module, name, function)
