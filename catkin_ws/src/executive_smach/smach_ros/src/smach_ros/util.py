"""Small things the ROS states share: time limits, callbacks' user data, and the handler for
shutdown.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy
import smach

#: How often (s) waits look at shutdown, connections and time limits. Requests wake them at once.
POLL = 0.05
#: A ROS clock that has not moved for this long (s) is taken as dead: the steady clock counts.
CLOCK_SILENCE = 1.0


def seconds(duration: Any) -> float | None:
    """A duration given as rospy.Duration, number or None, in seconds.

    Example: `seconds(rospy.Duration(2))`.
    """
    if duration is None:
        return None
    return float(duration.to_sec()) if hasattr(duration, "to_sec") else float(duration)


class TimeLimit:
    """A limit by the steady clock; with simulated time, by `/clock` while that runs.

    Steps of the wall clock, and of `/clock` backwards or at its first message, count nothing.
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
        """Whether the limit is over; to be asked regularly. Example: `if limit.expired(): ...`."""
        if self.limit <= 0.0:
            return False
        ros, steady = _simulated_time(), time.monotonic()
        passed = max(0.0, steady - self._moved - (CLOCK_SILENCE if self._ros else 0.0))
        if ros != self._ros:
            self._spent += max(passed, ros - self._ros if self._ros else 0.0)
            self._ros, self._moved, passed = ros, steady, 0.0
        return self._spent + passed >= self.limit


def _simulated_time() -> float:
    """The time on `/clock`, s; 0 before its first message, and without simulated time."""
    return 0.0 if rospy.rostime.is_wallclock() else float(rospy.get_time())


def service_answers(name: str) -> bool:
    """Whether a service is registered and its node takes connections.

    rospy.wait_for_service measures its time-out by the wall clock, which may step.
    """
    caller, name = rospy.get_name(), rospy.resolve_name(name)
    try:
        address = rospy.core.parse_rosrpc_uri(rosgraph.Master(caller).lookupService(name))
        with socket.create_connection(address, timeout=1.0) as link:
            header = {"probe": "1", "md5sum": "*", "callerid": caller, "service": name}
            rosgraph.network.write_ros_handshake_header(link, header)
        return True
    except Exception:  # of the socket, of XML-RPC, or of the master that does not know it
        return False


def callback_userdata(ud: Any, cb: Callable | None, state: smach.State) -> smach.Remapper:
    """What a callback of a state sees: the keys it declares itself, else those of the state.

    Example: `goal_cb(callback_userdata(ud, goal_cb, self), goal)`.
    """
    source: Any = cb if smach.has_smach_interface(cb) else state
    return smach.Remapper(ud, source.get_registered_input_keys(), source.get_registered_output_keys(), {})


def register_callback(state: smach.State, what: str, cb: Callable | None) -> None:
    """Check a callback and take over the outcomes and keys it declares.

    Raises InvalidStateError if it cannot be called. Example: `register_callback(self, "goal_cb",
    goal_cb)`.
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
    """At shutdown of rospy ask `container` to end, and wait for it (at most 60 s).

    Example: `smach_ros.set_preempt_handler(machine)` before `machine.execute()`.
    """

    def handler() -> None:
        container.request_preempt()
        started = time.monotonic()
        next_log = 1.0
        while container.is_running():
            if container._run_thread == threading.get_ident():
                return  # we have interrupted the very thread that runs it: let it go on
            waited = time.monotonic() - started
            if waited > 60.0:
                rospy.logerr("the state machine has not ended within 60 s of shutdown; giving up")
                return
            if waited >= next_log:
                next_log += 1.0
                rospy.loginfo(f"waiting for the state machine to end, {waited:.0f} s so far")
            time.sleep(0.02)

    rospy.on_shutdown(handler)
