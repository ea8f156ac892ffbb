"""Press and hold: a motion begins only after its button was held for 0.8 s, told ten times a second.

A browser that dies, or loses its connection, with the button held sends nothing more, and nothing begins.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

HOLD_TIME = 0.8
LONGEST_GAP = 0.25


class HeldButton:
    """The button of one browser. Times in s of the steady clock."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._what: object = None
        self._since = self._last = 0.0

    def held(self, what: object) -> bool:
        """One message of a held button; True exactly once, when `what` was held for long enough without a gap."""
        now = self._now()
        if what != self._what or now - self._last > LONGEST_GAP:
            self._what, self._since = what, now
        self._last = now
        if now - self._since >= HOLD_TIME:
            self._since = float("inf")  # until it was released
            return True
        return False

    def unfinished(self) -> Any:
        """What is held down and has not begun yet; None where nothing is."""
        return self._what if self._since != float("inf") else None
