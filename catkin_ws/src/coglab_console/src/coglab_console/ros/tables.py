"""Makes documents of topics that the page shows as tables: feedback controllers, recognition, diagnostics."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import rospy
from coglab_msgs.msg import FeedbackState, FeedbackStatus, Recognition
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64

SILENT_DIAGNOSTICS = 2.5  # s without diagnostics, which are published once a second
COMPUTER = ": computer"  # end of the names of diagnostics about an overloaded computer
OK = 0


class Tables:
    """Sets the documents `feedback`, `attribution`, `recognition` and `real_time_factor` (of the simulation) by
    `put(name, value)`, and keeps the diagnostics by name."""

    def __init__(self, put: Callable[[str, Any], None]) -> None:
        self._put = put
        self.latency = self.answer_time = math.nan
        self.diagnostics: dict[str, dict] = {}
        for topic, kind, callback in (
            ("controller_manager/feedback/status", FeedbackStatus, self._on_feedback_status),
            ("controller_manager/feedback/state", FeedbackState, self._on_feedback_state),
            ("perception/recognition", Recognition, self._on_recognition),
            ("diagnostics", DiagnosticArray, self._on_diagnostics),
            ("coglab_sim/real_time_factor", Float64, self._on_factor),
        ):
            rospy.Subscriber(topic, kind, callback, queue_size=20)

    def busy(self, now: float) -> str:
        """Messages about an overloaded computer; empty if there are none."""
        rows = [row for name, row in sorted(self.diagnostics.items()) if name.endswith(COMPUTER)]
        fresh = [row for row in rows if now - row["at"] < SILENT_DIAGNOSTICS]
        return " ".join(row["message"] for row in fresh if row["level"] != OK)

    def _on_factor(self, message: Float64) -> None:
        self._put("real_time_factor", round(message.data, 2))

    def _on_recognition(self, message: Recognition) -> None:
        rows = [[name, round(p, 2)] for name, p in zip(message.names[:20], message.probabilities[:20], strict=False)]
        self._put(
            "recognition",
            {
                "pattern": message.pattern,
                "decided": message.decided,
                "stamp": round(message.header.stamp.to_sec(), 2),
                "progress": round(message.progress, 2),
                "rows": rows,
            },
        )

    def _on_feedback_status(self, message: FeedbackStatus) -> None:
        rows = [
            {
                "name": c.name,
                "type": c.type,
                "stage": c.stage,
                "enabled": c.enabled,
                "paused": c.paused,
                "safety": c.safety,
                "activity": c.activity,
                "waiting": c.waiting_for,
                "reasons": c.pause_reasons[:10],
                "fault": c.fault,
                "faults": c.faults,
                "overruns": c.overruns,
            }
            for c in message.controllers[:64]
        ]
        self._put("feedback", {"profile": message.profile, "rows": rows})

    def _on_feedback_state(self, message: FeedbackState) -> None:
        rows = [
            {"controller": c.controller, "signal": c.signal, "size": round(c.size, 6), "angle": round(c.angle, 5)}
            for c in message.corrections[:64]
        ]
        inside = [
            {
                "controller": s.controller,
                "values": [[n, round(v, 5), u] for n, v, u in zip(s.names, s.values, s.units, strict=False)][:20],
            }
            for s in message.states[:32]
        ]
        self._put("attribution", {"cycle": int(message.cycle), "rows": rows, "inside": inside})

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status[:50]:
            level = status.level if isinstance(status.level, int) else status.level[0]
            values = [[pair.key[:80], pair.value[:120]] for pair in status.values[:60]]
            if len(self.diagnostics) < 100 or status.name in self.diagnostics or status.name.endswith(COMPUTER):
                self.diagnostics[status.name] = {
                    "level": level,
                    "message": status.message[:200],
                    "values": values,
                    "at": time.monotonic(),
                }
            if status.name.endswith("FRI connection"):
                found = dict(values)
                self.latency = _number(found.get("latency (s)"))
                self.answer_time = _number(found.get("mean answer time (s)"))


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan
