"""Time as the driver and the emulator see it, so that tests can run in virtual time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A steady clock in seconds."""

    def monotonic(self) -> float:
        """Seconds since some fixed moment; never goes back."""

    def sleep(self, seconds: float) -> None:
        """Let that much time pass."""


class SteadyClock:
    """The machine's steady clock."""

    monotonic = staticmethod(time.monotonic)
    sleep = staticmethod(time.sleep)


class SteppedClock:
    """A clock that moves only when somebody sleeps on it."""

    def __init__(self, start: float = 0.0):
        self.now = start

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        if seconds > 0.0:
            self.now += seconds
