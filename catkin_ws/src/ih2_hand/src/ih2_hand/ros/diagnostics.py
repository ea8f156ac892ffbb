"""/diagnostics of the hand: every second and at every event."""

from __future__ import annotations

import time
from typing import Any

from coglab_py.steady import ClockWatch
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper, Updater

from ih2_hand.reasons import BROKEN, NEUTRAL

PERIOD_S = 1.0


class Diagnostics:
    """Publishes the state of `node` (a HandNode).

    The steady clock triggers the updater. The updater's own timer follows ROS time and would stop
    with /clock.
    """

    def __init__(self, node: Any):
        self._node = node
        self._clock = ClockWatch()
        self._updater = Updater()
        self._updater.add("hand", self._fill)
        self._next = 0.0

    def tick(self) -> None:
        """Publish if PERIOD_S has passed."""
        self._clock.look()
        if time.monotonic() >= self._next:
            self.publish()

    def publish(self) -> None:
        """Publish now."""
        self._next = time.monotonic() + PERIOD_S
        self._updater.setHardwareID(self._node.port or "none")
        self._updater.force_update()

    def _fill(self, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        node, driver = self._node, self._node.driver
        level = DiagnosticStatus.OK
        if driver is None or node.event_code in BROKEN:
            level = DiagnosticStatus.ERROR
        elif not node.calibrated or node.event_code not in NEUTRAL:
            level = DiagnosticStatus.WARN
        if self._clock.fault:
            level = max(level, DiagnosticStatus.WARN)
        status.summary(level, "; ".join(filter(None, (node.message, self._clock.fault))))
        values = {
            "port": node.port,
            "connected": driver is not None,
            "calibrated": node.calibrated,
            "calibrating": node.calibrating,
            "holding": node.holding,
            "rate (Hz)": node.rate,
            "reason_code": int(node.event_code),
            "action": node.goals.active if hasattr(node, "goals") else None,
        }
        if driver is not None:
            counters = driver.counters
            values.update(
                {
                    "requests": counters.requests,
                    "resynchronisations": counters.resynchronisations,
                    "of these by StopALL": counters.fillers,
                    "failed requests": counters.failures,
                }
            )
        for key, value in values.items():
            status.add(key, str(value))
        return status
