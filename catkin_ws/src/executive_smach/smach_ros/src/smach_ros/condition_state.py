"""A state that evaluates a condition repeatedly."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable
from typing import Any

import rospy
import smach

from smach_ros.util import TimeLimit, callback_userdata, register_callback, seconds

_POLL_RATE = rospy.Duration(0.05)


class ConditionState(smach.State):
    """Outcomes true, false and preempted.

    `cond_cb(ud)` is called every `poll_rate`. The outcome is true as soon as it returns true. It is
    false after `max_checks` + 1 calls (as in the original smach; -1: no limit), or after `timeout`
    (rospy.Duration or seconds; None: no limit). At shutdown the outcome is preempted. Raises
    InvalidUserCodeError if the function raises.

    Example::

        ConditionState(lambda ud: ud.count > 3, input_keys=["count"],
                       timeout=rospy.Duration(10), max_checks=-1)
    """

    def __init__(
        self,
        cond_cb: Callable[[Any], bool],
        input_keys: Iterable[str] = (),
        poll_rate: Any = _POLL_RATE,
        timeout: Any = None,
        max_checks: int = 1,
    ) -> None:
        super().__init__(["true", "false", "preempted"], input_keys)
        register_callback(self, "cond_cb", cond_cb)
        self._cond_cb, self._poll_rate = cond_cb, seconds(poll_rate) or 0.0
        self._timeout, self._max_checks = timeout, max_checks
        self._wake = threading.Event()

    def request_preempt(self) -> None:
        """Request the state to end early. Example: `state.request_preempt()`."""
        super().request_preempt()
        self._wake.set()

    def execute(self, ud: Any) -> str:
        """Evaluate the condition until it holds or a limit is reached. Called by a state machine."""
        self._drop_spent_preempt()
        view = callback_userdata(ud, self._cond_cb, self)
        limit = TimeLimit(self._timeout)
        checks = 0
        while not self.preempt_requested() and not rospy.is_shutdown():
            try:
                holds = self._cond_cb(view)
            except smach.InvalidUserCodeError:
                raise
            except Exception as error:
                raise smach.InvalidUserCodeError(
                    f"cond_cb raised {type(error).__name__}: {error}\n{traceback.format_exc()}"
                ) from error
            checks += 1
            if holds or (0 <= self._max_checks < checks) or limit.expired():
                self._spend_preempt()
                return "true" if holds else "false"
            self._wake.clear()
            if not self.preempt_requested():
                self._wake.wait(self._poll_rate)
        self.service_preempt()
        return "preempted"
