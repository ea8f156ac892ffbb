"""Common helpers of the ROS states: time limits, user data of callbacks, and the shutdown handler."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy
import smach

#: Interval (s) at which waiting states check shutdown, connections and time limits. Requests wake them at once.
POLL = 0.05
#: Seconds without a change after which a ROS clock counts as stopped; then the steady clock is used.
CLOCK_SILENCE = 1.0


def seconds(duration: Any) -> float | None:
    """Seconds of a duration given as rospy.Duration, number or None.

    Example: `seconds(rospy.Duration(2))`.
    """
    if duration is None:
        return None
    return float(duration.to_sec()) if hasattr(duration, "to_sec") else float(duration)


class TimeLimit:
    """A time limit by the steady clock; with simulated time, by `/clock` while it runs.

    Steps of the wall clock do not count, nor does a step of `/clock` backwards or at its first message.
    `limit`: rospy.Duration or seconds; None or 0: no limit.

    Example::

        limit = TimeLimit(rospy.Duration(5))
        while not limit.expired():
            ...
    """

    def __init__(self, limit: Any) -> None:
        self.limit = seconds(limit) or 0.0
        self._spent = 0.0
        self._ros, self._moved = _simulated_time(), time.monotonic()

    def expired(self) -> bool:
        """True if the limit has passed. Call it regularly. Example: `if limit.expired(): ...`."""
        if self.limit <= 0.0:
            return False
        ros, steady = _simulated_time(), time.monotonic()
        passed = max(0.0, steady - self._moved - (CLOCK_SILENCE if self._ros else 0.0))
        if ros != self._ros:
            self._spent += max(passed, ros - self._ros if self._ros else 0.0)
            self._ros, self._moved, passed = ros, steady, 0.0
        return self._spent + passed >= self.limit


def _simulated_time() -> float:
    """Time of `/clock` (s); 0 before its first message and without simulated time."""
    return 0.0 if rospy.rostime.is_wallclock() else float(rospy.get_time())


def service_answers(name: str) -> bool:
    """True if a service is registered and its node accepts connections.

    rospy.wait_for_service is not used: it measures its time-out by the wall clock, which may step.
    """
    caller, name = rospy.get_name(), rospy.resolve_name(name)
    try:
        address = rospy.core.parse_rosrpc_uri(rosgraph.Master(caller).lookupService(name))
        with socket.create_connection(address, timeout=1.0) as link:
            header = {"probe": "1", "md5sum": "*", "callerid": caller, "service": name}
            rosgraph.network.write_ros_handshake_header(link, header)
        return True
    except Exception:  # of the socket, of XML-RPC, or of a master without this service
        return False


def callback_userdata(ud: Any, cb: Callable | None, state: smach.State) -> smach.Remapper:
    """User data for a callback of a state: with the keys that the callback declares, otherwise those of the state.

    Example: `goal_cb(callback_userdata(ud, goal_cb, self), goal)`.
    """
    source: Any = cb if smach.has_smach_interface(cb) else state
    return smach.Remapper(ud, source.get_registered_input_keys(), source.get_registered_output_keys(), {})


def register_callback(state: smach.State, what: str, cb: Callable | None) -> None:
    """Check a callback and add the outcomes and keys that it declares to the state.

    Raises InvalidStateError if it is not callable. Example: `register_callback(self, "goal_cb", goal_cb)`.
    """
    if cb is None:
        return
    if not callable(cb):
        raise smach.InvalidStateError(f"{type(state).__name__}: {what} must be callable, got {type(cb).__name__}")
    if smach.has_smach_interface(cb):
        declared: Any = cb
        state.register_outcomes(declared.get_registered_outcomes())
        state.register_input_keys(declared.get_registered_input_keys())
        state.register_output_keys(declared.get_registered_output_keys())


def check_slots(state: smach.State, what: str, slots: Any, message_class: Any) -> None:
    """Raise InvalidStateError if a message has no such fields.

    Example: `check_slots(self, "goal_slots", ["x"], MoveGoal)`.
    """
    unknown = [slot for slot in slots if slot not in message_class.__slots__]
    if unknown:
        raise smach.InvalidStateError(
            f"{type(state).__name__}: {what} {unknown} are not among the fields "
            f"{list(message_class.__slots__)} of {message_class._type}"
        )


def set_preempt_handler(container: smach.Container) -> None:
    """At the shutdown of rospy, request `container` to end and wait for it, at most 60 s.

    Example: `smach_ros.set_preempt_handler(machine)` before `machine.execute()`.
    """

    def handler() -> None:
        container.request_preempt()
        started = time.monotonic()
        next_log = 1.0
        while container.is_running():
            if container._run_thread == threading.get_ident():
                return  # the handler interrupted the thread that runs the container: let it continue
            waited = time.monotonic() - started
            if waited > 60.0:
                rospy.logerr("the state machine has not ended within 60 s of shutdown; giving up")
                return
            if waited >= next_log:
                next_log += 1.0
                rospy.loginfo(f"waiting for the state machine to end, {waited:.0f} s so far")
            time.sleep(0.02)

    rospy.on_shutdown(handler)
