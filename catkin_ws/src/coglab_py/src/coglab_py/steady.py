"""Timers, workers and waits for nodes by the steady clock, which is independent of date changes and of `/clock`.

rospy's timers, waits and sleeps follow ROS time: they block while `/clock` stands still, and raise an exception when it
steps back. Code for hardware uses these functions instead.
"""

from __future__ import annotations

import queue
import socket
import threading
import time
import traceback
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import rosgraph
import rospy

from coglab_py.node_start import answer

FAILING = 10.0  # s in which all calls of a timer's function may fail before the node ends
SILENCE = 1.0  # s without a message on /clock that count as a fault
STEP = 0.5  # s of ROS time against the steady clock that count as a change of the date
SET = 0.04  # s of ROS time against the steady clock after which stamps use the new ROS time
QUICK = 0.005  # s within which both clocks must be read for a comparison
TRIES = 10  # attempts to read them within that time
FOLLOWED = 0.01  # share of a smaller difference that is corrected at each reading
POLL = 0.1  # s between two checks of a wait
ANSWER_LIMIT = 10.0  # s, longest wait for the answer of a service

_failed = threading.Event()


def ending() -> bool:
    """True if rospy shuts down. Unlike rospy.is_shutdown() it is true before the topics close."""
    return bool(rospy.core.is_shutdown_requested() or rospy.is_shutdown())


def exit_status() -> int:
    """Exit status of the node: 1 if a worker ended it, otherwise 0."""
    return int(_failed.is_set())


def spin() -> int:
    """Wait for the end of the node. Returns its exit status."""
    rospy.spin()
    return exit_status()


def worker(function: Callable[[], object], name: str) -> threading.Thread:
    """A thread (not started) that the node needs. An exception in it is logged and ends the node, so that
    roslaunch restarts it."""

    def run() -> None:
        try:
            function()
        except Exception:
            if ending():
                return
            _failed.set()
            rospy.logfatal("%s ends, as its thread '%s' did:\n%s", rospy.get_name(), name, traceback.format_exc())
            rospy.signal_shutdown(f"the thread '{name}' has ended")

    return threading.Thread(target=run, name=name, daemon=True)


class SteadyTimer:
    """Calls `function` every `period` (s) in its own worker until `shutdown()`. Late calls are not repeated.

    An exception of the function is logged, and the calls continue. After FAILING s without a successful call the node
    ends.
    """

    def __init__(self, period: float, function: Callable[[], object], name: str) -> None:
        self._period, self._function, self._name = period, function, name
        self._over = threading.Event()
        self._thread = worker(self._run, name)
        self._thread.start()

    def shutdown(self) -> None:
        """Stop the calls. Waits at most 1 s for a running call."""
        self._over.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(1.0)

    def _run(self) -> None:
        due = good = time.monotonic()
        while True:
            due = max(due + self._period, time.monotonic())
            if self._over.wait(due - time.monotonic()) or ending():
                return
            try:
                self._function()
                good = time.monotonic()
            except Exception as error:
                if ending():
                    return
                what = f"{type(error).__name__}: {error}"
                rospy.logerr_throttle(5.0, f"{rospy.get_name()}: '{self._name}' failed: {what}")
                if time.monotonic() - good > FAILING:
                    raise


