"""Construction, user data and callbacks of all containers."""

import pytest
import smach
from machine_parts import Calls, Raises, Says, in_thread, machine


def test_keys_are_copied_in_and_out():
    sm = machine(
        Calls(lambda ud: setattr(ud, "o", ud.i + 1), input_keys=["i"], output_keys=["o"]),
        input_keys=["i"],
        output_keys=["o"],
    )
    ud = smach.UserData()
    ud.i, ud.unrelated = 1, 5
    assert sm.execute(ud) == "done"
    assert ud.o == 2 and (sm.userdata.i, sm.userdata.o) == (1, 2) and "unrelated" not in sm.userdata


def test_a_missing_key_is_one_warning(log):
    sm = machine(Says("done"), input_keys=["i"], output_keys=["o"])
    assert sm.execute(smach.UserData()) == "done"
    assert len(log.warn) == 2 and "'i'" in log.warn[0] and "'o'" in log.warn[1] and log.error == []


def test_output_keys_are_not_copied_after_an_error():
    def run(ud):
        ud.o = 1
        raise ValueError("no")

    sm = machine(Calls(run, output_keys=["o"]), output_keys=["o"])
    ud = smach.UserData()
    with pytest.raises(smach.InvalidUserCodeError):
        sm.execute(ud)
    assert "o" not in ud


def test_a_callback_that_raises_is_logged_and_the_others_still_run(log):
    calls = []

    def bad(*args):
        raise RuntimeError("broken callback")

    sm = machine(Says("done"), Says("done"))
    for register in (sm.register_start_cb, sm.register_transition_cb, sm.register_termination_cb):
        register(bad)
        register(lambda *args: calls.append(1))
    assert sm.execute() == "done"
    assert len(calls) == 3 and log.text("error").count("broken callback") >= 3


def test_end_callback_comes_in_every_case_with_the_container_idle():
    for state, outcome in ((Says("done"), "done"), (Raises(ValueError()), None)):
        sm = machine(state)
        seen = []
        sm.register_end_cb(lambda ud, o, sm=sm, seen=seen: seen.append((o, sm.get_active_states(), sm.is_running())))
        try:
            sm.execute()
        except smach.InvalidUserCodeError:
            pass
        assert seen == [(outcome, ["None"], False)]


def test_unregister_callback():
    calls = []

    def cb(*args):
        calls.append(args)

    sm = machine(Says("done"))
    sm.register_start_cb(cb), sm.register_end_cb(cb), sm.unregister_cb(cb)
    sm.execute()
    assert calls == []
    with pytest.raises(TypeError):
        sm.register_start_cb("no function")


def test_open_close_and_stack():
    a, b = smach.StateMachine(["done"]), smach.StateMachine(["done"])
    a.open()
    assert a.is_opened()
    b.open()
    assert b.is_opened() and not a.is_opened()
    with pytest.raises(smach.InvalidStateError):
        a.close()
    b.close()
    assert a.is_opened() and not b.is_opened()
    a.close()
    assert not a.is_opened()
    with pytest.raises(smach.InvalidStateError):
        a.close()


def test_a_with_block_that_raises_is_closed(log):
    sm, inner = smach.StateMachine(["done"]), smach.StateMachine(["done"])
    with pytest.raises(ValueError):
        with sm:
            inner.open()
            raise ValueError("construction went wrong")
    assert not sm.is_opened() and not inner.is_opened()
    assert "construction went wrong" in log.text("error")
    other = in_thread(lambda: machine(Says("done")).execute())
    other.join(60.0)
    assert other.result == "done"


def test_add_needs_an_open_container_of_its_kind():
    for add in (
        lambda: smach.StateMachine.add("A", Says("done")),
        lambda: smach.Concurrence.add("A", Says("done")),
        lambda: smach.Sequence.add("A", Says("done")),
        lambda: smach.Iterator.set_contained_state("A", Says("done")),
    ):
        with pytest.raises(smach.InvalidStateError):
            add()
    with pytest.raises(smach.InvalidStateError):
        with smach.Concurrence(["a"], "a"):
            smach.StateMachine.add("A", Says("done"))
    with pytest.raises(smach.InvalidStateError):
        with smach.StateMachine(["done"]):
            smach.Sequence.add("A", Says("done"))
    with smach.Sequence(["done"], "done") as sequence:
        smach.StateMachine.add("A", Says("done"))
    assert sequence.execute() == "done"


def test_another_thread_cannot_add_to_an_open_container():
    with smach.StateMachine(["done"]) as sm:
        smach.StateMachine.add("A", Says("done"))
        other = in_thread(lambda: smach.StateMachine.add("B", Says("done")))
        other.join(60.0)
    assert isinstance(other.error, smach.InvalidStateError) and list(sm.get_children()) == ["A"]


def test_non_states_are_refused_with_a_message():
    with smach.StateMachine(["done"]):
        for wrong in (None, "state", lambda ud: "done", Says):
            with pytest.raises(smach.InvalidStateError, match="'A'"):
                smach.StateMachine.add("A", wrong)
        with pytest.raises(smach.InvalidStateError):
            smach.StateMachine.add(3, Says("done"))

        class Forgot(smach.State):
            def __init__(self):
                pass

        with pytest.raises(smach.InvalidStateError, match="__init__"):
            smach.StateMachine.add("A", Forgot())
        smach.StateMachine.add("A", Says("done"))


def test_running_twice_at_once_is_refused():
    sm = machine(Calls(lambda ud: sm.execute()))
    with pytest.raises(smach.InvalidUserCodeError):
        sm.execute()
    assert not sm.is_running()
