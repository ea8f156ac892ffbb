"""The event log: a bounded list, numbered from 1, so that a browser that reconnects gets the events it has missed."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

KEPT = 5000  # events
LEVELS = ("info", "warning", "fault")
LONGEST = 600  # characters of one event


class EventLog:
    """Thread-safe. An event is {seq, stamp (s since 1970), level, source, phase, text}; `phase`: activity
    of the robot in words; empty if unknown."""

    def __init__(self, now: Callable[[], float], keep: int = KEPT) -> None:
        self._now = now
        self._lock = threading.Lock()
        self._events: deque[dict] = deque(maxlen=keep)
        self._seq = 0
        self._listeners: list[Callable[[dict], None]] = []
        self.phase: Callable[[], str] = lambda: ""

    def listen(self, on_event: Callable[[dict], None]) -> None:
        """Registers a callback for each event. It runs in the thread that adds the event, in order of the numbers."""
        self._listeners.append(on_event)

    def add(self, source: str, text: str, level: str = "info", phase: str | None = None) -> dict:
        """Adds an event and returns it. A text that is too long is cut. `phase`: if it differs from the current one."""
        if level not in LEVELS:
            raise ValueError(f"level is one of {', '.join(LEVELS)}, got '{level}'")
        if len(text) > LONGEST:
            text = text[: LONGEST - 1] + "…"
        with self._lock:
            self._seq += 1
            event = {
                "seq": self._seq,
                "stamp": round(self._now(), 3),
                "level": level,
                "source": source,
                "phase": self.phase() if phase is None else phase,
                "text": text,
            }
            self._events.append(event)
            for listener in self._listeners:
                listener(event)
        return event

    def newest(self) -> int:
        """Number of the newest event; 0 before the first."""
        return self._seq

    def since(self, seq: int, limit: int = 500) -> tuple[list[dict], int]:
        """The events after number `seq`, oldest first and at most `limit`, and how many before them are no longer kept.

        A number higher than the newest (from an earlier console) counts as 0.
        """
        with self._lock:
            if seq > self._seq or seq < 0:
                seq = 0
            first = self._seq - len(self._events) + 1
            lost = max(0, first - seq - 1)
            begin = max(seq + 1, first)
            count = min(limit, self._seq - begin + 1)
            return [self._events[begin - first + i] for i in range(max(0, count))], lost
