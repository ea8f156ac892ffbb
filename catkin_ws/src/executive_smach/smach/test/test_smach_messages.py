"""What the engine says, and to whom: enough to find the state, the key or the label that is meant."""

import functools

import pytest
import smach
from machine_parts import Calls, Raises, Says, concurrence, machine
from smach.user_data import MissingKeyError


class Own(smach.Container):
    """A container that can do nothing but begin."""


def each(state, items=(1,), outcomes=("done",), **kwargs):
    """An iterator over a state with the label EACH."""
    result = smach.Iterator(outcomes, [], [], items, "item", "exhausted")
    with result:
        smach.Iterator.set_contained_state("EACH", state, **kwargs)
    return result


# -- user data -----------------------------------------------------------------------------------


def test_a_missing_key_is_told_with_those_that_are_there():
    ud = smach.UserData()
    with pytest.raises(KeyError) as first:
        ud.x  # noqa: B018
    assert str(first.value) == "user data has no key 'x'; present: none"
    ud.b, ud.a = 1, 2
    with pytest.raises(AttributeError) as second:
        ud["x"]
    assert str(second.value) == "user data has no key 'x'; present: 'b', 'a'"
    assert str(MissingKeyError()) == ""


@pytest.mark.parametrize("data", [smach.UserData(), smach.Remapper(smach.UserData())])
def test_a_look_for_a_private_name_is_no_fault_of_the_user_data(data, log):
    with pytest.raises(AttributeError, match=f"{type(data).__name__} has no attribute '_repr_html_'"):
        data._repr_html_  # noqa: B018
    assert log.error == []


@pytest.mark.parametrize(("keys", "declared"), [([], "(none)"), (["b", "a"], "('a', 'b')")])
def test_an_access_that_was_not_declared_is_told_with_what_was(keys, declared, log):
    view = smach.Remapper(smach.UserData(), keys, keys)
    with pytest.raises(smach.InvalidUserCodeError) as reading:
        view.x  # noqa: B018
    view.x = 1
    for message in (str(reading.value), log.error[-1]):
        assert "key 'x'" in message and declared in message


def test_views_and_stores_show_what_is_in_them():
    ud = smach.UserData()
    ud.outer, ud.other = 1, "two"
    assert repr(ud) == "UserData({'outer': 1, 'other': 'two'})"
    assert repr(smach.Remapper(ud, ["mine", "gone"], [], {"mine": "outer"})) == "Remapper({'mine': 1})"


def test_one_key_may_go_to_several_names():
    ud = smach.UserData()
    ud.a = 1
    assert ud.extract(["a"], {"x": "a", "y": "a"})._data == {"x": 1, "y": 1}
    target = smach.UserData()
    target.update({"a": 2})
    target.merge(ud, ["a"], {})
    assert target._data == {"a": 1}


def test_a_view_without_renaming_takes_the_names_as_they_are():
    ud = smach.UserData()
    view = smach.Remapper(ud, ["a"], ["a"])
    view["a"] = 1
    view._mine = 2
    assert ud._data == {"a": 1} and view["a"] == 1 and view._mine == 2 and "a" in view


# -- states and callbacks ------------------------------------------------------------------------


@pytest.mark.parametrize("make", [smach.CBState, smach.CBInterface])
def test_what_cannot_be_called_is_refused_by_its_kind(make):
    with pytest.raises(TypeError, match=f"{make.__name__}: expected a callable, got int"):
        make(3)


@pytest.mark.parametrize("what", ["start", "transition", "termination", "end"])
def test_a_callback_is_named_where_it_raises_or_cannot_be_called(what, log):
    def breaks(*_):
        raise ValueError("broken")

    sm = machine(Says("done"), Says("done"))
    register = getattr(sm, f"register_{what}_cb")
    with pytest.raises(TypeError, match=f"{what}_cb: expected a callable, got str"):
        register("no function")
    register(breaks)
    register(functools.partial(breaks, 1))
    assert sm.execute() == "done"
    own, other = log.error
    for message in log.error:
        assert f"{what} callback " in message and "ValueError: broken" in message
        assert "of StateMachine with outcomes ['done', 'preempted'] raised" in message
    assert "<locals>.breaks of" in own and "functools.partial(" in other


