"""A quiet end: threads that publish when rospy has just closed their topic leave no traceback."""

from __future__ import annotations

import threading
from typing import Any

import rospy
from coglab_py.steady import ending


def end_quietly() -> None:
    """From now on such a thread ends without a word, once rospy shuts down.

    Also threads of libraries, which cannot be told beforehand: actionlib's status loop.
    """
    report = threading.excepthook

    def hook(arguments: Any) -> None:
        if not (ending() and issubclass(arguments.exc_type, rospy.ROSException)):
            report(arguments)

    threading.excepthook = hook
