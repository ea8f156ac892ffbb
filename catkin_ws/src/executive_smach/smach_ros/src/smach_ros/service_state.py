"""A state that calls a service."""

from __future__ import annotations

import copy
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import rospy
import smach

from smach_ros.util import POLL, callback_userdata, check_slots, register_callback, service_answers

#: Interval (s) at which the master is queried for a service that does not exist yet.
SERVICE_POLL = 0.2


class ServiceState(smach.State):
    """Outcomes succeeded, aborted and preempted, and the outcomes that `response_cb` returns.

    The request is built in this order: `request` (copied each time), user data `request_key` (a whole
    request), `request_slots` (user data keys with the names of its fields), `request_cb(ud, request,
    *args, **kwargs)`, whose return value replaces it unless None. `response_cb(ud, response, *args,
    **kwargs)` may return an outcome. Then user data `response_key` and `response_slots` are
    written.

    The state waits for the service until it is preempted or rospy shuts down. A running call cannot be
    cancelled; at shutdown it is abandoned.

    Example::

        StateMachine.add("RESET", ServiceState("/lwr/reset", Trigger, response_slots=["message"]),
                         transitions={"succeeded": "GO"})
    """

    def __init__(
        self,
        service_name: str,
        service_spec: Any,
        request: Any = None,
        request_cb: Callable | None = None,
        request_cb_args: Sequence = (),
        request_cb_kwargs: Mapping[str, Any] | None = None,
        request_key: str | None = None,
        request_slots: Iterable[str] = (),
        response_cb: Callable | None = None,
        response_cb_args: Sequence = (),
        response_cb_kwargs: Mapping[str, Any] | None = None,
        response_key: str | None = None,
        response_slots: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
    ) -> None:
        super().__init__(["succeeded", "aborted", "preempted"], input_keys, output_keys)
        self.register_outcomes(outcomes)
        request_slots, response_slots = tuple(request_slots), tuple(response_slots)
        check_slots(self, "request_slots", request_slots, service_spec._request_class)
        check_slots(self, "response_slots", response_slots, service_spec._response_class)
        register_callback(self, "request_cb", request_cb)
        register_callback(self, "response_cb", response_cb)
        self.register_input_keys([*([request_key] if request_key else []), *request_slots])
        self.register_output_keys([*([response_key] if response_key else []), *response_slots])

        self._service_name, self._service_spec = service_name, service_spec
        self._request, self._request_key, self._request_slots = request, request_key, request_slots
        self._request_cb, self._request_cb_args = request_cb, tuple(request_cb_args)
        self._request_cb_kwargs = dict(request_cb_kwargs or {})
        self._response_key, self._response_slots = response_key, response_slots
        self._response_cb, self._response_cb_args = response_cb, tuple(response_cb_args)
        self._response_cb_kwargs = dict(response_cb_kwargs or {})

    def execute(self, ud: Any) -> str:
        """Call the service. Called by a state machine. Example: `state.execute(smach.UserData())`."""
        self._drop_spent_preempt()
        try:
            return self._execute(ud)
        finally:
            self._spend_preempt()

    def _execute(self, ud: Any) -> str:
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        outcome = self._await_service()
        if outcome is not None:
            return outcome
        try:
            request = self._make_request(ud)
        except Exception:
            smach.logerr(f"request to service '{self._service_name}' could not be made:\n{traceback.format_exc()}")
            return "aborted"
        response = self._call_service(request)
        if response is None:
            return "aborted"
        try:
            return self._take_response(ud, response)
        except Exception:
            smach.logerr(f"response of service '{self._service_name}' not taken:\n{traceback.format_exc()}")
            return "aborted"

    def _await_service(self) -> str | None:
        """None when the service exists, otherwise the outcome."""
        logged = False
        while not service_answers(self._service_name):
            if self.preempt_requested():
                self.service_preempt()
                return "preempted"
            if rospy.is_shutdown():
                return "aborted"
            if not logged:
                logged = True
                smach.logwarn(f"waiting for service '{rospy.resolve_name(self._service_name)}'")
            time.sleep(SERVICE_POLL)
        return None

    def _make_request(self, ud: Any) -> Any:
        request = self._service_spec._request_class() if self._request is None else copy.deepcopy(self._request)
        if self._request_key is not None:
            request = copy.copy(ud[self._request_key]) if self._request_slots else ud[self._request_key]
        for slot in self._request_slots:
            setattr(request, slot, ud[slot])
        if self._request_cb is not None:
            made = self._request_cb(
                callback_userdata(ud, self._request_cb, self),
                request,
                *self._request_cb_args,
                **self._request_cb_kwargs,
            )
            if made is not None:
                request = made
        return request

    def _call_service(self, request: Any) -> Any:
        """The response, or None if the call failed or rospy shut down."""
        answer: list[Any] = []
        done = threading.Event()

        def call() -> None:
            try:
                answer.append(rospy.ServiceProxy(self._service_name, self._service_spec)(request))
            except Exception as error:
                answer.append(error)
            done.set()

        # A call blocks until the server answers. In a separate thread it cannot prevent the shutdown.
        threading.Thread(target=call, name=f"service_call:{self._service_name}", daemon=True).start()
        while not done.wait(POLL):
            if rospy.is_shutdown():
                return None
        if isinstance(answer[0], Exception):
            smach.logerr(f"call of service '{self._service_name}' failed: {answer[0]}")
            return None
        return answer[0]

    def _take_response(self, ud: Any, response: Any) -> str:
        outcome = None
        if self._response_cb is not None:
            outcome = self._response_cb(
                callback_userdata(ud, self._response_cb, self),
                response,
                *self._response_cb_args,
                **self._response_cb_kwargs,
            )
            if outcome is not None and outcome not in self._outcomes:
                smach.logerr(
                    f"response_cb of service '{self._service_name}' returned {outcome!r}, which is "
                    "not among its "
                    f"outcomes {list(self._outcomes)}"
                )
                return "aborted"
        if self._response_key is not None:
            ud[self._response_key] = response
        for slot in self._response_slots:
            ud[slot] = getattr(response, slot)
        return outcome or "succeeded"
