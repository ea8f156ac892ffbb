"""Services and topics as the ports over ROS use them.

A rospy service call has no time limit of its own, so each runs in a thread and the state that waits gives it one.
"""
from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy

from .pending import Pending, Polled, PortError, Threaded

SERVICE_WAIT = 20.0
"""s to wait for a service to appear: a node may still be starting."""


class Newest:
    """The newest message of a topic with the time it came (monotonic s)."""

    def __init__(self, topic: str, kind: Any, on_message: Callable[[Any], None] | None = None) -> None:
        self.message: Any = None
        self.stamp = -1e9
        self._on_message = on_message
        self._subscriber = rospy.Subscriber(topic, kind, self._take, queue_size=50)

    def _take(self, message: Any) -> None:
        self.message, self.stamp = message, time.monotonic()
        if self._on_message is not None:
            self._on_message(message)

    def age(self) -> float:
        """s since the last message; large if there was none."""
        return time.monotonic() - self.stamp


def call(name: str, kind: Any, wait: float = SERVICE_WAIT, **fields: Any) -> Pending:
    """Call a service in a thread; a response with ``success`` false becomes a PortError with its message."""

    def run() -> Any:
        full = rospy.resolve_name(name)
        try:
            rospy.wait_for_service(full, timeout=wait)
        except rospy.ROSException:
            raise PortError(f"service {full} is not there after {wait:.0f} s; is its node running?") from None
        try:
            response = rospy.ServiceProxy(full, kind)(**fields)
        except rospy.ServiceException as error:
            raise PortError(f"service {full} broke off; its node may have died", (str(error),)) from None
        if getattr(response, "success", True) is False:
            raise PortError(f"{full} refused: {response.message}")
        return response

    return Threaded(run, f"service {name}")


def mapped(pending: Pending, value: Callable[[Any], Any]) -> Pending:
    """The same call with its response turned into a value."""
    return Polled(pending.done, lambda: value(pending.result()), pending.cancel)


def wait_for(pending: Pending, limit: float = 60.0) -> Any:
    """Block until a pending call has ended: only inside a thread of its own, never in a state."""
    end = time.monotonic() + limit
    while not pending.done():
        if time.monotonic() > end:
            raise PortError(f"no answer within {limit:.0f} s")
        time.sleep(0.005)
    return pending.result()
