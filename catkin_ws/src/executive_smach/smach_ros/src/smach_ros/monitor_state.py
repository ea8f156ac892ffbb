"""A state that watches a topic."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable
from typing import Any

import rospy
import smach

from smach_ros.util import POLL, callback_userdata, register_callback


class MonitorState(smach.State):
    """Outcomes valid, invalid and preempted.

    `cond_cb(ud, msg)` is called for each message. If it returns false or raises, the outcome is invalid.
    After `max_checks` true results the outcome is valid (-1: no limit). At shutdown the outcome is
    preempted.

    Example::

        MonitorState("/contact", Bool, lambda ud, msg: not msg.data)     # invalid: touched
    """

    def __init__(
        self,
        topic: str,
        msg_type: type,
        cond_cb: Callable[[Any, Any], bool],
        max_checks: int = -1,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(["valid", "invalid", "preempted"], input_keys, output_keys)
        register_callback(self, "cond_cb", cond_cb)
        self._topic, self._msg_type, self._cond_cb = topic, msg_type, cond_cb
        self._max_checks = max_checks
        self._wake = threading.Event()

    def request_preempt(self) -> None:
        """Request the state to end early. Example: `state.request_preempt()`."""
        super().request_preempt()
        self._wake.set()

    def execute(self, ud: Any) -> str:
        """Watch the topic until the condition determines the outcome.

        Example: called by a state machine, or `state.execute(smach.UserData())`.
        """
        self._drop_spent_preempt()
        run = _Watch(self, ud)
        if not self.preempt_requested():
            subscriber = rospy.Subscriber(self._topic, self._msg_type, run.on_message)
            try:
                while run.outcome is None and not self.preempt_requested() and not rospy.is_shutdown():
                    self._wake.wait(POLL)
                    self._wake.clear()
            finally:
                run.over = True
                subscriber.unregister()
        if run.outcome is not None:
            self._spend_preempt()
            return run.outcome
        self.service_preempt()
        return "preempted"


class _Watch:
    """One execution of a MonitorState: counts the results and stores the outcome."""

    def __init__(self, state: MonitorState, ud: Any) -> None:
        self.outcome: str | None = None
        self.over = False
        self._state = state
        self._ud = callback_userdata(ud, state._cond_cb, state)
        self._left = state._max_checks
        self._lock = threading.Lock()

    def on_message(self, msg: Any) -> None:
        with self._lock:
            if self.over or self.outcome is not None:
                return
            try:
                valid = self._state._cond_cb(self._ud, msg)
            except Exception:
                smach.logerr(f"cond_cb on topic '{self._state._topic}' raised:\n{traceback.format_exc()}")
                valid = False
            self._left -= 1
            if not valid:
                self.outcome = "invalid"
            elif self._left == 0:
                self.outcome = "valid"
        if self.outcome is not None:
            self._state._wake.set()
