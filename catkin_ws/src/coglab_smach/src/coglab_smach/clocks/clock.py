"""The clock that states measure time and wait by: the steady one of the machine, or a virtual one (virtual_clock)."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod

from coglab_py.pace import Pace


class Clock(ABC):
    """A source of time and of waiting. Times are in seconds; the origin is arbitrary."""

    @abstractmethod
    def now(self) -> float:
        """The time, s."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Wait; a negative duration counts as 0."""


class SteadyClock(Clock):
    """Wall time that no adjustment of the system's date can move: the robot's."""

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds))


class PacedClock(Clock):
    """The steady clock, slowed while the simulated cell is slowed down on a busy computer."""

    def __init__(self, pace: Pace) -> None:
        self._pace = pace

    def now(self) -> float:
        return self._pace.now()

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds) / self._pace.factor)
