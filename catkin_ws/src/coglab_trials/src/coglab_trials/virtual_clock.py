"""A clock whose time passes only while all its threads wait. Hours of a state machine take milliseconds.

The threads of the clock take turns. One thread runs until it waits, then the next ready thread runs. If no thread is
ready, the time jumps to the nearest deadline. Therefore, every run is the same. Other threads may also set events and
sleep on the clock, but the operating system decides when they do so.

Passing the turn to another thread costs much more than most turns do. Therefore, the thread that waits next calls the
polled conditions (`poll`), in the same order. The polling thread gets its turn when its condition is true.

`using` runs a machine under such a clock. It requires only that `smach.concurrence` takes its threads, events and
conditions from `threading`. Our engine and those of the ROS distributions do so.
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
    """Virtual time cannot go on: all threads wait without a deadline, or a running thread does not return to it.

    Two states that wait for each other's event raise this error instead of hanging.
    """


class _Poll:
    """Condition polled by a waiting thread, and its result: `over`, or an `error`. Neither: call it again."""

    __slots__ = ("call", "error", "over", "period")

    def __init__(self, call: Callable[[], bool], period: float) -> None:
        self.call, self.period = call, period
        self.over = False
        self.error: Exception | None = None


class _Parked:
    """One waiting thread. `going`: it has its turn. `fired`: an event woke it, not the time. `poll`: its condition.

    The gate is a bare lock that is held until the turn comes. An event of `threading` would cost several locks.
    """

    __slots__ = ("fired", "gate", "going", "poll", "released", "thread")

    def __init__(self, thread: threading.Thread, poll: _Poll | None = None) -> None:
        self.thread = thread
        self.poll = poll
        self.gate = threading.Lock()
        self.gate.acquire()
        self.fired = self.going = self.released = False

    def go(self) -> None:
        """Give the turn to this thread. The caller holds the clock's lock."""
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
        """True after set(), until clear()."""
        return self._flag

    def set(self) -> None:
        """Wake all waiting threads, in the order of their arrival."""
        with self._clock._lock:
            self._flag = True
            waiters, self._waiters = self._waiters, []
            for parked in waiters:
                self._clock._release(parked, fired=True)
            self._clock._dispatch()

    def clear(self) -> None:
        """Reset the event: wait() blocks again."""
        with self._clock._lock:
            self._flag = False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait at most `timeout` seconds of virtual time. Returns True if the event is set."""
        if self._flag:
            return True
        if timeout is not None and timeout <= 0.0:
            return False
        return self._clock._park(self, timeout) or self._flag


class VirtualCondition:
    """`threading.Condition` on a VirtualClock. Its lock is an ordinary one: do not wait while holding it."""

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
        """Release the lock and wait for a notification, at most `timeout` s. Returns True if it was notified."""
        event = self._clock.event()
        self._waiters.append(event)
        self.release()
        try:
            return event.wait(timeout)
        finally:
            self.acquire()
            if event in self._waiters:
                self._waiters.remove(event)

    def notify(self, n: int = 1) -> None:
        """Wake the first `n` waiting threads."""
        woken, self._waiters = self._waiters[:n], self._waiters[n:]
        for event in woken:
            event.set()

    def notify_all(self) -> None:
        """Wake all waiting threads."""
        self.notify(len(self._waiters))


class VirtualThread(threading.Thread):
    """A thread that belongs to a VirtualClock from `start()` to its end. Time waits for its first turn."""

    def __init__(self, clock: VirtualClock, *args: Any, **kw: Any) -> None:
        super().__init__(*args, **kw)
        self._clock = clock
        self._turn = _Parked(self)
        self._is_over = False

    def is_alive(self) -> bool:
        """False from the end of its last turn. The operating system ends it a little later, at any time."""
        return super().is_alive() and not self._is_over

    def start(self) -> None:
        # The caller queues the thread: the order is then that of the calls, not that of the operating system.
        self._clock._enter(self, self._turn)
        try:
            super().start()
        except BaseException:
            self._clock._withdraw(self._turn)
            self._clock._leave(self)
            raise
        self._clock._give_turns()

    def run(self) -> None:
        _of_thread.clocks = [self._clock]
        try:
            self._clock._await_turn(self._turn)
            super().run()
        finally:
            self._is_over = True
            self._clock._leave(self)


class VirtualClock(Clock):
    """A clock whose time jumps from deadline to deadline.

    `start`: the first time (s). `stall_limit`: wall time (s) without progress after which waiting threads raise
    ClockStalled; the time in which the process itself is stopped does not count. Example::

        with using(VirtualClock()) as clock:
            clock.sleep(3600.0)         # returns at once
            assert clock.now() == 3600.0
    """

    def __init__(self, start: float = 0.0, stall_limit: float = 60.0) -> None:
        self._lock = threading.Lock()
        self._now = float(start)
        self._stall_limit = stall_limit
        self._members: Counter[threading.Thread] = Counter()  # thread -> number of its attachments
        self._holder: threading.Thread | None = None  # the member that has the turn
        self._poller: threading.Thread | None = None  # the thread that polls for the holder
        self._ready: deque[_Parked] = deque()
        self._timed: list[tuple[float, int, _Parked]] = []
        self._parked: dict[_Parked, None] = {}
        self._sequence = itertools.count()
        self._progress = time.monotonic()
        self._free = False

    def now(self) -> float:
        """Returns the virtual time, s."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Wait in virtual time. 0 gives the other threads a turn."""
        if not self._pass_alone(seconds):
            self._park(None, max(0.0, seconds))

    def poll(self, over: Callable[[], bool], period: float) -> None:
        """Call `over` at once, and then every `period` s of virtual time until it returns True. Its exceptions are
        raised here.

        After the first time other threads call it, while they begin to wait. It must not wait itself: RuntimeError."""
        while not over():
            if self._holder is not threading.current_thread():
                self.sleep(period)  # this thread does not belong to the clock
                continue
            poll = _Poll(over, period)
            self._park(None, max(0.0, period), poll)
            if poll.error is not None:
                raise poll.error
            if poll.over:
                return

    def _pass_alone(self, seconds: float) -> bool:
        """Move the time on directly if no other thread has a turn before `seconds` have passed. Returns True if it did.

        Most sleeps of the thread that steps the world take this path. The caller has the turn, so no other thread
        can interfere."""
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
        """Returns a new event that is not set."""
        return VirtualEvent(self)

    def let_think(self, free: bool) -> None:
        """`free`: the running thread may keep its turn for any wall time, like a person at a prompt. It does not stall
        the clock. False: the stall limit counts again from now on."""
        with self._lock:
            self._free, self._progress = free, time.monotonic()

    def start_thread(self, target: Callable[[], object], name: str, daemon: bool = False) -> threading.Thread:
        """Start a thread that belongs to this clock, and return it."""
        thread = VirtualThread(self, target=target, name=name, daemon=daemon)
        thread.start()
        return thread

    @contextmanager
    def attached(self) -> Iterator[VirtualClock]:
        """Inside the block, the calling thread belongs to this clock: time waits for it."""
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
        """Make `thread` a member. If it is a new member, `turn` is queued and True is returned."""
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

    def _park(self, event: VirtualEvent | None, timeout: float | None, poll: _Poll | None = None) -> bool:
        """Wait for the event or the time; with `poll`, until that has a result. Returns True if the event came."""
        me = threading.current_thread()
        if self._poller is me:
            raise RuntimeError("a condition polled on a virtual clock must not wait; use a loop with sleep()")
        parked = _Parked(me, poll)
        with self._lock:
            if event is not None:
                if event._flag:
                    return True
                event._waiters.append(parked)
            if timeout is not None:
                heapq.heappush(self._timed, (self._now + timeout, next(self._sequence), parked))
            self._parked[parked] = None
            polls = self._holder is me
            if polls:
                self._holder = None
            self._dispatch(polls)
        try:
            self._await_turn(parked)
        finally:
            if event is not None and not parked.fired:
                with self._lock:
                    if parked in event._waiters:
                        event._waiters.remove(parked)
        return parked.fired

    def _release(self, parked: _Parked, fired: bool) -> None:
        """Put a waiting thread into the queue of ready threads. The caller holds the lock."""
        if not parked.released:
            parked.released = True
            parked.fired = fired
            self._ready.append(parked)

    def _dispatch(self, polls: bool = False) -> None:
        """Give the turn to the next ready thread. If none is ready, move the time on. The caller holds the lock.
        ``polls``: it is a member that begins to wait, and so can poll for others."""
        while self._holder is None:
            while not self._ready:
                if not self._timed:
                    return
                deadline, _, parked = heapq.heappop(self._timed)
                if not parked.released:
                    self._now = max(self._now, deadline)
                    self._release(parked, fired=False)
            parked = self._ready.popleft()
            self._progress = time.monotonic()
            if parked.poll is not None and polls and not self._poll(parked, parked.poll):
                continue
            self._parked.pop(parked, None)
            if parked.thread in self._members:
                self._holder = parked.thread
            parked.go()

    def _poll(self, parked: _Parked, poll: _Poll) -> bool:
        """Poll in the turn of a waiting thread. Returns True if that thread must go on by itself. The caller holds the
        lock, and does not while it polls."""
        self._holder, self._poller = parked.thread, threading.current_thread()
        self._lock.release()
        again = False
        try:
            poll.over = poll.call()
            again = not poll.over
        except Exception as error:
            poll.error = error
        except BaseException:  # Ctrl-C in this thread, which is not meant for the other one
            again = True
            raise
        finally:
            self._lock.acquire()
            self._holder = self._poller = None
            if again:
                parked.released = False
                heapq.heappush(self._timed, (self._now + poll.period, next(self._sequence), parked))
        return not again

    def _await_turn(self, parked: _Parked) -> None:
        # Two halves without progress: a stopped and continued process misses at most one of them.
        seen = -1.0
        while not parked.gate.acquire(timeout=self._stall_limit / 2.0):
            with self._lock:
                if parked.going or self._free or self._progress != seen:
                    seen = self._progress
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
    """The module `threading`. In a thread with a VirtualClock: with threads, events and conditions of that clock."""

    def __getattr__(self, name: str) -> Any:
        return getattr(threading, name)

    def Thread(self, *args: Any, **kw: Any) -> threading.Thread:
        clock = _clock_here()
        return threading.Thread(*args, **kw) if clock is None else VirtualThread(clock, *args, **kw)

    def Event(self) -> threading.Event | VirtualEvent:
        clock = _clock_here()
        return threading.Event() if clock is None else clock.event()

    def Condition(self, lock: Any = None) -> threading.Condition | VirtualCondition:
        clock = _clock_here()
        return threading.Condition(lock) if clock is None else VirtualCondition(clock, lock)


_of_thread = threading.local()  # clocks: those of the calling thread, innermost last
_users = 0  # blocks of `using` that are open in this process
_users_lock = threading.Lock()


def _clock_here() -> VirtualClock | None:
    clocks = getattr(_of_thread, "clocks", None)
    return clocks[-1] if clocks else None


def _count_users(change: int) -> None:
    """Give smach the module above while any block of `using` is open, else `threading` itself."""
    global _users
    module: Any = smach.concurrence
    with _users_lock:
        _users += change
        module.threading = _Threading() if _users else threading


@contextmanager
def using(clock: VirtualClock) -> Iterator[VirtualClock]:
    """Inside the block, the calling thread belongs to `clock`. So do the children of each Concurrence that is
    created and executed there. Each thread of a process may use its own clock. Example::

        with using(VirtualClock()) as clock:
            machine = build()
            machine.execute()           # an hour of it takes milliseconds
    """
    if not hasattr(_of_thread, "clocks"):
        _of_thread.clocks = []
    mine = _of_thread.clocks
    _count_users(+1)
    mine.append(clock)
    try:
        with clock.attached():
            yield clock
    finally:
        mine.remove(clock)
        _count_users(-1)
