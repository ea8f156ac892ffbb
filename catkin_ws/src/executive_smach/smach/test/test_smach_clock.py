"""The clock that can be replaced: machines in virtual time."""

import threading

import pytest
import smach
from machine_parts import in_thread
from smach.clock import SteadyClock, using
from smach.virtual_clock import ClockStalled, VirtualClock


class Waits(smach.State):
    """Waits in steps of 0.1 s, and ends early if asked."""

    def __init__(self, seconds):
        super().__init__(["done", "preempted"])
        self.seconds = seconds

    def execute(self, ud):
        end = smach.clock.now() + self.seconds
        while smach.clock.now() < end - 1e-9:
            if self.preempt_requested():
                self.service_preempt()
                return "preempted"
            smach.clock.sleep(0.1)
        return "done"


def both(*seconds):
    result = smach.Concurrence(["done", "preempted"], "done")
    with result:
        for i, s in enumerate(seconds):
            smach.Concurrence.add(f"C{i}", Waits(s))
    return result


def test_default_is_the_steady_clock():
    assert isinstance(smach.clock.current(), SteadyClock)
    before = smach.clock.now()
    smach.clock.sleep(0.01)
    assert smach.clock.now() >= before + 0.009
    event = smach.clock.current().event()
    assert smach.clock.wait(event, 0.01) is False
    event.set()
    assert smach.clock.wait(event) is True


def test_set_clock():
    before = smach.clock.current()
    clock = VirtualClock(start=5.0)
    try:
        smach.clock.set_clock(clock)
        assert smach.clock.now() == 5.0
        with pytest.raises(TypeError):
            smach.clock.set_clock(3)
    finally:
        smach.clock.set_clock(before)


def test_an_hour_of_concurrent_machines_costs_nothing():
    with using(VirtualClock()) as clock:
        assert both(10.0, 3600.0, 0.0).execute() == "done"
        assert clock.now() == pytest.approx(3600.0, abs=0.11)  # steps of 0.1 s, summed up
    assert isinstance(smach.clock.current(), SteadyClock)


def test_a_request_at_a_moment_of_virtual_time():
    machine = both(10.0, 50.0)
    with using(VirtualClock()) as clock:
        asker = clock.start_thread(lambda: (clock.sleep(20.05), machine.request_preempt()), "asker")
        assert machine.execute() == "preempted"
        assert clock.now() == pytest.approx(20.1, abs=1e-6)
        asker.join(5)


def test_runs_are_the_same_each_time():
    def run():
        order = []
        clock = VirtualClock()

        def work(name, step):
            for _ in range(30):
                clock.sleep(step)
                order.append((name, round(clock.now(), 9)))

        with clock.attached():
            threads = [
                clock.start_thread(lambda n=n: work(n, 0.1 * (n % 3 + 1)), f"w{n}")
                for n in range(6)
            ]
            clock.sleep(20.0)
            order.append("end")
        [t.join(10) for t in threads]
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
    event = clock.event()

    def wait():
        with clock.attached():
            return event.wait()

    waiter = in_thread(wait)
    event.set()
    waiter.join(5)
    assert waiter.result is True


def test_deadlock_is_an_error_and_no_hang():
    clock = VirtualClock(stall_limit=0.2)
    with pytest.raises(ClockStalled, match="MainThread"), clock.attached():
        clock.event().wait()
    with clock.attached():
        clock.sleep(1.0)
    assert clock.now() == 1.0


def test_a_member_that_does_not_wait_through_the_clock_is_named():
    clock = VirtualClock(stall_limit=0.2)
    stuck = threading.Event()
    thread = clock.start_thread(lambda: stuck.wait(10), "stubborn")
    with pytest.raises(ClockStalled, match="stubborn is running"):
        clock.sleep(1.0)
    stuck.set()
    thread.join(5)


def test_a_member_that_raises_gives_its_turn_away():
    with using(VirtualClock()) as clock:
        hook, threading.excepthook = threading.excepthook, lambda args: None
        try:
            clock.start_thread(lambda: 1 / 0, "broken")
            clock.sleep(1.0)
        finally:
            threading.excepthook = hook
        assert clock.now() == 1.0


def test_children_inherit_the_clock_and_siblings_do_not():
    seen = []
    concurrent = smach.Concurrence(["done"], "done")
    with concurrent:
        state = smach.CBState(
            lambda ud: seen.append(smach.clock.current()) or "done", outcomes=["done"]
        )
        smach.Concurrence.add("A", state)
    with using(VirtualClock()) as clock:
        concurrent.execute()
    concurrent.execute()
    assert seen[0] is clock and isinstance(seen[1], SteadyClock)
