"""Packaging, errors and log, states."""

import pytest
import smach
from smach.exceptions import SmachError


def test_set_loggers_order_and_lookup_at_call_time():
    got = []
    smach.set_loggers(*[lambda m, level=level: got.append(level) for level in "iwde"])
    smach.loginfo("x"), smach.logwarn("x"), smach.logdebug("x"), smach.logerr("x")
    assert got == ["i", "w", "d", "e"]
    smach.logerr = lambda m: got.append("patched")
    SmachError("x")
    assert got[-1] == "patched"


def test_outcomes_and_keys():
    state = smach.State(["b", "a", "b"], ["i"], ["o"], ["x"])
    assert state.get_registered_outcomes() == ("b", "a")
    assert state.get_registered_input_keys() == ("i", "x")
    assert state.get_registered_output_keys() == ("o", "x")
    state.register_outcomes(["c"])
    state.register_input_keys(["i2"])
    state.register_output_keys(["o2"])
    state.register_io_keys(["y"])
    assert state.get_registered_outcomes() == ("b", "a", "c")
    assert state.get_registered_input_keys() == ("i", "x", "i2", "y")
    assert state.get_registered_output_keys() == ("o", "x", "o2", "y")


def test_any_iterable_but_no_lone_string():
    assert smach.State(("a",), {"k": 1}).get_registered_input_keys() == ("k",)
    with pytest.raises(TypeError, match=r"\['done'\]"):
        smach.State("done")
    with pytest.raises(TypeError):
        smach.State(outcomes=None)


def test_cb_state():
    def cb(ud, *args, **kwargs):
        ud.seen = (args, kwargs)
        return "yes"

    state = smach.CBState(cb, cb_args=[1, 2], cb_kwargs={"k": 3}, outcomes=["yes"], output_keys=["seen"])
    ud = smach.UserData()
    assert state.execute(ud) == "yes" and ud.seen == ((1, 2), {"k": 3})


def test_cb_state_merges_a_decorated_callback():
    @smach.cb_interface(outcomes=["a"], input_keys=["i"], output_keys=["o"])
    def cb(ud):
        return "a"

    state = smach.CBState(cb, outcomes=["b"], input_keys=["j"], io_keys=["x"])
    assert state.get_registered_outcomes() == ("b", "a")
    assert set(state.get_registered_input_keys()) == {"i", "j", "x"}
    assert set(state.get_registered_output_keys()) == {"o", "x"}
    assert state.execute(smach.UserData()) == "a"


def test_cb_interface():
    @smach.cb_interface(outcomes=["a"], input_keys=["i"], output_keys=["o"])
    def cb(x):
        """Text."""
        return x + 1

    assert isinstance(cb, smach.CBInterface) and cb(1) == 2 and cb.__doc__ == "Text."
    assert cb.get_registered_outcomes() == ("a",)
    assert cb.get_registered_input_keys() == ("i",) and cb.get_registered_output_keys() == ("o",)
    assert smach.cb_interface()(lambda: 1)() == 1


def test_cb_interface_on_a_method():
    class Robot:
        @smach.cb_interface(outcomes=["a"])
        def cb(self, ud):
            return self, ud

    robot = Robot()
    assert robot.cb(3) == (robot, 3) and robot.cb.get_registered_outcomes() == ("a",)
