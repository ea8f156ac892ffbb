"""Iterator."""

import pytest
import smach
from machine_parts import Calls, Ignores, Raises, Says, Serves, in_thread


def iterator(state, it=(), outcomes=("done", "failed"), label="it_data", exhausted="exhausted", **contained):
    result = smach.Iterator(list(outcomes), [], [], it, label, exhausted)
    with result:
        smach.Iterator.set_contained_state("CHILD", state, **contained)
    return result


def test_items_iterable_or_function_evaluated_each_time():
    got = []
    state = Calls(lambda ud: got.append(ud.x))
    assert iterator(state, [1, 2], label="x", loop_outcomes=["done"]).execute() == "exhausted"
    each = iterator(state, lambda: iter([3, 4]), label="x", loop_outcomes=["done"])
    each.execute(), each.execute()
    assert got == [1, 2, 3, 4, 3, 4]


def test_break_outcomes_given_all_others_loop():
    state = Says("a", "b", "stop", registered=["a", "b", "stop"])
    each = iterator(state, range(10), outcomes=["stop"], break_outcomes=["stop"])
    assert each.execute() == "stop" and state.runs == 3


def test_loop_outcomes_given_all_others_break():
    state = Says("go", "go", "stop", registered=["go", "stop", "x"])
    each = iterator(state, range(10), outcomes=["stop"], loop_outcomes=["go"])
    assert each.execute() == "stop" and state.runs == 3


def test_transition_callbacks_after_looping_items_only():
    seen = []
    each = iterator(
        Says("go", "go", "stop", registered=["go", "stop"]),
        range(9),
        ["stop"],
        break_outcomes=["stop"],
    )
    each.register_transition_cb(lambda ud, labels: seen.append(labels))
    each.execute()
    assert seen == [["CHILD"]] * 2


def test_preempted_by_a_served_request():
    state = Serves(patience=20)
    each = iterator(state, range(5), ["preempted"], loop_outcomes=["done"])
    run = in_thread(each.execute)
    assert state.started.wait(60.0)
    each.request_preempt()
    run.join(60.0)
    assert run.result == "preempted" and state.runs == 1 and not each.preempt_requested()


def test_an_ignored_request_ends_the_iteration_and_is_cleared():
    state = Ignores("done")
    each = iterator(state, range(5), loop_outcomes=["done"])
    state.machine = each
    assert each.execute() == "done" and state.runs == 1
    assert not each.preempt_requested() and not state.preempt_requested()


@pytest.mark.parametrize("outcomes, wanted", [(["preempted"], "preempted"), (["x"], "exhausted")])
def test_preempted_loop_outcome_is_not_returned(outcomes, wanted):
    state = Ignores("go")
    each = iterator(state, range(5), outcomes, loop_outcomes=["go"])
    state.machine = each
    assert each.execute() == wanted


def test_a_request_before_the_start_reaches_the_child():
    state = Serves()
    each = iterator(state, range(5), ["preempted"], loop_outcomes=["done"])
    each.request_preempt()
    assert each.execute() == "preempted" and state.seen == [True]
    assert each.execute() == "exhausted" and state.runs == 6


def test_an_error_of_the_items_counts_as_exhausted(log):
    def items():
        yield 1
        raise ValueError("no more")

    state = Says("done")
    assert iterator(state, items, loop_outcomes=["done"]).execute() == "exhausted"
    assert state.runs == 1 and "no more" in log.text("error")


def test_a_child_that_raises():
    each = iterator(Raises(ValueError("reason")), [1], loop_outcomes=["done"])
    with pytest.raises(smach.InvalidUserCodeError, match="reason"):
        each.execute()
    assert not each.is_running() and each.get_active_states() == []


@pytest.mark.parametrize(
    "contained, named",
    [
        ({"loop_outcomes": ["else"]}, "else"),
        ({"break_outcomes": ["else"]}, "else"),
        ({"final_outcome_map": {"else": "failed"}}, "else"),
        ({"final_outcome_map": {"bad": "nowhere"}}, "nowhere"),
    ],
)
def test_unknown_outcomes_are_found(contained, named):
    state = Says("ok", registered=["ok", "bad"])
    iterator(state, loop_outcomes=["ok"], final_outcome_map={"bad": "failed"}).check_consistency()
    with pytest.raises(smach.InvalidTransitionError, match=rf"\['{named}'\]"):
        iterator(state, **contained).check_consistency()


def test_a_shutdown_inside_the_state_is_no_transition():
    ending, transitions = [], []
    smach.set_shutdown_check(lambda: bool(ending))
    state = Says(None, registered=["done"])
    state.next_outcome = lambda: ending.append(1)
    each = smach.Iterator(["done"], [], [], [1, 2])
    with each:
        smach.Iterator.set_contained_state("EACH", state, loop_outcomes=["done"])
    each.register_transition_cb(lambda *_: transitions.append(1))
    assert each.execute() is None and transitions == []


def test_a_request_after_the_last_item_is_not_left_with_the_state():
    state = Says("done")
    each = smach.Iterator(["done"], [], [], [1])
    with each:
        smach.Iterator.set_contained_state("EACH", state)
    each.register_termination_cb(lambda *_: each.request_preempt())
    assert each.execute() == "done" and not state.preempt_requested()
