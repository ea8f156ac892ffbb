"""Section 7 of the specification: Concurrence; complaints 1, 7 and 8 of section 15."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import pytest
import smach
from machine_parts import Calls, Ignores, Raises, Says, Serves, in_thread, machine, wait_for


def concurrence(
    outcomes=("done", "failed", "preempted"), default="failed", children=None, **kwargs
):
    result = smach.Concurrence(outcomes=list(outcomes), default_outcome=default, **kwargs)
    with result:
        for label, state in (children or {}).items():
            smach.Concurrence.add(label, state)
    return result


ALL_DONE = {"done": {"A": "done", "B": "done"}}


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
def test_s7_bad_arguments(wrong):
    with pytest.raises(smach.InvalidStateError):
        smach.Concurrence(**{"outcomes": ["done"], "default_outcome": "done", **wrong})


def test_s7_s15_7_no_child():
    with pytest.raises(smach.InvalidStateError):
        smach.Concurrence(["done"], "done").execute()


def test_s7_a_taken_label_is_refused_better():
    with smach.Concurrence(["done"], "done"):
        smach.Concurrence.add("A", Says("done"))
        with pytest.raises(smach.InvalidStateError, match="'A'"):
            smach.Concurrence.add("A", Says("done"))


@pytest.mark.parametrize("conditions", [{"A": "nothing"}, {"Z": "done"}])
def test_s7_outcome_map_is_checked(conditions, log):
    both = concurrence(children={"A": Says("done")}, outcome_map={"done": conditions})
    assert "outcome_map" in log.text("error")
    with pytest.raises(smach.InvalidTransitionError):
        both.check_consistency()
    with pytest.raises(smach.InvalidTransitionError):
        both.execute()


def test_s7_children_run_in_named_threads_all_released_together():
    gate, names = threading.Barrier(3, timeout=10), []

    def run(ud):
        gate.wait()
        names.append(threading.current_thread().name)

    both = concurrence(children={k: Calls(run) for k in "ABC"}, default="done")
    before = threading.active_count()
    assert both.execute() == "done"
    assert sorted(names) == [f"concurrent_split:{k}" for k in "ABC"]
    assert threading.active_count() == before


def test_s7_children_share_user_data_through_remappers():
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


def test_s7_transition_callbacks_at_each_childs_start_and_end():
    seen = []
    both = concurrence(children={"A": Says("done"), "B": Says("done")}, default="done")
    both.register_transition_cb(lambda ud, labels: seen.append(labels))
    both.execute()
    assert len(seen) == 4 and seen[-1] == []


def test_s7_start_and_termination_callbacks():
    seen = []
    both = concurrence(children={"A": Says("done"), "B": Says("done")}, default="done")
    both.register_start_cb(lambda ud, labels: seen.append(labels))
    both.register_termination_cb(lambda ud, labels, outcome: seen.append((sorted(labels), outcome)))
    both.execute()
    assert seen == [["A", "B"], (["A", "B"], "done")]


def test_s7_child_termination_cb_true_preempts_the_rest():
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


def test_s7_child_termination_cb_a_list_is_taken_as_true():
    both = concurrence(
        children={"A": Says("done"), "B": Serves(patience=20), "C": Serves(patience=20)},
        child_termination_cb=lambda outcomes: ["B"],
        outcome_map={"done": {"B": "preempted", "C": "preempted"}},
    )
    assert both.execute() == "done"


def test_s7_child_termination_cb_false_waits():
    both = concurrence(
        children={"A": Says("done"), "B": Serves(patience=0.1)},
        outcome_map=ALL_DONE,
        child_termination_cb=lambda outcomes: False,
    )
    assert both.execute() == "done"


def test_s7_child_termination_cb_is_serialised():
    inside, worst = [], []

    def ended(outcomes):
        inside.append(1)
        worst.append(len(inside))
        time.sleep(0.01)
        inside.pop()

    concurrence(
        children={str(i): Says("done") for i in range(8)}, child_termination_cb=ended
    ).execute()
    assert max(worst) == 1 and len(worst) == 8


def test_s7_outcome_cb_comes_first():
    got = []
    both = concurrence(
        children={"A": Says("done"), "B": Says("done")},
        outcome_map=ALL_DONE,
        outcome_cb=lambda outcomes: got.append(outcomes) or "failed",
    )
    assert both.execute() == "failed" and got == [{"A": "done", "B": "done"}]


@pytest.mark.parametrize("value", [None, "", False])
def test_s7_outcome_cb_without_an_answer_leaves_it_to_the_map(value):
    both = concurrence(
        children={"A": Says("done"), "B": Says("done")},
        outcome_map=ALL_DONE,
        outcome_cb=lambda o: value,
    )
    assert both.execute() == "done"


def test_s7_outcome_cb_non_string_is_logged_and_ignored(log):
    both = concurrence(
        children={"A": Says("done"), "B": Says("done")},
        outcome_map=ALL_DONE,
        outcome_cb=lambda o: 3,
    )
    assert both.execute() == "done" and "outcome_cb" in log.text("error")


def test_s7_outcome_cb_is_not_checked_against_the_outcomes():
    assert (
        concurrence(children={"A": Says("done")}, outcome_cb=lambda o: "anything").execute()
        == "anything"
    )


def test_s7_outcome_cb_that_raises():
    both = concurrence(children={"A": Says("done")}, outcome_cb=lambda o: 1 / 0)
    with pytest.raises(smach.InvalidUserCodeError, match="ZeroDivisionError"):
        both.execute()
    assert not both.is_running()


def test_s7_the_map_entry_with_most_conditions_wins():
    both = concurrence(
        outcomes=["one", "two", "none"],
        default="none",
        children={"A": Says("done"), "B": Says("done")},
        outcome_map={"one": {"A": "done"}, "two": {"A": "done", "B": "done"}},
    )
    assert both.execute() == "two"


def test_s7_default_outcome():
    both = concurrence(
        children={"A": Says("done"), "B": Says("x", registered=["x", "done"])}, outcome_map=ALL_DONE
    )
    assert both.execute() == "failed"


def test_s7_s15_7_a_child_that_raises_preempts_the_others_and_ends_the_container(capsys):
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
def test_s7_a_child_without_a_valid_outcome_ends_the_container_better(outcome):
    both = concurrence(children={"A": Says(outcome, registered=["done"]), "B": Serves(patience=20)})
    run = in_thread(both.execute)
    run.join(10)
    assert isinstance(run.error, smach.InvalidStateError) and "'A'" in str(run.error)


def test_s7_child_termination_cb_that_raises_ends_the_container_better():
    both = concurrence(
        children={"A": Says("done"), "B": Serves(patience=20)},
        child_termination_cb=lambda outcomes: 1 / 0,
    )
    run = in_thread(both.execute)
    run.join(10)
    assert isinstance(run.error, smach.InvalidUserCodeError) and "child_termination_cb" in str(
        run.error
    )
    assert not both.is_running()


def test_s7_a_child_that_calls_exit_ends_the_container_better():
    run = in_thread(
        concurrence(children={"A": Raises(SystemExit()), "B": Serves(patience=20)}).execute
    )
    run.join(10)
    assert isinstance(run.error, smach.InvalidStateError)


def test_s7_preempt_served_by_all():
    children = {"A": Serves(patience=20), "B": Serves(patience=20)}
    both = concurrence(children=children, outcome_map=ALL_DONE)
    run = in_thread(both.execute)
    assert all(child.started.wait(5) for child in children.values())
    both.request_preempt()
    run.join(10)
    assert run.result == "preempted" and not both.preempt_requested()
    assert not any(child.preempt_requested() for child in children.values())


def test_s7_preempt_served_gives_preempted_even_unregistered():
    both = concurrence(outcomes=["done"], default="done", children={"A": Serves(patience=20)})
    both.request_preempt()
    assert both.execute() == "preempted"


def test_s7_preempt_ignored_by_one(log):
    stubborn = Ignores("done")
    both = concurrence(children={"A": Serves(patience=20), "B": stubborn}, outcome_map=ALL_DONE)
    stubborn.machine = both
    assert both.execute() == "failed"
    assert both.preempt_requested() and not stubborn.preempt_requested()
    assert "'B'" in log.text("warn")


def test_s7_preempt_ignored_is_carried_by_the_machine_around():
    stubborn, after = Ignores("done"), Serves()
    both = concurrence(outcomes=["done"], default="done", children={"B": stubborn})
    outer = machine(both, after)
    stubborn.machine = outer
    assert outer.execute() == "preempted" and after.seen == [True]


@pytest.mark.parametrize("moment", ["before", "start_cb", "transition_cb"])
def test_s7_a_request_before_or_during_the_start_reaches_every_child_better(moment):
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
        assert time.monotonic() - begun < 15  # not by patience


def test_s15_2_ignored_requests_do_not_poison_the_next_run_better():
    stubborn, polite = Ignores("done"), Serves()
    both = concurrence(children={"A": polite, "B": stubborn}, outcome_map=ALL_DONE)
    stubborn.machine = both
    both.execute()
    stubborn.machine = None
    assert both.execute() == "done" and polite.seen[-1] is False and not both.preempt_requested()


def test_s15_1_a_request_after_all_children_have_ended_is_carried_on():
    both = concurrence(children={"A": Says("done")}, outcome_map={"done": {"A": "done"}})
    both._outcome_cb = lambda outcomes: both.request_preempt()
    assert both.execute() == "done" and both.preempt_requested()


@pytest.mark.parametrize("moment", ["transition_cb", "child_termination_cb"])
@pytest.mark.parametrize("whom", ["concurrence", "machine around"])
def test_s7_a_request_when_the_last_child_has_just_ended_gives_preempted(moment, whom):
    after = Serves()

    def ask():
        (both if whom == "concurrence" else outer).request_preempt()
        return True

    both = concurrence(
        children={"A": Says("done"), "B": Says("done")},
        outcome_map=ALL_DONE,
        child_termination_cb=lambda outcomes: (
            moment == "child_termination_cb" and all(outcomes.values()) and ask()
        ),
    )
    outer = machine(both, after, outcomes=["done", "failed", "preempted"])
    if moment == "transition_cb":
        both.register_transition_cb(lambda ud, labels: labels or ask())
    assert outer.execute() == "preempted"
    assert after.seen == [] and not both.preempt_requested() and not outer.preempt_requested()


def test_s15_1_a_request_that_a_child_did_not_take_is_carried_on(log):
    class Deaf(Says):
        def request_preempt(self):
            raise OSError("deaf")

    after = Serves()
    both = concurrence(children={"A": Deaf("done")}, outcome_map={"done": {"A": "done"}})
    outer = machine(both, after, outcomes=["done", "failed", "preempted"])
    both.register_start_cb(lambda ud, labels: outer.request_preempt())
    assert outer.execute() == "preempted" and after.seen == [True]
    assert "deaf" in log.text("error")


def test_s7_s15_7_is_running_better():
    seen = []
    both = concurrence(children={"A": Calls(lambda ud: seen.append(both.is_running()))})
    both.execute()
    assert seen == [True] and not both.is_running()


def test_s7_set_initial_state_better(log):
    both = concurrence(children={"A": Says("done"), "B": Says("done")})
    ud = smach.UserData()
    ud.x = 1
    both.set_initial_state(["A", "B"], ud)
    assert both.userdata.x == 1 and log.warn == []
    both.set_initial_state(["A"], smach.UserData())
    assert len(log.warn) == 1 and both.get_initial_states() == ["A", "B"]


def test_s7_states_and_edges():
    seen = []
    first = threading.Event()
    both = concurrence(
        children={"A": Calls(lambda ud: first.set()), "B": Calls(lambda ud: seen.append(wait()))},
        outcome_map=ALL_DONE,
    )

    def wait():
        wait_for(lambda: both.get_active_states() == ["B"])
        return both.get_active_states()

    assert both.get_initial_states() == ["A", "B"] and both.get_active_states() == []
    assert both.get_internal_edges() == [("done", "A", "done"), ("done", "B", "done")]
    both.execute()
    assert seen == [["B"]] and both.get_active_states() == []


def test_s7_shutdown_takes_the_children_along_better():
    children = {"A": Serves(patience=30), "B": Serves(patience=30)}
    both = concurrence(children=children)
    run = in_thread(both.execute)
    assert all(child.started.wait(5) for child in children.values())
    smach.set_shutdown_check(lambda: True)
    run.join(10)
    assert not run.is_alive()


def test_s7_ctrl_c_in_the_main_thread_takes_the_children_along_better():
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
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=env
    )
    try:
        while "READY" not in process.stdout.readline():
            pass
        process.send_signal(signal.SIGINT)
        assert "INTERRUPTED False" in process.communicate(timeout=30)[0]
    finally:
        process.kill()
        process.wait()


def test_s7_too_few_threads_is_an_error_and_nothing_runs(monkeypatch):
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


def test_s7_pickles():
    both = concurrence(children={"A": Says("done"), "B": Says("done")}, outcome_map=ALL_DONE)
    assert pickle.loads(pickle.dumps(both)).execute() == "done"


def test_s7_nested_concurrences():
    inner = concurrence(children={"A": Says("done"), "B": Says("done")}, outcome_map=ALL_DONE)
    outer = concurrence(children={"A": inner, "B": Says("done")}, outcome_map=ALL_DONE)
    assert [outer.execute() for _ in range(20)] == ["done"] * 20
