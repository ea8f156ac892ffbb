"""Clocks of the states, for measuring time and waiting: steady, or slowed with the simulated cell."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from coglab_py.pace import Pace


class Clock(ABC):
    """Measures time and waits. Times are in s; the origin is arbitrary."""

    @abstractmethod
    def now(self) -> float:
        """Returns the time, s."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds``; a negative duration counts as 0."""

    def poll(self, over: Callable[[], bool], period: float) -> None:
        """Call ``over`` at once, and then every ``period`` s until it returns True. Its exceptions are raised here.

        ``over`` only looks: it does not wait. A virtual clock calls it in other threads."""
        while not over():
            self.sleep(period)


class SteadyClock(Clock):
    """The robot's clock: monotonic, independent of changes of the system date."""

    def now(self) -> float:
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds))


class PacedClock(Clock):
    """The steady clock, slowed together with the simulated cell on a busy computer."""

    def __init__(self, pace: Pace) -> None:
        self._pace = pace

    def now(self) -> float:
        return self._pace.now()

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds) / self._pace.factor)
