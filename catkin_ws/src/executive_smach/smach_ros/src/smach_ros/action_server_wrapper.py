"""Offers a container of states as an action server."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Iterable, Mapping
from typing import Any

import rospy
import smach
from actionlib.action_server import ActionServer
from actionlib.simple_action_server import SimpleActionServer


class ActionServerWrapper:
    """Runs `wrapped_container` once for each goal.

    The goal is stored in user data `goal_key`. With `expand_goal_slots` each field is also stored under
    its own name, with `goal_slots_map` {field: key} under another name. All of these must be input keys
    of the container. The result is read from `result_key`, from `result_slots_map` {field: key}, and with
    `pack_result_slots` from the names of the fields. These must be output keys. An empty result is
    stored at the start, for containers that also have it as an input key. `feedback_key` and
    `feedback_slots_map` {field: key} in the container's user data are published at each transition.

    The outcome determines how the goal ends. An outcome in none of the three lists, or an error, aborts
    the goal. A cancel requests the container to end early.

    Example::

        wrapper = ActionServerWrapper("take", TakeAction, machine, succeeded_outcomes=["taken"],
                                      preempted_outcomes=["preempted"])
        wrapper.run_server()
        rospy.spin()
    """

    def __init__(
        self,
        server_name: str,
        action_spec: type,
        wrapped_container: smach.Container,
        succeeded_outcomes: Iterable[str] = (),
        aborted_outcomes: Iterable[str] = (),
        preempted_outcomes: Iterable[str] = (),
        goal_key: str = "action_goal",
        feedback_key: str = "action_feedback",
        result_key: str = "action_result",
        goal_slots_map: Mapping[str, str] | None = None,
        feedback_slots_map: Mapping[str, str] | None = None,
        result_slots_map: Mapping[str, str] | None = None,
        expand_goal_slots: bool = False,
        pack_result_slots: bool = False,
    ) -> None:
        self.wrapped_container = wrapped_container
        self._server_name, self._action_spec = server_name, action_spec
        action = action_spec()
        self._goal_class = type(action.action_goal.goal)
        self._feedback_class = type(action.action_feedback.feedback)
        self._result_class = type(action.action_result.result)
        self._succeeded, self._preempted = tuple(succeeded_outcomes), tuple(preempted_outcomes)
        self._aborted = tuple(aborted_outcomes)
        known = wrapped_container.get_registered_outcomes()
        unknown = [o for o in (*self._succeeded, *self._aborted, *self._preempted) if o not in known]
        if unknown:
            smach.logwarn(f"action '{server_name}': {unknown} are no outcomes of its container {list(known)}")
        self._goal_key, self._feedback_key, self._result_key = goal_key, feedback_key, result_key
        self._goal_slots_map = dict(goal_slots_map or {})
        self._feedback_slots_map = dict(feedback_slots_map or {})
        self._result_slots_map = dict(result_slots_map or {})
        self._expand_goal_slots, self._pack_result_slots = expand_goal_slots, pack_result_slots
        for what, slots, kind in (
            ("goal_slots_map", self._goal_slots_map, self._goal_class),
            ("feedback_slots_map", self._feedback_slots_map, self._feedback_class),
            ("result_slots_map", self._result_slots_map, self._result_class),
        ):
            wrong = [slot for slot in slots if slot not in kind.__slots__]
            if wrong:
                raise smach.InvalidStateError(
                    f"action '{server_name}': {what} names {wrong}, which are not fields of "
                    f"{kind._type} "
                    f"{list(kind.__slots__)}"
                )
        self._lock = threading.RLock()
        self._executing = False
        self._action_server: SimpleActionServer | None = None
        wrapped_container.register_transition_cb(self._publish_feedback)

    def run_server(self) -> None:
        """Start the action server and return. Example: `wrapper.run_server(); rospy.spin()`."""
        self._action_server = SimpleActionServer(
            self._server_name, self._action_spec, execute_cb=self._execute, auto_start=False
        )
        self._action_server.register_preempt_callback(self._on_cancel)
        self._action_server.action_server = _SteadyActionServer(
            self._server_name,
            self._action_spec,
            self._action_server.internal_goal_callback,
            self._action_server.internal_preempt_callback,
            auto_start=False,
        )
        self._action_server.start()

    def _on_cancel(self) -> None:
        with self._lock:
            # _execute handles a cancel before the start. A cancel after the end has no effect.
            if self._executing:
                self.wrapped_container.request_preempt()

    def _execute(self, goal: Any) -> None:
        server, container = self._action_server, self.wrapped_container
        assert server is not None
        ud = smach.UserData()
        ud[self._goal_key] = goal
        # A machine that has the result as an input key may fill it field by field.
        ud[self._result_key] = self._result_class()
        if self._expand_goal_slots:
            for slot in goal.__slots__:
                ud[slot] = getattr(goal, slot)
        for slot, key in self._goal_slots_map.items():
            ud[key] = getattr(goal, slot)
        parent = smach.Remapper(ud, container.get_registered_input_keys(), container.get_registered_output_keys(), {})
        with self._lock:
            self._executing = True
            if server.is_preempt_requested():
                container.request_preempt()
        try:
            outcome = container.execute(parent)
            result = self._make_result(ud)
        except Exception:
            rospy.logerr(f"action '{self._server_name}': its container failed:\n{traceback.format_exc()}")
            server.set_aborted(text="the state machine behind this action failed; see its log")
            return
        finally:
            with self._lock:
                self._executing = False
                container.recall_preempt()  # a cancel applies to its goal, not to the next one
        if outcome in self._succeeded:
            server.set_succeeded(result, f"outcome {outcome}")
        elif outcome in self._preempted:
            server.set_preempted(result, f"outcome {outcome}")
        else:
            if outcome not in self._aborted:
                rospy.logwarn(
                    f"action '{self._server_name}': outcome {outcome!r} is in none of the lists of outcomes; aborted"
                )
            server.set_aborted(result, f"outcome {outcome}")

    def _make_result(self, ud: smach.UserData) -> Any:
        result = ud[self._result_key] if self._result_key in ud else None
        if getattr(result, "_type", None) != self._result_class._type:
            if result is not None:
                raise TypeError(f"user data {self._result_key!r} must be a {self._result_class._type}, got {result!r}")
            result = self._result_class()
        for slot in self._result_class.__slots__ if self._pack_result_slots else ():
            if slot in ud:
                setattr(result, slot, ud[slot])
        for slot, key in self._result_slots_map.items():
            if key in ud:
                setattr(result, slot, ud[key])
        return result

    def _publish_feedback(self, userdata: Any, _active_states: list[str]) -> None:
        if not self._executing or self._action_server is None:
            return
        keys = {slot: key for slot, key in self._feedback_slots_map.items() if key in userdata}
        if self._feedback_key in userdata:
            feedback = userdata[self._feedback_key]
        elif keys:
            feedback = self._feedback_class()
        else:
            return
        for slot, key in keys.items():
            setattr(feedback, slot, userdata[key])
        self._action_server.publish_feedback(feedback)


class _SteadyActionServer(ActionServer):
    """Accepts goals after any cancel and any step of the clock.

    actionlib refuses goals that are older than the newest cancel or goal. Its timer, which publishes the status, ends
    when `/clock` steps back.
    """

    last_cancel: Any
    _newest = rospy.Time()
    """newest stamp of a goal"""

    @property
    def status_frequency(self) -> float:
        """0, so that actionlib creates no timer."""
        return 0.0

    @status_frequency.setter
    def status_frequency(self, frequency: float) -> None:
        self._frequency = frequency

    def initialize(self) -> None:
        super().initialize()
        if self._frequency > 0.0:
            threading.Thread(target=self._publish, name="action_status", daemon=True).start()

    def internal_goal_callback(self, goal: Any) -> None:
        now = rospy.Time.now()
        if self.last_cancel > now:  # the clock stepped back
            self.last_cancel = rospy.Time()
        stamp = min(goal.goal_id.stamp, now)
        if self._newest > now:  # likewise; the stamp only orders goals
            stamp = self._newest
        goal.goal_id.stamp = stamp
        self._newest = max(self._newest, stamp)
        super().internal_goal_callback(goal)

    def internal_cancel_callback(self, goal_id: Any) -> None:
        goal_id.stamp = min(goal_id.stamp, rospy.Time.now())
        super().internal_cancel_callback(goal_id)

    def _publish(self) -> None:
        while not rospy.is_shutdown():
            time.sleep(1.0 / self._frequency)
            try:
                self.publish_status_async(None)
            except rospy.ROSException:  # shutdown has closed the topic
                return
