"""Service calls and subscriptions of the ROS ports.

A rospy service call has no time limit. Therefore, each call runs in a thread, and the waiting state limits the time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy
from coglab_msgs.msg import ReasonCode
from coglab_py.pace import Pace
from coglab_py.steady import POLL, service_answers

from coglab_smach.ports.pending import Pending, Permit, Polled, PortError, Threaded

SERVICE_WAIT = 20.0  # s, time limit for a service to appear: its node may still be starting
PACE = Pace()  # pace of the simulated cell, for ages; the node sets its topic


class Newest:
    """The newest message of a topic and its arrival time (s, monotonic)."""

    def __init__(self, topic: str, kind: Any, on_message: Callable[[Any], None] | None = None) -> None:
        self.message: Any = None
        self.stamp = -1e9
        self._on_message = on_message
        self._subscriber = rospy.Subscriber(topic, kind, self._take, queue_size=50)

    def _take(self, message: Any) -> None:
        self.message, self.stamp = message, time.monotonic()
        if self._on_message is not None:
            self._on_message(message)

    def is_connected(self) -> bool:
        """True if the topic has a publisher."""
        return bool(self._subscriber.get_num_connections())

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()

    def age(self) -> float:
        """Returns the age of the last message, s in the time of the cell; large if there was none."""
        return (time.monotonic() - self.stamp) * PACE.factor


def call(name: str, kind: Any, wait: float = SERVICE_WAIT, **fields: Any) -> Pending:
    """Call a service in a thread. A response with ``success`` false becomes a PortError with message and reason_code.

    If the call is cancelled before the server accepts the connection, the request is never sent, even if the server
    answers later.
    """
    return Threaded(lambda permit: call_now(name, kind, permit, wait, **fields), f"service {name}")


def call_now(name: str, kind: Any, permit: Permit, wait: float = SERVICE_WAIT, **fields: Any) -> Any:
    """The same as call(), but blocking: call it only from a separate thread. Returns the response."""
    full = rospy.resolve_name(name)
    _await_service(full, wait, permit)

    class Request(kind._request_class):
        """rospy serialises and sends a request after the server has answered the connection header. This is the last
        moment to give it up. A frozen server does not answer the header."""

        def serialize(self, buff: Any) -> None:
            permit.check()
            super().serialize(buff)

    try:
        response = rospy.ServiceProxy(full, kind)(Request(**fields))
    except rospy.ServiceException as error:
        raise PortError(
            f"service {full} broke off; its node may have died", (str(error),), ReasonCode.NODE_SILENT
        ) from None
    if getattr(response, "success", True) is False:
        raise PortError(f"{full} refused: {response.message}", code=getattr(response, "reason_code", ReasonCode.NONE))
    return response


def _await_service(full: str, wait: float, permit: Permit) -> None:
    """Wait until the service answers. A withdrawn permit ends the wait, so that no thread remains."""
    end = time.monotonic() + wait
    permit.check()
    while not service_answers(full):
        permit.check()
        if rospy.is_shutdown():
            raise PortError(f"service {full} was not called: this node shuts down", code=ReasonCode.PREEMPTED)
        if time.monotonic() >= end:
            raise PortError(
                f"service {full} is not there after {wait:.0f} s; is its node running?", code=ReasonCode.NODE_SILENT
            )
        time.sleep(POLL)


def mapped(pending: Pending, value: Callable[[Any], Any]) -> Pending:
    """Returns the same call with its response converted by ``value``."""
    return Polled(pending.done, lambda: value(pending.result()), pending.cancel)
