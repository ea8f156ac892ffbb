"""Timers, workers and waits of nodes by the steady clock, which no step of the date and no `/clock` moves.

rospy's own timers, waits and sleeps follow ROS time: they hang while `/clock` stands still, and end with an exception
when it goes back. What belongs to hardware uses these instead.
"""

from __future__ import annotations

import socket
import threading
import time
import traceback
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import rosgraph
import rospy

FAILING = 10.0
"""s for which every call of a timer's function may fail before the node ends"""
SILENCE = 1.0
"""s without a message on /clock, after which that is a fault"""
STEP = 0.5
"""s by which ROS time moves beside the steady clock where it was set"""
SET = 0.04
"""s beside the steady clock, beyond which ROS time counts as set where stamps are told on the other clock"""
QUICK = 0.005
"""s within which both clocks have to be read to be compared"""
TRIES = 10
"""to read them so quickly"""
FOLLOWED = 0.01
"""share of a small difference by which stamps follow at each look"""
POLL = 0.1
"""s between two looks of a wait"""

_failed = threading.Event()


def ending() -> bool:
    """Whether rospy shuts down; true before it closes the topics, unlike rospy.is_shutdown()."""
    return bool(rospy.core.is_shutdown_requested() or rospy.is_shutdown())


def exit_status() -> int:
    """Of the node: 1 where a worker has ended it."""
    return int(_failed.is_set())


def spin() -> int:
    """Wait for the node's end; its exit status."""
    rospy.spin()
    return exit_status()


def worker(function: Callable[[], object], name: str) -> threading.Thread:
    """A thread, to be started, without which the node is of no use: an exception in it is logged and ends the node, for
    roslaunch to start it again."""

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
    """Calls `function` every `period` s, in a worker of its own, until `shutdown()`. A late call is not caught up on.

    An exception of the function is logged, and the next call made; after FAILING s without a good one the node ends.
    """

    def __init__(self, period: float, function: Callable[[], object], name: str) -> None:
        self._period, self._function, self._name = period, function, name
        self._over = threading.Event()
        self._thread = worker(self._run, name)
        self._thread.start()

    def shutdown(self) -> None:
        """No call begins any more; waits for the one under way, at most 1 s."""
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
    """Stamps of ROS time on the steady clock and back. Where ROS time was set, what comes afterwards is told by the new
    time; else the two clocks are followed slowly, so that a busy computer does not make stamps jitter."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._offset: float | None = None

    def steady(self, stamp: rospy.Time) -> float:
        """The steady time of a stamp, s."""
        return stamp.to_sec() + self._follow()

    def stamp(self, steady: float) -> rospy.Time:
        """The stamp of a steady time (s)."""
        return rospy.Time.from_sec(max(0.0, steady - self._follow()))

    def _follow(self) -> float:
        for _ in range(TRIES):  # a thread that loses the processor between the two readings compares nothing
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
    """Date and time of a steady time (s), for people and other records; to the ms."""
    moment = datetime.fromtimestamp(time.time() - (time.monotonic() - steady), UTC)
    return moment.isoformat(timespec="milliseconds")


def wait_for(condition: Callable[[], Any], limit: float) -> bool:
    """Whether a condition comes true within `limit` s; looks at least once."""
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() >= end or ending():
            return False
        time.sleep(POLL)
    return True


def service_answers(name: str) -> bool:
    """Whether a service is registered and its node takes connections."""
    caller, name = rospy.get_name(), rospy.resolve_name(name)
    try:
        address = rospy.core.parse_rosrpc_uri(rosgraph.Master(caller).lookupService(name))
        with socket.create_connection(address, timeout=1.0) as link:
            header = {"probe": "1", "md5sum": "*", "callerid": caller, "service": name}
            rosgraph.network.write_ros_handshake_header(link, header)
        return True
    except Exception:  # of the socket, of XML-RPC, or of the master that does not know it
        return False


def wait_for_service(name: str, limit: float) -> None:
    """Until a service answers; rospy.ROSException where it does not within `limit` s."""
    if not wait_for(lambda: service_answers(name), limit):
        raise rospy.ROSException(f"service {rospy.resolve_name(name)} does not answer after {limit:g} s")


def server_is_there(client: Any) -> bool:
    """Whether the server of an actionlib.ActionClient or SimpleActionClient is there, with every topic connected."""
    action = getattr(client, "action_client", client)
    if not action.last_status_msg:
        return False
    server = action.last_status_msg._connection_header["callerid"]
    return all(topic.impl.has_connection(server) for topic in (action.pub_goal, action.pub_cancel)) and all(
        any(link.callerid_pub == server for link in topic.impl.connections)
        for topic in (action.result_sub, action.feedback_sub)
    )


class ClockWatch:
    """Whether ROS time runs. `look()` is to be called a few times a second; it logs what has changed."""

    def __init__(self) -> None:
        self.fault = ""
        """/clock is silent, in words; else empty"""
        self._ros, self._steady = rospy.get_time(), time.monotonic()
        self._moved = self._steady

    def look(self) -> str:
        """The fault."""
        ros, steady = rospy.get_time(), time.monotonic()
        if not rospy.rostime.is_wallclock():
            self._look_at_simulated(ros, steady)
        elif abs(step := ros - self._ros - (steady - self._steady)) > STEP:
            rospy.logwarn(
                "this computer's clock was set %s by %.1f s; stamps from before are of no use",
                "forward" if step > 0.0 else "back",
                abs(step),
            )
        self._ros, self._steady = ros, steady
        return self.fault

    def _look_at_simulated(self, ros: float, steady: float) -> None:
        if ros < self._ros:
            rospy.logwarn("/clock went back by %.1f s; stamps from before are of no use", self._ros - ros)
        if ros != self._ros:
            self._moved = steady
            if self.fault:
                rospy.loginfo("/clock runs again")
            self.fault = ""
        elif not self.fault and steady - self._moved > SILENCE:
            self.fault = f"/clock is silent for {SILENCE:g} s: start what publishes it, or set /use_sim_time to false"
            rospy.logerr(self.fault)


def end_quietly() -> None:
    """A thread that publishes on a topic which rospy has just closed ends without a traceback.

    It holds for threads of libraries, too, such as actionlib's status loop.
    """
    report = threading.excepthook

    def hook(arguments: Any) -> None:
        if not (ending() and issubclass(arguments.exc_type, rospy.ROSException)):
            report(arguments)

    threading.excepthook = hook
