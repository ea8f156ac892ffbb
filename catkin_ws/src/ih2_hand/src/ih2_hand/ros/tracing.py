"""The trace of every frame as a topic, for who listens to it."""

from __future__ import annotations

import threading
import time

import rospy
from std_msgs.msg import String

from ih2_hand.trace import Tracer


class TracePublisher:
    """Publishes lines of `trace.Tracer` on the private topic `trace` while somebody subscribes."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~trace", String, queue_size=1000)
        self._lock = threading.Lock()
        self._tracer: Tracer | None = None

    def hook(self, direction: str, data: bytes) -> None:
        """For `HandSerialDriver(trace=...)`."""
        if not self._publisher.get_num_connections():
            self._tracer = None
            return
        with self._lock:
            tracer = self._tracer or Tracer()
            self._tracer = tracer
            for line in tracer.feed(direction, data, time.time()):
                self._publisher.publish(String(line))
