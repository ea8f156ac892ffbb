"""/diagnostics of the hand: once a second and at every event."""

from __future__ import annotations

import time
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ih2_hand.reasons import BROKEN, NEUTRAL

PERIOD_S = 1.0


class Diagnostics:
    """Publishes the state of `node` (a HandNode)."""

    def __init__(self, node: Any):
        self._node = node
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self._next = 0.0

    def tick(self) -> None:
        """Publish when a second has passed."""
        if time.monotonic() >= self._next:
            self.publish()

    def publish(self) -> None:
        """Publish now."""
        self._next = time.monotonic() + PERIOD_S
        node, driver = self._node, self._node.driver
        level = DiagnosticStatus.OK
        if driver is None or node.event_code in BROKEN:
            level = DiagnosticStatus.ERROR
        elif not node.calibrated or node.event_code not in NEUTRAL:
            level = DiagnosticStatus.WARN
        values = {"port": node.port, "connected": driver is not None,
                  "calibrated": node.calibrated, "calibrating": node.calibrating,
                  "holding": node.holding, "rate (Hz)": node.rate,
                  "action": node.goals.active if hasattr(node, "goals") else None}
        if driver is not None:
            counters = driver.counters
            values.update({"requests": counters.requests,
                           "resynchronisations": counters.resynchronisations,
                           "of these by StopALL": counters.fillers,
                           "failed requests": counters.failures})
        status = DiagnosticStatus(
            level=level, name=f"{rospy.get_name().strip('/')}: hand", message=node.message,
            hardware_id=node.port,
            values=[KeyValue(key, str(value)) for key, value in values.items()])
        array = DiagnosticArray(status=[status])
        array.header.stamp = rospy.Time.now()
        self._publisher.publish(array)
