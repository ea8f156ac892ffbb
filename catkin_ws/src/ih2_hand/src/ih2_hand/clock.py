"""Clock of the driver and the emulator. Tests replace it to run in virtual time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A steady clock in seconds."""

    def monotonic(self) -> float:
        """Time (s) since a fixed moment; never steps back."""

    def sleep(self, seconds: float) -> None:
        """Wait for this time (s)."""


class SteadyClock:
    """The computer's steady clock."""

    monotonic = staticmethod(time.monotonic)
    sleep = staticmethod(time.sleep)


class SteppedClock:
    """A clock that advances only by `sleep`."""

    def __init__(self, start: float = 0.0):
        self.now = start

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        if seconds > 0.0:
            self.now += seconds