def test_a_base_says_what_has_to_be_overridden():
    own = Own(["done"])
    for call, name in (
        (lambda: own["A"], "__getitem__"),
        (own.get_children, "get_children"),
        (own.get_initial_states, "get_initial_states"),
        (lambda: own.set_initial_state([]), "set_initial_state"),
        (own.get_active_states, "get_active_states"),
        (own.get_internal_edges, "get_internal_edges"),
        (own.check_consistency, "check_consistency"),
        (lambda: own.execute(None), "execute"),
    ):
        with pytest.raises(NotImplementedError, match=f"Own must override {name}"):
            call()


def test_a_lone_name_or_no_list_is_told_with_where_it_was_given():
    for wrong, words in (("done", r"write \['done'\]"), (b"done", r"write \[b'done'\]"), (3, "got int")):
        for what in ("outcomes", "input_keys", "output_keys", "io_keys"):
            with pytest.raises(TypeError, match=f"{what}: expected a list of names, .*{words}"):
                smach.State(**{what: wrong})
    assert repr(smach.State(["b", "a"])._outcomes) == "OrderedSet(['b', 'a'])"


# -- containers ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("container", "words"),
    [
        (smach.StateMachine(["done"]), "no state 'X' in this machine; labels: none"),
        (machine(Says("done"), Says("done")), "no state 'X' in this machine; labels: S0, S1"),
        (concurrence(), "no state 'X' in this concurrence; labels: none"),
        (concurrence(children={"A": Says("done"), "B": Says("done")}), "in this concurrence; labels: A, B"),
        (smach.Iterator(["done"], [], []), "no state 'X' in this iterator; its label: None"),
        (each(Says("done")), "no state 'X' in this iterator; its label: 'EACH'"),
    ],
)
def test_an_unknown_label_is_told_with_those_that_there_are(container, words):
    with pytest.raises(KeyError) as error:
        container["X"]
    assert words in str(error.value)


def test_the_open_containers_are_told_where_the_wrong_one_is_used():
    outer, inner = smach.StateMachine(["done"]), smach.Concurrence(["done"], "done")
    with pytest.raises(smach.InvalidStateError) as alone:
        outer.close()
    assert "close() of StateMachine with outcomes ['done']" in str(alone.value) and "(open: none)" in str(alone.value)
    with pytest.raises(smach.InvalidConstructionError, match="must be open for construction: StateMachine with"):
        outer.assert_opened()
    outer.open()
    inner.open()
    try:
        with pytest.raises(smach.InvalidStateError, match="open: StateMachine > Concurrence"):
            outer.close()
        with pytest.raises(smach.InvalidStateError, match="expected an open StateMachine, but .* is a Concurrence"):
            smach.StateMachine.add("A", Says("done"))
    finally:
        inner.close()
        smach.StateMachine.add("A", Says("done"))
        outer.close()


def test_what_is_no_state_is_told_by_kind_and_by_what_it_lacks():
    class Half:
        def execute(self, ud):
            return "done"

    with smach.StateMachine(["done"]):
        with pytest.raises(smach.InvalidStateError, match="expected an instance, got the class Says; call it"):
            smach.StateMachine.add("A", Says)
        with pytest.raises(smach.InvalidStateError) as half:
            smach.StateMachine.add("A", Half())
        assert "without request_preempt, preempt_requested" in str(half.value) and "execute," not in str(half.value)
        smach.StateMachine.add("A", Says("done"))
        smach.StateMachine.add("B", Says("done"))
        with pytest.raises(smach.InvalidStateError, match="label 'A' is already taken .* labels: A, B"):
            smach.StateMachine.add("A", Says("done"))


def test_a_key_that_is_not_there_is_told_with_those_that_are(log):
    sm = machine(Says("done"), input_keys=["i"], output_keys=["o"])
    parent = smach.UserData()
    sm.execute(parent)
    name = "StateMachine with outcomes ['done', 'preempted']"
    assert log.warn == [
        f"input of {name}: user data key 'i' is not there; present: none",
        f"output of {name}: user data key 'o' is not there; present: none",
    ]
    parent.a, parent.b = 1, 2
    sm.execute(parent)
    assert log.warn[2].endswith("present: a, b")


