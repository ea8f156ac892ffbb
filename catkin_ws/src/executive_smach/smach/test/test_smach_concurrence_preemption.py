"""Preemption, shutdown and errors of a Concurrence."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
import smach
from machine_parts import ALL_DONE, Ignores, Says, Serves, concurrence, in_thread, machine


def test_preempt_served_by_all():
    children = {"A": Serves(patience=20), "B": Serves(patience=20)}
    both = concurrence(children=children, outcome_map=ALL_DONE)
    run = in_thread(both.execute)
    assert all(child.started.wait(60.0) for child in children.values())
    both.request_preempt()
    run.join(60.0)
    assert run.result == "preempted" and not both.preempt_requested()
    assert not any(child.preempt_requested() for child in children.values())


def test_preempt_ignored_by_one(log):
    stubborn = Ignores("done")
    both = concurrence(children={"A": Serves(patience=20), "B": stubborn}, outcome_map=ALL_DONE)
    stubborn.machine = both
    assert both.execute() == "failed"
    assert both.preempt_requested() and not stubborn.preempt_requested()
    assert "'B'" in log.text("warn")


def test_preempt_ignored_is_carried_by_the_machine_around():
    stubborn, after = Ignores("done"), Serves()
    both = concurrence(outcomes=["done"], default="done", children={"B": stubborn})
    outer = machine(both, after)
    stubborn.machine = outer
    assert outer.execute() == "preempted" and after.seen == [True]


@pytest.mark.parametrize("moment", ["before", "start_cb", "transition_cb"])
def test_a_request_before_or_during_the_start_reaches_every_child(moment):
    for _ in range(20):
        children = {"A": Serves(patience=20), "B": Serves(patience=20)}
        both = concurrence(children=children, outcome_map=ALL_DONE)
        once = iter([1])

        def ask(*args, both=both, once=once):
            if next(once, None):
                both.request_preempt()

        if moment == "before":
            ask()
        elif moment == "start_cb":
            both.register_start_cb(ask)
        else:
            both.register_transition_cb(ask)
        begun = time.monotonic()
        assert both.execute() == "preempted"
        assert time.monotonic() - begun < 60  # not by patience


def test_ignored_requests_do_not_poison_the_next_run():
    stubborn, polite = Ignores("done"), Serves()
    both = concurrence(children={"A": polite, "B": stubborn}, outcome_map=ALL_DONE)
    stubborn.machine = both
    both.execute()
    stubborn.machine = None
    assert both.execute() == "done" and polite.seen[-1] is False and not both.preempt_requested()


@pytest.mark.parametrize("moment", ["transition_cb", "child_termination_cb"])
@pytest.mark.parametrize("whom", ["concurrence", "machine around"])
def test_a_request_when_the_last_child_has_just_ended_gives_preempted(moment, whom):
    after = Serves()

    def ask():
        (both if whom == "concurrence" else outer).request_preempt()
        return True

    both = concurrence(
        children={"A": Says("done"), "B": Says("done")},
        outcome_map=ALL_DONE,
        child_termination_cb=lambda outcomes: moment == "child_termination_cb" and all(outcomes.values()) and ask(),
    )
    outer = machine(both, after, outcomes=["done", "failed", "preempted"])
    if moment == "transition_cb":
        both.register_transition_cb(lambda ud, labels: labels or ask())
    assert outer.execute() == "preempted"
    assert after.seen == [] and not both.preempt_requested() and not outer.preempt_requested()


def test_a_request_that_a_child_did_not_take_is_carried_on(log):
    class Deaf(Says):
        def request_preempt(self):
            raise OSError("deaf")

    after = Serves()
    both = concurrence(children={"A": Deaf("done")}, outcome_map={"done": {"A": "done"}})
    outer = machine(both, after, outcomes=["done", "failed", "preempted"])
    both.register_start_cb(lambda ud, labels: outer.request_preempt())
    assert outer.execute() == "preempted" and after.seen == [True]
    assert "deaf" in log.text("error")


def test_shutdown_takes_the_children_along():
    children = {"A": Serves(patience=30), "B": Serves(patience=30)}
    both = concurrence(children=children)
    run = in_thread(both.execute)
    assert all(child.started.wait(60.0) for child in children.values())
    smach.set_shutdown_check(lambda: True)
    run.join(60.0)
    assert not run.is_alive()


def test_ctrl_c_in_the_main_thread_takes_the_children_along():
    code = """
import smach, machine_parts
both = smach.Concurrence(["done", "preempted"], "done")
with both:
    smach.Concurrence.add("A", machine_parts.Serves(patience=60))
    smach.Concurrence.add("B", machine_parts.Serves(patience=60))
both.register_transition_cb(lambda ud, labels: print("READY", flush=True))
try:
    both.execute()
except KeyboardInterrupt:
    print("INTERRUPTED", both.is_running(), flush=True)
"""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([p for p in sys.path if p])}
    # A shell that runs the tests in the background makes its processes ignore Ctrl-C.
    command = ["env", "--default-signal=INT", sys.executable, "-c", code]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env)
    try:
        while "READY" not in process.stdout.readline():
            pass
        process.send_signal(signal.SIGINT)
        assert "INTERRUPTED False" in process.communicate(timeout=60.0)[0]
    finally:
        process.kill()
        process.wait()


def test_missing_threads_are_an_error_and_nothing_runs(monkeypatch):
    children = {"A": Says("done"), "B": Says("done")}
    both = concurrence(children=children)
    real, count = threading.Thread.start, []

    def start(self):
        if self.name.startswith("concurrent_split"):
            count.append(1)
            if len(count) == 2:
                raise RuntimeError("can't start new thread")
        real(self)

    monkeypatch.setattr(threading.Thread, "start", start)
    with pytest.raises(smach.InvalidStateError, match="'B'"):
        both.execute()
    monkeypatch.undo()
    assert children["A"].runs == 0 and both.execute() == "failed"
