"""The clock machines run by: the steady wall clock, or a virtual one in which waiting costs no
time.

States that wait or measure time ask this module instead of `time` and `threading`, and then run
unchanged in real and in virtual time::

    class Pause(smach.State):
        def execute(self, ud):
            smach.clock.sleep(2.0)
            return "done"

    with smach.clock.using(VirtualClock()) as clock:
        machine.execute()            # returns at once
        assert clock.now() == 2.0

The children of a Concurrence inherit the clock of the thread that executes the Concurrence.
"""

from __future__ import annotations

import contextvars
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol


class Event(Protocol):
    """What `Clock.event()` returns: the interface of `threading.Event`.

    Example: `done = clock.event(); done.wait(5.0)`.
    """

    def set(self) -> None:
        """Wake all who wait. Example: `done.set()`."""

    def clear(self) -> None:
        """From now on let others wait. Example: `done.clear()`."""

    def is_set(self) -> bool:
        """Whether the event has happened. Example: `if done.is_set(): ...`."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the event is set or `timeout` seconds have passed; whether it is set.

        Example: `if not done.wait(5.0): return "aborted"`.
        """


class Clock(ABC):
    """A source of time and of waiting. Times are in seconds; the origin is arbitrary.

    Example: derive from it to drive machines by the ticks of a simulation.
    """

    #: How often (s) an endless wait looks at `smach.is_shutdown()`; None: never.
    shutdown_poll: float | None = None

    @abstractmethod
    def now(self) -> float:
        """The time in seconds. Example: `started = clock.now()`."""

    @abstractmethod
    def sleep(self, seconds: float) -> None:
        """Wait. Example: `clock.sleep(0.1)`."""

    @abstractmethod
    def event(self) -> Event:
        """A new event to wait for, unset. Example: `done = clock.event()`."""

    @abstractmethod
    def start_thread(
        self, target: Callable[[], object], name: str, daemon: bool = False
    ) -> threading.Thread:
        """Start a thread that belongs to this clock.

        Example: `clock.start_thread(work, "worker").join()`.
        """

    @contextmanager
    def attached(self) -> Iterator[Clock]:
        """The calling thread belongs to this clock inside the block.

        Example: `with clock.attached(): ...`.
        """
        yield self

    def wait(self, event: Event, timeout: float | None = None) -> bool:
        """Wait for an event of this clock.

        Example: `clock.wait(done, 5.0)` is False after 5 s in vain.
        """
        return event.wait(timeout)


class SteadyClock(Clock):
    """Wall time that no adjustment of the system's date can move. The default.

    Example: `SteadyClock().sleep(0.1)`.
    """

    shutdown_poll = 0.2

    def now(self) -> float:
        """Seconds since an arbitrary moment. Example: `clock.now()`."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait. Example: `clock.sleep(0.1)`."""
        time.sleep(max(0.0, seconds))

    def event(self) -> Event:
        """A `threading.Event`. Example: `clock.event().wait(0.1)`."""
        return threading.Event()

    def start_thread(
        self, target: Callable[[], object], name: str, daemon: bool = False
    ) -> threading.Thread:
        """An ordinary thread, started. Example: `clock.start_thread(work, "worker")`."""
        thread = threading.Thread(target=in_current_context(target), name=name, daemon=daemon)
        thread.start()
        return thread


def in_current_context(target: Callable[[], object]) -> Callable[[], object]:
    """`target`, to be called in another thread with the caller's choice of clock.

    Example: `threading.Thread(target=in_current_context(work))`.
    """
    context = contextvars.copy_context()
    return lambda: context.run(target)


_default: Clock = SteadyClock()
_chosen: contextvars.ContextVar[Clock | None] = contextvars.ContextVar("smach_clock", default=None)


def current() -> Clock:
    """The clock of the calling thread. Example: `done = smach.clock.current().event()`."""
    return _chosen.get() or _default


def set_clock(clock: Clock) -> None:
    """Make `clock` the default of the whole process. Example:
    `smach.clock.set_clock(SteadyClock())`.

    Raises TypeError if it is no Clock.
    """
    global _default
    if not isinstance(clock, Clock):
        raise TypeError(f"set_clock: expected a smach.clock.Clock, got {type(clock).__name__}")
    _default = clock


@contextmanager
def using(clock: Clock) -> Iterator[Clock]:
    """Inside the block this thread, and the children of machines it executes, run by `clock`.

    Example: `with smach.clock.using(VirtualClock()): machine.execute()`.
    """
    token = _chosen.set(clock)
    try:
        with clock.attached():
            yield clock
    finally:
        _chosen.reset(token)


def now() -> float:
    """The time of the current clock (s). Example: `late = smach.clock.now() > deadline`."""
    return current().now()


def sleep(seconds: float) -> None:
    """Wait on the current clock. Example: `smach.clock.sleep(0.05)`."""
    current().sleep(seconds)


def wait(event: Event, timeout: float | None = None) -> bool:
    """Wait on the current clock for an event it made. Example: `smach.clock.wait(done, 5.0)`."""
    return current().wait(event, timeout)
