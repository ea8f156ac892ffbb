"""A clock in which time passes only while everybody waits, so that hours of a machine's life take milliseconds.

The threads that belong to the clock take turns: one runs until it waits, then the next that is ready, and only when
none is ready does the time jump to the nearest deadline. Runs are therefore the same each time. Threads that do not
belong to the clock may set events and sleep on it too, but when they do so is up to the operating system.

`using` puts a machine under such a clock. It needs nothing of the engine but that `smach.concurrence` takes its
threads, events and conditions from `threading`, as ours and the ROS distributions' do.
"""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import smach
from coglab_smach.clocks.clock import Clock


class ClockStalled(RuntimeError):
    """Virtual time cannot go on: all wait without a deadline, or one thread has stopped taking part.

    Two states that wait for each other's event end with it instead of hanging.
    """


class _Parked:
    """One waiting thread: whether it has its turn (`going`), and was woken by an event (`fired`) or by the time.

    Its gate is a bare lock that is held until the turn comes: an event of `threading` costs several locks each time.
    """

    __slots__ = ("fired", "gate", "going", "released", "thread")

    def __init__(self, thread: threading.Thread) -> None:
        self.thread = thread
        self.gate = threading.Lock()
        self.gate.acquire()
        self.fired = self.going = self.released = False

    def go(self) -> None:
        """Give it the turn. The clock's lock is held."""
        if not self.going:
            self.going = True
            self.gate.release()


class VirtualEvent:
    """`threading.Event` on a VirtualClock."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._flag = False
        self._waiters: list[_Parked] = []

    def is_set(self) -> bool:
        """Whether the event has happened."""
        return self._flag

    def set(self) -> None:
        """Wake all who wait, in the order in which they came."""
        with self._clock._lock:
            self._flag = True
            waiters, self._waiters = self._waiters, []
            for parked in waiters:
                self._clock._release(parked, fired=True)
            self._clock._dispatch()

    def clear(self) -> None:
        """From now on let others wait."""
        with self._clock._lock:
            self._flag = False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait at most `timeout` seconds of virtual time; whether the event is set."""
        if self._flag:
            return True
        if timeout is not None and timeout <= 0.0:
            return False
        return self._clock._park(self, timeout) or self._flag


class VirtualCondition:
    """`threading.Condition` on a VirtualClock. Its lock is an ordinary one: nobody may wait while holding it."""

    def __init__(self, clock: VirtualClock, lock: Any = None) -> None:
        self._clock = clock
        self._lock = lock or threading.RLock()
        self._waiters: list[VirtualEvent] = []
        self.acquire, self.release = self._lock.acquire, self._lock.release

    def __enter__(self) -> bool:
        return self._lock.__enter__()

    def __exit__(self, *exception: Any) -> None:
        self._lock.__exit__(*exception)

    def wait(self, timeout: float | None = None) -> bool:
        """Release the lock until somebody notifies or `timeout` seconds have passed; whether it was a notification."""
        told = self._clock.event()
        self._waiters.append(told)
        self.release()
        try:
            return told.wait(timeout)
        finally:
            self.acquire()
            if told in self._waiters:
                self._waiters.remove(told)

    def notify(self, n: int = 1) -> None:
        """Wake the first `n` who wait."""
        woken, self._waiters = self._waiters[:n], self._waiters[n:]
        for told in woken:
            told.set()

    def notify_all(self) -> None:
        """Wake all who wait."""
        self.notify(len(self._waiters))


class VirtualThread(threading.Thread):
    """A thread that belongs to a VirtualClock from `start()` to its end; its first turn comes before time goes on."""

    def __init__(self, clock: VirtualClock, *args: Any, **kw: Any) -> None:
        super().__init__(*args, **kw)
        self._clock = clock
        self._turn = _Parked(self)

    def start(self) -> None:
        # Queued by the caller, so that the order is that of the calls and not of the operating system.
        self._clock._enter(self, self._turn)
        try:
            super().start()
        except BaseException:
            self._clock._withdraw(self._turn)
            self._clock._leave(self)
            raise
        self._clock._give_turns()

    def run(self) -> None:
        try:
            self._clock._await_turn(self._turn)
            super().run()
        finally:
            self._clock._leave(self)