def test_a_second_run_at_the_same_time_is_refused_by_name():
    sm = machine(Calls(lambda ud: sm.execute()))
    with pytest.raises(smach.InvalidUserCodeError, match="StateMachine with outcomes .* is already running"):
        sm.execute()


# -- machines ------------------------------------------------------------------------------------


def test_a_run_is_told_step_by_step(log):
    sm = machine(Says("done"), Says("done"))
    sm.userdata.x = 1
    sm.execute()
    assert log.info == [
        "State machine starting in initial state 'S0' with user data ['x']",
        "State machine transitioning 'S0':'done'-->'S1'",
        "State machine terminating 'S1':'done':'done'",
    ]
    log.info.clear()
    each(Says("done"), outcomes=["done"]).execute()
    concurrence(children={"A": Says("done")}).execute()
    assert log.info == [
        "Iterator starting over 'item' with state 'EACH'",
        "Iterator ending with 'done'",
        "Concurrence starting with children ['A']",
        "Concurrence ending with 'failed', children {'A': 'done'}",
    ]


def test_every_fault_of_a_machine_is_told_at_once():
    sm = smach.StateMachine(["end"])
    with pytest.raises(smach.InvalidTransitionError, match="there are no states in it"):
        sm.check_consistency()
    sm.set_initial_state(["NOWHERE"])
    with sm:
        smach.StateMachine.add("A", Says("end", registered=["end", "lost", "gone"]), {"gone": "B"})
    with pytest.raises(smach.InvalidTransitionError) as error:
        sm.check_consistency()
    message = str(error.value)
    assert "initial state 'NOWHERE' is not among its labels" in message
    assert "outcome 'lost' of state 'A' has no transition and is no outcome of the machine" in message
    assert "outcome 'gone' of state 'A' leads to 'B', which is neither" in message
    assert "'end'" not in message.split("Labels:")[0] and message.endswith("Labels: ['A'], outcomes: ['end']")


def test_a_transition_must_lead_from_an_outcome_to_a_name():
    with smach.StateMachine(["done"]) as sm:
        with pytest.raises(smach.InvalidTransitionError, match="transition from 'no', .* its outcomes \\['done'\\]"):
            smach.StateMachine.add("A", Says("done"), {"no": "B"})
        with pytest.raises(smach.InvalidTransitionError, match="transition from 'done' to 3; expected a label"):
            smach.StateMachine.add("A", Says("done"), {"done": 3})
        with pytest.raises(smach.InvalidStateError, match="connector outcome 'no' is not among .* \\['done'\\]"):
            smach.StateMachine.add_auto("A", Says("done"), ["no"])
        assert sm.get_children() == {}
        smach.StateMachine.add("A", Says("done"))


def test_initial_states_that_have_no_effect_are_told(log):
    sm = machine(Says("done"), Says("done"))
    sm.set_initial_state([])
    sm.set_initial_state(["S1"])
    assert log.warn == [] and log.debug[-1] == "initial state set to ['S1']"
    sm.set_initial_state(["S0", "S1"])
    assert log.warn == ["a state machine begins with one state; of ['S0', 'S1'] the first is taken"]
    iterator = each(Says("done"))
    iterator.set_initial_state(["EACH"])
    assert len(log.warn) == 1
    iterator.set_initial_state(["OTHER"])
    assert log.warn[1] == "an iterator begins with its only state 'EACH', not with ['OTHER']"
    both = concurrence(children={"A": Says("done"), "B": Says("done")})
    both.set_initial_state(["B", "A"])
    assert len(log.warn) == 2
    both.set_initial_state(["A"])
    assert log.warn[2] == "a concurrence begins with all its children ['A', 'B'], not only with ['A']"


