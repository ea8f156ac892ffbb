"""An actionlib client that misses no result."""

from __future__ import annotations

import threading
from typing import Any

import actionlib


class ActionClient(actionlib.SimpleActionClient):
    """A SimpleActionClient for goals that may end at once, for example by a refusal.

    SimpleActionClient ignores what arrives before its send_goal() has stored the goal. On a busy computer this can be
    the result; the client then waits until its time limit.
    """

    def __init__(self, ns: str, action: Any) -> None:
        self._sending = threading.RLock()
        super().__init__(ns, action)

    def send_goal(self, goal: Any, done_cb: Any = None, active_cb: Any = None, feedback_cb: Any = None) -> None:
        with self._sending:
            super().send_goal(goal, done_cb, active_cb, feedback_cb)

    def _handle_transition(self, gh: actionlib.ClientGoalHandle) -> None:
        with self._sending:
            super()._handle_transition(gh)
