"""The virtual clock, and state machines on it."""

import re
import signal
import subprocess
import sys
import threading
import time

import pytest
import smach
from coglab_trials.virtual_clock import ClockStalled, VirtualClock, VirtualThread, using


class Waits(smach.State):
    """Waits in steps of 0.1 s, and ends early if asked."""

    def __init__(self, clock, seconds):
        smach.State.__init__(self, ["done", "preempted"])
        self.clock, self.seconds = clock, seconds

    def execute(self, ud):
        end = self.clock.now() + self.seconds
        while self.clock.now() < end - 1e-9:
            if self.preempt_requested():
                self.service_preempt()
                return "preempted"
            self.clock.sleep(0.1)
        return "done"


def both(clock, *seconds):
    everywhere = {f"C{i}": "done" for i in range(len(seconds))}
    result = smach.Concurrence(["done", "preempted"], "preempted", outcome_map={"done": everywhere})
    with result:
        for i, s in enumerate(seconds):
            smach.Concurrence.add(f"C{i}", Waits(clock, s))
    return result


def test_a_preemption_at_a_virtual_time():
    with using(VirtualClock()) as clock:
        machine = both(clock, 10.0, 50.0)
        caller = clock.start_thread(lambda: (clock.sleep(20.05), machine.request_preempt()), "caller")
        assert machine.execute() == "preempted"
        assert clock.now() == pytest.approx(20.1, abs=1e-6)
        caller.join(120)


def test_runs_are_the_same_each_time():
    def run():
        order = []
        clock = VirtualClock()

        def work(name, step):
            for _ in range(30):
                clock.sleep(step)
                order.append((name, round(clock.now(), 9)))

        with clock.attached():
            threads = [clock.start_thread(lambda n=n: work(n, 0.1 * (n % 3 + 1)), f"w{n}") for n in range(6)]
            clock.sleep(20.0)
            order.append("end")
        [t.join(120) for t in threads]
        return order

    first = run()
    assert len(first) == 181 and all(run() == first for _ in range(5))


def test_events_wake_at_once_and_time_out():
    with using(VirtualClock()) as clock:
        event = clock.event()
        assert event.wait(0) is False and event.wait(2.0) is False and clock.now() == 2.0
        clock.start_thread(lambda: (clock.sleep(1.0), event.set()), "setter")
        assert event.wait(60.0) is True and clock.now() == 3.0
        assert event.is_set() and event.wait() is True
        event.clear()
        assert not event.is_set()


def test_an_outside_thread_can_set_an_event():
    clock = VirtualClock()
    event, seen = clock.event(), []

    def wait():
        with clock.attached():
            seen.append(event.wait())

    waiter = threading.Thread(target=wait)
    waiter.start()
    event.set()
    waiter.join(120)
    assert seen == [True]


def test_a_deadlock_raises_an_error():
    clock = VirtualClock(stall_limit=0.2)
    with pytest.raises(ClockStalled, match=re.escape(threading.current_thread().name)), clock.attached():
        clock.event().wait()
    with clock.attached():
        clock.sleep(1.0)
    assert clock.now() == 1.0


def test_a_thread_that_does_not_wait_through_the_clock_is_named():
    clock = VirtualClock(stall_limit=0.2)
    stuck = threading.Event()
    thread = clock.start_thread(lambda: stuck.wait(10), "stubborn")
    with pytest.raises(ClockStalled, match="stubborn"):
        clock.sleep(1.0)
    stuck.set()
    thread.join(120)


def test_a_thread_is_over_with_its_last_turn():
    """However late the operating system ends it: an engine that asks would else wait at random."""
    ends = threading.Event()

    class Late(VirtualThread):
        def run(self):
            super().run()
            ends.wait(60.0)

    with using(VirtualClock()) as clock:
        thread = Late(clock, target=lambda: clock.sleep(0.5))
        thread.start()
        assert thread.is_alive()
        clock.sleep(1.0)
        alive = thread.is_alive()
        ends.set()
    assert not alive
    thread.join(60.0)


STOPPED = """
import time
from coglab_trials.virtual_clock import VirtualClock

def work():
    print("stop", flush=True)
    time.sleep(0.3)

clock = VirtualClock(stall_limit=1.0)
clock.start_thread(work, "works")
clock.sleep(1.0)
print("on")
"""


def test_a_stopped_process_continues():
    """Ctrl-Z and fg, or a suspended virtual machine, are no stall of a thread."""
    with subprocess.Popen([sys.executable, "-c", STOPPED], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "stop\n"
        child.send_signal(signal.SIGSTOP)
        time.sleep(1.5)
        child.send_signal(signal.SIGCONT)
        assert child.communicate(timeout=300)[0] == "on\n"


def test_a_thread_that_raises_passes_its_turn_on():
    with using(VirtualClock()) as clock:
        hook, threading.excepthook = threading.excepthook, lambda args: None
        try:
            clock.start_thread(lambda: 1 / 0, "broken")
            clock.sleep(1.0)
        finally:
            threading.excepthook = hook
        assert clock.now() == 1.0


def test_each_thread_may_use_its_own_clock():
    """A Concurrence uses the clock of the thread that creates it."""
    import smach

    both, seen = threading.Barrier(2), {}

    def use(seconds):
        with using(VirtualClock()) as clock:
            both.wait(120)
            child = smach.concurrence.threading.Thread(target=lambda: clock.sleep(seconds))
            child.start()
            clock.sleep(2 * seconds)
            now = clock.now()
            child.join(120)  # its last sleep is over; on a busy computer the thread may end later
            seen[seconds] = (now, child.is_alive())
            both.wait(120)

    threads = [threading.Thread(target=use, args=(seconds,)) for seconds in (10.0, 1000.0)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(240)
    assert seen == {10.0: (20.0, False), 1000.0: (2000.0, False)}
    assert smach.concurrence.threading is threading


def test_a_thread_that_may_think_does_not_stall_the_clock():
    clock, ended = VirtualClock(stall_limit=2.0), []
    with clock.attached():
        thread = clock.start_thread(lambda: ended.append(clock.sleep(1.0)), "other")
        clock.sleep(0.5)
        clock.let_think(True)
        threading.Event().wait(4.5)
        clock.let_think(False)
        clock.sleep(1.0)
    thread.join(120)
    assert ended == [None]