def test_each_level_says_in_which_state_it_happened(log):
    inner = machine(Raises(ValueError("deep")))
    with pytest.raises(smach.InvalidUserCodeError, match="state 'S0' \\(Raises\\) raised ValueError: deep") as error:
        machine(inner).execute()
    assert isinstance(error.value.__cause__, ValueError)
    assert log.error[-1] == "... in state 'S0' (StateMachine)"
    log.error.clear()
    with pytest.raises(smach.InvalidUserCodeError):
        each(machine(Raises(ValueError("deep")))).execute()
    assert log.error[-1] == "... in state 'EACH' (StateMachine) of an iterator"
    with pytest.raises(smach.InvalidUserCodeError, match="'EACH' \\(Raises\\) of an iterator raised ValueError: flat"):
        each(Raises(ValueError("flat"))).execute()


@pytest.mark.parametrize("outcome", [None, "other", ["unhashable"]])
@pytest.mark.parametrize(
    ("build", "label"),
    [(machine, "S0"), (each, "EACH"), (lambda state: concurrence(children={"A": state}), "A")],
)
def test_an_outcome_that_nobody_registered_is_told_with_those_that_are(build, label, outcome):
    container = build(Says(outcome, registered=["done", "preempted"]))
    with pytest.raises((smach.InvalidTransitionError, smach.InvalidStateError)) as error:
        container.execute()
    message = str(error.value)
    assert f"state '{label}' (Says)" in message and f"returned {outcome!r}, which is not among its outcomes" in message
    assert "['done', 'preempted']" in message


def test_a_sequence_says_which_connector_a_state_lacks(log):
    with smach.Sequence(["done", "other"], "done"):
        smach.Sequence.add("A", Says("other"))
    assert "state 'A' lacks the sequence's connector outcome 'done' (it has ['other'])" in log.error[0]


# -- concurrences and iterators ------------------------------------------------------------------


def test_a_concurrence_says_what_is_wrong_with_its_arguments():
    for arguments, words in (
        ({"default_outcome": "no"}, r"default_outcome 'no' is not among its outcomes \['done'\]"),
        ({"outcome_map": {"no": {}}}, r"outcome_map has 'no', which is not among its outcomes \['done'\]"),
        ({"outcome_cb": 3}, "outcome_cb must be callable, got int"),
        ({"child_termination_cb": 3}, "child_termination_cb must be callable, got int"),
    ):
        with pytest.raises(smach.InvalidStateError, match=words):
            smach.Concurrence(**({"outcomes": ["done"], "default_outcome": "done"} | arguments))
    both = concurrence(outcome_map={"done": {"A": "no", "X": "done"}}, children={"A": Says("done")})
    with pytest.raises(smach.InvalidTransitionError) as error:
        both.check_consistency()
    assert "'done' depends on outcome 'no' of 'A', which has only ['done']" in str(error.value)
    assert "'done' depends on 'X', which is not among its labels ['A']" in str(error.value)


def test_an_iterator_says_what_nobody_has():
    iterator = each(Says("done"), loop_outcomes=["no"], final_outcome_map={"done": "nowhere"})
    with pytest.raises(smach.InvalidTransitionError) as error:
        iterator.check_consistency()
    assert "iterator over 'EACH': ['no'] are not among the state's outcomes ['done']" in str(error.value)
    assert "['nowhere'] of final_outcome_map not among the iterator's ['done', 'exhausted']" in str(error.value)


def test_items_that_end_with_an_error_are_told(log):
    def items():
        yield 1
        raise ValueError("no more")

    assert each(Says("done"), items=items, loop_outcomes=["done"]).execute() == "exhausted"
    assert "iterator over 'EACH' ended with an error, taken as exhausted" in log.error[0] and "no more" in log.error[0]
    with pytest.raises(smach.InvalidUserCodeError, match="over 'EACH' could not be had: TypeError: "):
        each(Says("done"), items=3).execute()


def test_an_iterator_shows_its_state_while_it_runs():
    seen = []
    iterator = each(Calls(lambda ud: seen.append((iterator.get_active_states(), iterator.is_running()))))
    assert iterator.get_active_states() == [] and iterator.execute() == "done"
    assert seen == [(["EACH"], True)] and iterator.get_active_states() == []
    assert smach.Iterator(["done"], [], []).get_initial_states() == []
