"""Preempts at random moments of nested concurrent machines: none lost, none left over."""

import os
import random
import threading
import time

import smach
from machine_parts import Serves


class Hops(Serves):
    """A short state: one poll, then on, so that requests often fall between two states."""

    def execute(self, ud):
        self.started.set()
        time.sleep(0.0002)
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        return "done"


def cycle(n):
    """A machine of n states in a circle: it never ends by itself."""
    machine = smach.StateMachine(["preempted"])
    with machine:
        for i in range(n):
            smach.StateMachine.add(f"S{i}", Hops(), {"done": f"S{(i + 1) % n}"})
    return machine


def nest(depth):
    """Concurrences in machines in concurrences, none of which ends without a request."""
    if depth == 0:
        return cycle(3)
    both = smach.Concurrence(["done", "preempted"], "done")
    with both:
        smach.Concurrence.add("A", nest(depth - 1))
        smach.Concurrence.add("B", cycle(2))
    machine = smach.StateMachine(["preempted"])
    with machine:
        smach.StateMachine.add("FIRST", Hops(), {"done": "BOTH"})
        smach.StateMachine.add("BOTH", both, {"done": "FIRST"})
    return machine


def flags(state):
    yield state.preempt_requested()
    if isinstance(state, smach.Container):
        for child in state.get_children().values():
            yield from flags(child)


def test_preempts_at_random_moments_none_lost_none_left_over():
    seed = random.Random(20240)
    machine = nest(2)
    runs = 3000 if os.environ.get("COGLAB_LONG") else 300
    threads_before = threading.active_count()
    for run in range(runs):
        caller = threading.Timer(seed.random() * 0.006, machine.request_preempt)
        if run % 10 == 0:
            machine.request_preempt()  # before the start
        else:
            caller.start()
        assert machine.execute() == "preempted", f"run {run}"
        assert not any(flags(machine)), f"run {run} left a flag up"
        if run % 10:
            caller.join()
        assert not machine.preempt_requested()
    assert threading.active_count() == threads_before
