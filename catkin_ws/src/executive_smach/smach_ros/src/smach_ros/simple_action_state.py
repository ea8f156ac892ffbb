"""A state that sends a goal to an action server and waits for its result."""

from __future__ import annotations

import copy
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import rospy
import smach
from actionlib import CommState
from actionlib.action_client import ActionClient, ClientGoalHandle
from actionlib_msgs.msg import GoalStatus

from smach_ros.util import POLL, TimeLimit, callback_userdata, check_slots, register_callback

_MINUTE = rospy.Duration(60.0)
_STATUS_NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper() and isinstance(value, int)}


class SimpleActionState(smach.State):
    """Outcomes succeeded, aborted and preempted, and the outcomes that `result_cb` returns.

    The goal is built in this order: `goal` (copied each time), user data `goal_key` (a whole goal),
    `goal_slots` (user data keys with the names of its fields), `goal_cb(ud, goal, *goal_cb_args,
    **goal_cb_kwargs)`, whose return value replaces it unless None. `result_cb(ud, status, result,
    *result_cb_args, **result_cb_kwargs)` may return an outcome. Then user data `result_key` and
    `result_slots` are written.

    The outcome is aborted if the server does not appear within `server_wait_timeout`, if the connection
    to it is lost, after `exec_timeout` (the goal is cancelled), if a cancelled goal does not end within
    `preempt_timeout`, and at shutdown. Times are rospy.Duration or seconds; None or 0: no limit. A
    preempt request cancels the goal.

    Example::

        close = SimpleActionState("hand_close", HandCloseAction, goal=HandCloseGoal(force=0.3),
                                  exec_timeout=rospy.Duration(5))
        StateMachine.add("CLOSE", close, transitions={"succeeded": "LIFT"})
    """

    # Values of the attribute `status`.
    WAITING_FOR_SERVER = 0
    INACTIVE = 1
    ACTIVE = 2
    PREEMPTING = 3
    COMPLETED = 4

    #: Seconds without a connection to the server, during a goal, after which the server counts as lost.
    LOST_AFTER = 1.0

    #: Seconds that a cancel waits for the acknowledgement of the goal. If a client cancels earlier, a status
    #: that does not list the goal yet makes it count the goal as lost.
    ACKNOWLEDGED_WITHIN = 1.0

    def __init__(
        self,
        action_name: str,
        action_spec: type,
        goal: Any = None,
        goal_key: str | None = None,
        goal_slots: Iterable[str] = (),
        goal_cb: Callable | None = None,
        goal_cb_args: Sequence = (),
        goal_cb_kwargs: Mapping[str, Any] | None = None,
        result_key: str | None = None,
        result_slots: Iterable[str] = (),
        result_cb: Callable | None = None,
        result_cb_args: Sequence = (),
        result_cb_kwargs: Mapping[str, Any] | None = None,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        exec_timeout: Any = None,
        preempt_timeout: Any = _MINUTE,
        server_wait_timeout: Any = _MINUTE,
    ) -> None:
        super().__init__(["succeeded", "aborted", "preempted"], input_keys, output_keys)
        self.register_outcomes(outcomes)
        action = action_spec()
        self._goal_class = type(action.action_goal.goal)
        result_class = type(action.action_result.result)
        if callable(goal):
            raise smach.InvalidStateError(
                f"SimpleActionState '{action_name}': goal must be a {self._goal_class.__name__}, "
                "got a callable; "
                f"pass it as goal_cb"
            )
        goal_slots, result_slots = tuple(goal_slots), tuple(result_slots)
        check_slots(self, "goal_slots", goal_slots, self._goal_class)
        check_slots(self, "result_slots", result_slots, result_class)
        register_callback(self, "goal_cb", goal_cb)
        register_callback(self, "result_cb", result_cb)
        self.register_input_keys([*([goal_key] if goal_key else []), *goal_slots])
        self.register_output_keys([*([result_key] if result_key else []), *result_slots])

        self._action_name = action_name
        self._goal, self._goal_key, self._goal_slots = goal, goal_key, goal_slots
        self._goal_cb, self._goal_cb_args = goal_cb, tuple(goal_cb_args)
        self._goal_cb_kwargs = dict(goal_cb_kwargs or {})
        self._result_key, self._result_slots = result_key, result_slots
        self._result_cb, self._result_cb_args = result_cb, tuple(result_cb_args)
        self._result_cb_kwargs = dict(result_cb_kwargs or {})
        self._exec_timeout = exec_timeout
        self._preempt_timeout = preempt_timeout
        self._server_wait_timeout = server_wait_timeout
        self._wake = threading.Event()
        self.status = self.WAITING_FOR_SERVER
        # Connects in the background, so that the first execution need not wait long.
        self._action_client = ActionClient(action_name, action_spec)

    def request_preempt(self) -> None:
        """Cancel the running goal, if there is one, and request the state to end early.

        Example: `state.request_preempt()`.
        """
        super().request_preempt()
        self._wake.set()

    def execute(self, ud: Any) -> str:
        """Send the goal and wait for its result.

        Example: called by a state machine, or `state.execute(smach.UserData())`.
        """
        self._drop_spent_preempt()
        try:
            return self._execute(ud)
        finally:
            self.status = self.INACTIVE
            self._spend_preempt()

    def _execute(self, ud: Any) -> str:
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        self.status = self.WAITING_FOR_SERVER
        outcome = self._await_server()
        if outcome is not None:
            return outcome
        try:
            goal = self._make_goal(ud)
        except Exception:
            smach.logerr(f"goal of action '{self._action_name}' could not be made:\n{traceback.format_exc()}")
            return "aborted"
        self.status = self.ACTIVE
        try:
            handle = self._action_client.send_goal(goal, lambda _handle: self._wake.set())
        except Exception as error:  # raised by rospy for fields of a wrong type, or at shutdown
            smach.logerr(f"goal of action '{self._action_name}' could not be sent: {error}")
            return "aborted"
        if not self._await_end(handle):
            return "aborted"
        self.status = self.COMPLETED
        return self._conclude(ud, handle)

    def _server_is_there(self) -> bool:
        client = self._action_client
        status = client.last_status_msg
        if not status:
            return False
        server = status._connection_header["callerid"]
        return (
            client.pub_goal.impl.has_connection(server)
            and client.pub_cancel.impl.has_connection(server)
            and any(link.callerid_pub == server for link in client.result_sub.impl.connections)
        )

    def _pause(self) -> None:
        self._wake.wait(POLL)
        self._wake.clear()

    def _await_server(self) -> str | None:
        """None when the server is connected, otherwise the outcome."""
        limit = TimeLimit(self._server_wait_timeout)
        while not self._server_is_there():
            if self.preempt_requested():
                self.service_preempt()
                return "preempted"
            if rospy.is_shutdown():
                return "aborted"
            if limit.expired():
                smach.logerr(
                    f"no server for action '{rospy.resolve_name(self._action_name)}' within "
                    f"{limit.limit:g} s; "
                    f"is its node running, and is the name right?"
                )
                return "aborted"
            self._pause()
        return None

    def _make_goal(self, ud: Any) -> Any:
        goal = self._goal_class() if self._goal is None else copy.deepcopy(self._goal)
        if self._goal_key is not None:
            goal = copy.copy(ud[self._goal_key]) if self._goal_slots else ud[self._goal_key]
        for slot in self._goal_slots:
            setattr(goal, slot, ud[slot])
        if self._goal_cb is not None:
            made = self._goal_cb(
                callback_userdata(ud, self._goal_cb, self),
                goal,
                *self._goal_cb_args,
                **self._goal_cb_kwargs,
            )
            if made is not None:
                goal = made
        if getattr(goal, "_type", None) != self._goal_class._type:
            raise TypeError(f"expected a {self._goal_class._type}, got {type(goal).__name__} {goal!r}")
        return goal

    def _await_end(self, handle: ClientGoalHandle) -> bool:
        """True if the server has reported the end of the goal."""
        name = f"action '{self._action_name}'"
        exec_limit, cancel_limit = TimeLimit(self._exec_timeout), None
        sent_at = time.monotonic()
        lost_at: float | None = None
        while handle.get_comm_state() != CommState.DONE:
            if rospy.is_shutdown():
                handle.cancel()
                return False
            if self._server_is_there():
                if lost_at and handle.get_comm_state() == CommState.WAITING_FOR_GOAL_ACK:
                    smach.logerr(f"{name}: the server was reconnected but never acknowledged the goal; goal given up")
                    handle.cancel()
                    return False
                lost_at = None
            else:
                lost_at = lost_at or time.monotonic()
                if time.monotonic() - lost_at > self.LOST_AFTER:
                    smach.logerr(f"{name}: connection to the server lost for {self.LOST_AFTER:g} s; goal given up")
                    return False
            unacknowledged = (
                handle.get_comm_state() == CommState.WAITING_FOR_GOAL_ACK
                and time.monotonic() - sent_at < self.ACKNOWLEDGED_WITHIN
            )
            if cancel_limit is None:
                if not unacknowledged and (self.preempt_requested() or exec_limit.expired()):
                    if not self.preempt_requested():
                        smach.logwarn(f"{name}: not finished within {exec_limit.limit:g} s; goal cancelled")
                    self.status = self.PREEMPTING
                    handle.cancel()
                    cancel_limit = TimeLimit(self._preempt_timeout)
            elif cancel_limit.expired():
                smach.logerr(f"{name}: cancelled goal has not ended within {cancel_limit.limit:g} s; given up")
                return False
            self._pause()
        return True

    def _conclude(self, ud: Any, handle: ClientGoalHandle) -> str:
        status, result = handle.get_goal_status(), handle.get_result()
        outcome = "aborted"
        if status == GoalStatus.SUCCEEDED:
            outcome = "succeeded"
        elif status in (GoalStatus.PREEMPTED, GoalStatus.RECALLED) and self.preempt_requested():
            self.service_preempt()
            outcome = "preempted"
        else:
            smach.logwarn(
                f"action '{self._action_name}' ended with status "
                f"{_STATUS_NAMES.get(status, status)}: "
                f"{handle.get_goal_status_text()}"
            )
        try:
            if self._result_cb is not None:
                outcome = self._ask_result_cb(ud, status, result) or outcome
            if result is not None:
                if self._result_key is not None:
                    ud[self._result_key] = result
                for slot in self._result_slots:
                    ud[slot] = getattr(result, slot)
        except Exception:
            smach.logerr(f"result of action '{self._action_name}' not taken:\n{traceback.format_exc()}")
            return "aborted"
        return outcome

    def _ask_result_cb(self, ud: Any, status: int, result: Any) -> str | None:
        outcome = self._result_cb(  # type: ignore[misc]
            callback_userdata(ud, self._result_cb, self),
            status,
            result,
            *self._result_cb_args,
            **self._result_cb_kwargs,
        )
        if outcome is not None and outcome not in self._outcomes:
            smach.logerr(
                f"result_cb of action '{self._action_name}' returned {outcome!r}, which is not "
                "among its outcomes "
                f"{list(self._outcomes)}"
            )
            return "aborted"
        return outcome