class VirtualClock(Clock):
    """Time that jumps from deadline to deadline.

    `start`: the first time (s). `stall_limit`: after so many seconds of wall time without any progress those who wait
    get ClockStalled. Example::

        with using(VirtualClock()) as clock:
            clock.sleep(3600.0)         # returns at once
            assert clock.now() == 3600.0
    """

    def __init__(self, start: float = 0.0, stall_limit: float = 60.0) -> None:
        self._lock = threading.Lock()
        self._now = float(start)
        self._stall_limit = stall_limit
        self._members: Counter[threading.Thread] = Counter()  # thread -> how often it has attached
        self._holder: threading.Thread | None = None  # the member whose turn it is
        self._ready: deque[_Parked] = deque()
        self._timed: list[tuple[float, int, _Parked]] = []
        self._parked: dict[_Parked, None] = {}
        self._sequence = itertools.count()
        self._progress = time.monotonic()

    def now(self) -> float:
        """The virtual time, s."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Wait in virtual time; 0 lets the others take their turn."""
        if not self._pass_alone(seconds):
            self._park(None, max(0.0, seconds))

    def _pass_alone(self, seconds: float) -> bool:
        """Moves time on by itself where nobody else has a turn until then: most sleeps of the one who steps the world.
        Nobody can come between, because the turn is the caller's."""
        if seconds <= 0.0 or self._holder is not threading.current_thread():
            return False
        with self._lock:
            end = self._now + seconds
            if self._ready or (self._timed and self._timed[0][0] <= end):
                return False
            self._now = end
            self._progress = time.monotonic()
        return True

    def event(self) -> VirtualEvent:
        """A new event, unset."""
        return VirtualEvent(self)

    def start_thread(self, target: Callable[[], object], name: str, daemon: bool = False) -> threading.Thread:
        """Start a thread that belongs to this clock."""
        thread = VirtualThread(self, target=target, name=name, daemon=daemon)
        thread.start()
        return thread

    @contextmanager
    def attached(self) -> Iterator[VirtualClock]:
        """The calling thread belongs to this clock inside the block: time waits for it."""
        me = threading.current_thread()
        turn = _Parked(me)
        first = self._enter(me, turn)
        try:
            if first:
                self._give_turns()
                self._await_turn(turn)
            yield self
        finally:
            self._leave(me)

    def _enter(self, thread: threading.Thread, turn: _Parked) -> bool:
        """Make `thread` a member; `turn` is queued, and True returned, if it was none."""
        with self._lock:
            self._members[thread] += 1
            if self._members[thread] > 1:
                return False
            self._parked[turn] = None
            self._release(turn, fired=False)
            return True

    def _withdraw(self, turn: _Parked) -> None:
        with self._lock:
            if turn in self._ready:
                self._ready.remove(turn)
            self._parked.pop(turn, None)

    def _give_turns(self) -> None:
        with self._lock:
            self._dispatch()

    def _leave(self, thread: threading.Thread) -> None:
        with self._lock:
            self._members[thread] -= 1
            if self._members[thread] <= 0:
                del self._members[thread]
                if self._holder is thread:
                    self._holder = None
                self._dispatch()

    def _park(self, event: VirtualEvent | None, timeout: float | None) -> bool:
        """Wait for the event or the time; whether it was the event."""
        me = threading.current_thread()
        parked = _Parked(me)
        with self._lock:
            if event is not None:
                if event._flag:
                    return True
                event._waiters.append(parked)
            if timeout is not None:
                heapq.heappush(self._timed, (self._now + timeout, next(self._sequence), parked))
            self._parked[parked] = None
            if self._holder is me:
                self._holder = None
            self._dispatch()
        try:
            self._await_turn(parked)
        finally:
            if event is not None and not parked.fired:
                with self._lock:
                    if parked in event._waiters:
                        event._waiters.remove(parked)
        return parked.fired

    def _release(self, parked: _Parked, fired: bool) -> None:
        """Put a waiting thread among the ready ones. The lock is held."""
        if not parked.released:
            parked.released = True
            parked.fired = fired
            self._ready.append(parked)

    def _dispatch(self) -> None:
        """Give the turn to the next ready thread, moving time on if there is none. The lock is held."""
        while self._holder is None:
            while not self._ready:
                if not self._timed:
                    return
                deadline, _, parked = heapq.heappop(self._timed)
                if not parked.released:
                    self._now = max(self._now, deadline)
                    self._release(parked, fired=False)
            parked = self._ready.popleft()
            self._parked.pop(parked, None)
            self._progress = time.monotonic()
            if parked.thread in self._members:
                self._holder = parked.thread
            parked.go()

    def _await_turn(self, parked: _Parked) -> None:
        while not parked.gate.acquire(timeout=self._stall_limit):
            with self._lock:
                if parked.going or time.monotonic() - self._progress < self._stall_limit:
                    continue
                parked.released = True
                if parked in self._ready:
                    self._ready.remove(parked)
                waiting = ", ".join(sorted(p.thread.name for p in self._parked)) or "nobody"
                running = self._holder.name if self._holder else "nobody"
                self._parked.pop(parked, None)
                if self._holder is None and parked.thread in self._members:
                    self._holder = parked.thread
            raise ClockStalled(
                f"virtual time has stood still at {self._now:.6f} s for {self._stall_limit:g} s of wall time: "
                f"{running} is running, {waiting} wait; a running thread must wait through the clock, and an event "
                "that is waited for without a time limit must be set by somebody"
            )


class _Threading:
    """The module `threading` with threads, events and conditions of a clock."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock

    def __getattr__(self, name: str) -> Any:
        return getattr(threading, name)

    def Thread(self, *args: Any, **kw: Any) -> VirtualThread:
        return VirtualThread(self._clock, *args, **kw)

    def Event(self) -> VirtualEvent:
        return self._clock.event()

    def Condition(self, lock: Any = None) -> VirtualCondition:
        return VirtualCondition(self._clock, lock)


@contextmanager
def using(clock: VirtualClock) -> Iterator[VirtualClock]:
    """Inside the block the calling thread belongs to `clock`, and so do the children of each Concurrence that is made
    and executed there. One clock at a time in a process. Example::

        with using(VirtualClock()) as clock:
            machine = build()
            machine.execute()           # an hour of it takes milliseconds
    """
    module: Any = smach.concurrence
    before = module.threading
    module.threading = _Threading(clock)
    try:
        with clock.attached():
            yield clock
    finally:
        module.threading = before