class Stamps:
    """Converts stamps of ROS time to the steady clock and back. After a step of ROS time later stamps use the new time.
    Smaller differences are corrected slowly, so that stamps do not jitter on a busy computer."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._offset: float | None = None

    def steady(self, stamp: rospy.Time) -> float:
        """Steady time (s) of a stamp."""
        return stamp.to_sec() + self._follow()

    def stamp(self, steady: float) -> rospy.Time:
        """Stamp of a steady time (s)."""
        return rospy.Time.from_sec(max(0.0, steady - self._follow()))

    def _follow(self) -> float:
        for _ in range(TRIES):  # repeated if the thread was interrupted between the two readings
            before, ros, after = time.monotonic(), rospy.get_time(), time.monotonic()
            if after - before < QUICK:
                break
        with self._lock:
            offset = before - ros if self._offset is None else self._offset
            if abs(before - ros - offset) > SET:
                offset = before - ros
            offset += FOLLOWED * (before - ros - offset)
            self._offset = offset
            return offset


def utc_of(steady: float) -> str:
    """Date and time (UTC, to the ms) of a steady time (s), for people and for other records."""
    moment = datetime.fromtimestamp(time.time() - (time.monotonic() - steady), UTC)
    return moment.isoformat(timespec="milliseconds")


def wait_for(condition: Callable[[], Any], limit: float) -> bool:
    """Wait until a condition is true, at most `limit` (s). True if it is. Checks at least once."""
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() >= end or ending():
            return False
        time.sleep(POLL)
    return True


def service_answers(name: str) -> bool:
    """True if a service is registered and its node accepts connections."""
    caller, name = rospy.get_name(), rospy.resolve_name(name)
    try:
        address = rospy.core.parse_rosrpc_uri(answer(rosgraph.get_master_uri(), "lookupService", name))
        with socket.create_connection(address, timeout=1.0) as link:
            header = {"probe": "1", "md5sum": "*", "callerid": caller, "service": name}
            rosgraph.network.write_ros_handshake_header(link, header)
        return True
    except Exception:  # from the socket, XML-RPC, or a master without this service
        return False


def wait_for_service(name: str, limit: float) -> None:
    """Wait until a service answers. Raises rospy.ROSException after `limit` (s)."""
    if not wait_for(lambda: service_answers(name), limit):
        raise rospy.ROSException(f"service {rospy.resolve_name(name)} does not answer after {limit:g} s")


def call_service(name: str, kind: Any, *words: Any, wait: float, limit: float = ANSWER_LIMIT) -> Any:
    """Call a service and return its response. `wait` (s): for the service to appear; `limit` (s): for its answer, which
    a frozen node never gives. Raises rospy.ROSException after these, and rospy.ServiceException if the service breaks
    off."""
    wait_for_service(name, wait)
    ended: queue.SimpleQueue[tuple[Any, Exception | None]] = queue.SimpleQueue()

    def ask() -> None:
        try:
            ended.put((rospy.ServiceProxy(name, kind)(*words), None))
        except Exception as error:
            ended.put((None, error))

    threading.Thread(target=ask, name=f"service {name}", daemon=True).start()
    try:
        response, error = ended.get(timeout=limit)
    except queue.Empty:
        who = rospy.resolve_name(name)
        raise rospy.ROSException(f"service {who} gave no answer in {limit:g} s; its node is frozen or busy") from None
    if error is not None:
        raise error
    return response


def server_is_there(client: Any) -> bool:
    """True if the server of an actionlib.ActionClient or SimpleActionClient runs, with all topics connected."""
    action = getattr(client, "action_client", client)
    if not action.last_status_msg:
        return False
    server = action.last_status_msg._connection_header["callerid"]
    return all(topic.impl.has_connection(server) for topic in (action.pub_goal, action.pub_cancel)) and all(
        any(link.callerid_pub == server for link in topic.impl.connections)
        for topic in (action.result_sub, action.feedback_sub)
    )


class ClockWatch:
    """Monitors whether ROS time runs. Call `look()` a few times per second; it logs changes."""

    def __init__(self) -> None:
        self.fault = ""
        """text if /clock is silent, otherwise empty"""
        self._ros, self._steady = rospy.get_time(), time.monotonic()
        self._moved = self._steady

    def look(self) -> str:
        """Check the clocks and return the fault."""
        ros, steady = rospy.get_time(), time.monotonic()
        if not rospy.rostime.is_wallclock():
            self._look_at_simulated(ros, steady)
        elif abs(step := ros - self._ros - (steady - self._steady)) > STEP:
            rospy.logwarn(
                "this computer's clock was set %s by %.1f s; earlier stamps are invalid",
                "forward" if step > 0.0 else "back",
                abs(step),
            )
        self._ros, self._steady = ros, steady
        return self.fault

    def _look_at_simulated(self, ros: float, steady: float) -> None:
        if ros < self._ros:
            rospy.logwarn("/clock went back by %.1f s; earlier stamps are invalid", self._ros - ros)
        if ros != self._ros:
            self._moved = steady
            if self.fault:
                rospy.loginfo("/clock runs again")
            self.fault = ""
        elif not self.fault and steady - self._moved > SILENCE:
            self.fault = f"/clock is silent for {SILENCE:g} s: start its publisher, or set /use_sim_time to false"
            rospy.logerr(self.fault)


def end_quietly() -> None:
    """Suppress the traceback of a thread that publishes on a topic which rospy has just closed.

    This includes threads of libraries, such as actionlib's status loop.
    """
    report = threading.excepthook

    def hook(arguments: Any) -> None:
        if not (ending() and issubclass(arguments.exc_type, rospy.ROSException)):
            report(arguments)

    threading.excepthook = hook
