"""Concurrence: results, callbacks, and what ends it while a child hangs or raises."""

import threading
import time

import pytest
import smach
from machine_parts import ALL_DONE, Calls, Raises, Says, Serves, concurrence, in_thread, machine


@pytest.mark.parametrize(
    "wrong",
    [
        {"default_outcome": "nothing"},
        {"default_outcome": None},
        {"default_outcome": 3},
        {"outcome_map": {"nothing": {}}},
        {"outcome_cb": "text"},
        {"child_termination_cb": 3},
    ],
)
def test_bad_arguments(wrong):
    with pytest.raises(smach.InvalidStateError):
        smach.Concurrence(**{"outcomes": ["done"], "default_outcome": "done", **wrong})


def test_a_taken_label_is_refused():
    with smach.Concurrence(["done"], "done"):
        smach.Concurrence.add("A", Says("done"))
        with pytest.raises(smach.InvalidStateError, match="'A'"):
            smach.Concurrence.add("A", Says("done"))


@pytest.mark.parametrize("conditions", [{"A": "nothing"}, {"Z": "done"}])
def test_outcome_map_is_checked(conditions, log):
    both = concurrence(children={"A": Says("done")}, outcome_map={"done": conditions})
    assert "outcome_map" in log.text("error")
    with pytest.raises(smach.InvalidTransitionError):
        both.check_consistency()
    with pytest.raises(smach.InvalidTransitionError):
        both.execute()


def test_children_run_in_named_threads_all_released_together():
    gate, names = threading.Barrier(3, timeout=120), []

    def run(ud):
        gate.wait()
        names.append(threading.current_thread().name)

    both = concurrence(children={k: Calls(run) for k in "ABC"}, default="done")
    assert both.execute() == "done"
    assert sorted(names) == [f"concurrent_split:{k}" for k in "ABC"]
    assert not [one for one in threading.enumerate() if one.name.startswith("concurrent_split:")]


def test_children_share_user_data_through_remappers():
    both = smach.Concurrence(["done"], "done", input_keys=["i"], output_keys=["o"])
    with both:
        smach.Concurrence.add(
            "A",
            Calls(lambda ud: setattr(ud, "y", ud.x + 1), input_keys=["x"], output_keys=["y"]),
            {"x": "i", "y": "o"},
        )
    ud = smach.UserData()
    ud.i = 1
    assert both.execute(ud) == "done" and ud.o == 2


def test_transition_callbacks_at_each_childs_start_and_end():
    seen = []
    both = concurrence(children={"A": Says("done"), "B": Says("done")}, default="done")
    both.register_transition_cb(lambda ud, labels: seen.append(labels))
    both.execute()
    assert len(seen) == 4 and seen[-1] == []


def test_child_termination_cb_true_preempts_the_rest():
    slow = Serves(patience=20)
    calls = []

    def ended(outcomes):
        calls.append(dict(outcomes))
        return outcomes["A"] == "done"

    both = concurrence(
        children={"A": Says("done"), "B": slow},
        child_termination_cb=ended,
        outcome_map={"done": {"A": "done", "B": "preempted"}},
    )
    assert both.execute() == "done"
    assert calls == [{"A": "done", "B": None}, {"A": "done", "B": "preempted"}]
    assert not slow.preempt_requested() and not both.preempt_requested()


def test_child_termination_cb_is_serialised():
    inside, worst = [], []

    def ended(outcomes):
        inside.append(1)
        worst.append(len(inside))
        time.sleep(0.01)
        inside.pop()

    concurrence(children={str(i): Says("done") for i in range(8)}, child_termination_cb=ended).execute()
    assert max(worst) == 1 and len(worst) == 8


def test_outcome_cb_comes_first():
    got = []
    both = concurrence(
        children={"A": Says("done"), "B": Says("done")},
        outcome_map=ALL_DONE,
        outcome_cb=lambda outcomes: got.append(outcomes) or "failed",
    )
    assert both.execute() == "failed" and got == [{"A": "done", "B": "done"}]


def test_the_map_entry_with_most_conditions_wins():
    both = concurrence(
        outcomes=["one", "two", "none"],
        default="none",
        children={"A": Says("done"), "B": Says("done")},
        outcome_map={"one": {"A": "done"}, "two": {"A": "done", "B": "done"}},
    )
    assert both.execute() == "two"


def test_a_child_that_raises_preempts_the_others_and_ends_the_container(capsys):
    other = Serves(patience=20)
    both = concurrence(children={"A": Raises(ValueError("deep reason")), "B": other})
    with pytest.raises(smach.InvalidStateError, match="deep reason"):
        both.execute()
    assert "deep reason" in capsys.readouterr().err
    assert not both.is_running() and both.get_active_states() == []
    assert not other.preempt_requested()
    with pytest.raises(smach.InvalidUserCodeError):
        machine(both, outcomes=["done", "failed", "preempted"]).execute()


@pytest.mark.parametrize("outcome", [None, "unknown", 7, []])
def test_a_child_without_a_valid_outcome_ends_the_container(outcome):
    both = concurrence(children={"A": Says(outcome, registered=["done"]), "B": Serves(patience=20)})
    run = in_thread(both.execute)
    run.join(60.0)
    assert isinstance(run.error, smach.InvalidStateError) and "'A'" in str(run.error)


def test_child_termination_cb_that_raises_ends_the_container():
    both = concurrence(
        children={"A": Says("done"), "B": Serves(patience=20)},
        child_termination_cb=lambda outcomes: 1 / 0,
    )
    run = in_thread(both.execute)
    run.join(60.0)
    assert isinstance(run.error, smach.InvalidUserCodeError) and "child_termination_cb" in str(run.error)
    assert not both.is_running()


def test_a_child_that_calls_exit_ends_the_container():
    run = in_thread(concurrence(children={"A": Raises(SystemExit()), "B": Serves(patience=20)}).execute)
    run.join(60.0)
    assert isinstance(run.error, smach.InvalidStateError)
