"""StateMachine, without preemption."""

import pytest
import smach
from machine_parts import Calls, Raises, Says, machine


def test_add_refuses_unknown_outcomes_and_taken_labels():
    with smach.StateMachine(["done"]) as sm:
        with pytest.raises(smach.InvalidTransitionError, match="nothing"):
            smach.StateMachine.add("A", Says("done"), {"nothing": "A"})
        assert sm.get_children() == {}
        smach.StateMachine.add("A", Says("done"))
        with pytest.raises(smach.InvalidStateError, match="'A'"):
            smach.StateMachine.add("A", Says("done"))
        with pytest.raises(smach.InvalidTransitionError):
            smach.StateMachine.add("B", Says("done"), {"done": 3})


def test_two_adds_may_share_one_dict_which_stays_as_it_is():
    shared = {"done": "end"}
    with smach.StateMachine(["end", "x", "y"]) as sm:
        smach.StateMachine.add("A", Says("done", "x"), shared)
        smach.StateMachine.add("B", Says("done", "y"), shared)
    assert shared == {"done": "end"}
    assert sm.get_internal_edges() == [
        ("done", "A", "end"),
        ("x", "A", None),
        ("done", "B", "end"),
        ("y", "B", None),
    ]


def test_a_name_that_is_label_and_outcome_is_the_label():
    with smach.StateMachine(["B", "done"]) as sm:
        smach.StateMachine.add("A", Says("ok"), {"ok": "B"})
        smach.StateMachine.add("B", Says("done"))
    assert sm.execute() == "done"


@pytest.mark.parametrize(
    "build",
    [
        lambda: machine(),
        lambda: machine(Says("done"), transitions={0: {"done": "nowhere"}}),
        lambda: machine(Says("other")),
    ],
)
def test_inconsistent_machines_are_logged_and_return_none(build, log):
    sm = build()
    with pytest.raises(smach.InvalidTransitionError):
        sm.check_consistency()
    assert sm.execute() is None and not sm.is_running()
    assert "inconsistent" in log.text("error")


def test_add_auto_connects_whatever_comes_next():
    with smach.StateMachine(["end"]) as sm:
        smach.StateMachine.add_auto("A", Says("a", "x"), ["a", "x"], {"x": "end"})
        smach.StateMachine.add("B", Says("b"), {"b": "C"})
        smach.StateMachine.add_auto("C", Says("c"), connector_outcomes=["c"])
        smach.StateMachine.add_auto("D", Says("end"), connector_outcomes=[])
    edges = sm.get_internal_edges()
    assert ("a", "A", "B") in edges and ("x", "A", "B") in edges and ("c", "C", "D") in edges
    assert sm.execute() == "end"


def test_shutdown_inside_nested_machines_is_no_error(log):
    outer = machine(machine(Calls(lambda ud: smach.set_shutdown_check(lambda: True)), Says("done")))
    assert outer.execute() is None and log.error == []


def test_a_state_that_raises():
    with pytest.raises(smach.InvalidUserCodeError) as caught:
        machine(Raises(ValueError("deep reason"))).execute()
    text = str(caught.value)
    assert "S0" in text and "Raises" in text and "deep reason" in text and "Traceback" in text
    assert isinstance(caught.value.__cause__, ValueError)


@pytest.mark.parametrize("outcome", [None, "unknown", 3, ["done"], {}])
def test_an_unregistered_outcome(outcome):
    with pytest.raises(smach.InvalidTransitionError, match="S0"):
        machine(Says(outcome, registered=["done"])).execute()
    with pytest.raises(smach.InvalidUserCodeError):
        machine(machine(Says(outcome, registered=["done"]))).execute()


def test_order_of_callbacks_and_output_keys():
    events = []
    parent = smach.UserData()
    sm = machine(
        Calls(lambda ud: events.append("run")),
        Calls(lambda ud: setattr(ud, "o", 1), output_keys=["o"]),
        output_keys=["o"],
    )
    sm.register_start_cb(lambda ud, labels: events.append(("start", labels)))
    sm.register_transition_cb(lambda ud, labels: events.append(("to", labels)))
    sm.register_termination_cb(lambda ud, labels, o: events.append(("end", labels, o, "o" in parent)))
    sm.execute(parent)
    assert events == [("start", ["S0"]), "run", ("to", ["S1"]), ("end", ["S1"], "done", False)]
    assert parent.o == 1


def test_set_initial_state(log):
    sm = machine(Says("done"), Says("done"))
    ud = smach.UserData()
    ud.x = 4
    sm.set_initial_state(["S1", "S0"], ud)
    assert sm.get_initial_states() == ["S1"] and sm.userdata.x == 4 and len(log.warn) == 1
    sm.set_initial_state([], smach.UserData())
    assert sm.get_initial_states() == ["S1"]
    sm.execute()
    assert sm["S0"].runs == 0


def test_user_data_nesting_and_remapping():
    inner = smach.StateMachine(["done"], input_keys=["a"], output_keys=["b"])
    with inner:
        state = Calls(lambda ud: setattr(ud, "y", ud.x * 2), input_keys=["x"], output_keys=["y"])
        smach.StateMachine.add("DOUBLE", state, remapping={"x": "a", "y": "b"})
    outer = smach.StateMachine(["done"])
    outer.userdata.first = 21
    with outer:
        smach.StateMachine.add("INNER", inner, remapping={"a": "first", "b": "second"})
    assert outer.execute() == "done" and outer.userdata.second == 42
