"""Preemption of machines: no request is lost, and none is left over for the next run."""

import smach
from machine_parts import Calls, Ignores, Says, Serves, in_thread, machine


def test_served():
    state = Serves(patience=10)
    sm = machine(state)
    run = in_thread(sm.execute)
    assert state.started.wait(60.0)
    sm.request_preempt()
    run.join(60.0)
    assert run.result == "preempted"
    assert not sm.preempt_requested() and not state.preempt_requested()


def test_ignored_at_the_terminal_state_the_flag_stays_for_the_parent():
    state = Ignores("done")
    sm = machine(state)
    state.machine = sm
    assert sm.execute() == "done" and sm.preempt_requested()


def test_ignored_the_next_state_sees_it_on_entry():
    first, second = Ignores("done"), Serves()
    sm = machine(first, second)
    first.machine = sm
    assert sm.execute() == "preempted"
    assert second.seen == [True] and not first.preempt_requested() and not sm.preempt_requested()


def test_served_then_the_next_state_is_normal():
    first, second = Serves(), Says("done")
    sm = machine(first, second, transitions={0: {"preempted": "S1"}})
    sm.request_preempt()
    assert sm.execute() == "done"
    assert first.seen == [True] and second.seen == [False] and not sm.preempt_requested()


def test_twice_in_one_run():
    class AskAgain(Serves):
        def execute(self, ud):
            result = super().execute(ud)
            sm.request_preempt()
            return result

    first, second = AskAgain(), Serves()
    sm = machine(first, second, transitions={0: {"preempted": "S1"}})
    sm.request_preempt()
    assert sm.execute() == "preempted"
    assert second.seen == [True] and not sm.preempt_requested()


def test_before_the_start_the_first_state_sees_it():
    state = Serves()
    sm = machine(state)
    sm.request_preempt()
    assert sm.execute() == "preempted" and state.seen == [True]
    assert sm.execute() == "done" and state.seen == [True, False]


def test_nested_and_ignored_is_carried_by_the_parent():
    leaf, after = Ignores("done"), Serves()
    inner = machine(leaf)
    outer = machine(inner, after)
    leaf.machine = outer
    assert outer.execute() == "preempted"
    assert after.seen == [True] and not inner.preempt_requested() and not outer.preempt_requested()


def test_nested_with_concurrence():
    leaf = Serves(patience=10)
    both = smach.Concurrence(["done", "preempted"], "done")
    with both:
        smach.Concurrence.add("A", leaf)
        smach.Concurrence.add("B", Serves(patience=10))
    outer = machine(machine(both))
    run = in_thread(outer.execute)
    assert leaf.started.wait(60.0)
    outer.request_preempt()
    run.join(60.0)
    assert run.result == "preempted" and not outer.preempt_requested()


def test_a_child_whose_request_preempt_raises_is_logged_and_the_request_kept(log):
    class Broken(Says):
        def request_preempt(self):
            raise RuntimeError("no preempt here")

    first, second = Broken("done"), Serves()
    sm = machine(first, second)
    sm.request_preempt()
    assert sm.execute() == "preempted" and second.seen == [True]
    assert "no preempt here" in log.text("error")


def test_an_ignored_request_does_not_poison_the_next_run():
    state = Ignores("done")
    sm = machine(state)
    state.machine = sm
    assert sm.execute() == "done" and sm.preempt_requested()
    state.machine = None
    assert sm.execute() == "done"
    assert state.seen == [False, False] and not sm.preempt_requested()


def test_a_request_after_a_run_is_for_the_next_run():
    state = Ignores("done")
    sm = machine(state)
    state.machine = sm
    sm.execute()  # leaves its flag up
    state.machine = None
    sm.request_preempt()  # a new one
    sm.execute()
    assert state.seen == [False, True]


def test_a_leaf_asked_directly_keeps_no_flag_after_its_run():
    leaf = Says("done")
    sm = machine(leaf)
    leaf.request_preempt()
    sm.execute(), sm.execute()
    assert leaf.seen == [True, False]


def test_a_request_between_two_states_reaches_the_second():
    first, second = Says("done"), Serves()
    sm = machine(first, second)
    sm.register_transition_cb(lambda ud, labels: sm.request_preempt())
    assert sm.execute() == "preempted" and second.seen == [True]


def test_a_request_in_the_start_callback_reaches_the_first_state():
    first = Serves()
    sm = machine(first)
    sm.register_start_cb(lambda ud, labels: sm.request_preempt())
    assert sm.execute() == "preempted" and first.seen == [True]


def test_flags_are_down_after_an_error_and_the_next_run_is_normal():
    state = Calls(lambda ud: sm.request_preempt() or 1 / 0)
    sm = machine(state)
    try:
        sm.execute()
    except smach.InvalidUserCodeError:
        pass
    seen = []
    state.function = lambda ud: seen.append(state.preempt_requested())
    assert sm.execute() == "done" and seen == [False] and not sm.preempt_requested()
