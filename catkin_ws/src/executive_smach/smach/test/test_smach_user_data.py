"""User data."""

import copy
import pickle
import threading
import time
import types

import pytest
import smach
from smach.user_data import Const


def test_attributes_and_items_are_the_same():
    ud = smach.UserData()
    ud.a = 1
    ud["b"] = 2
    assert (ud["a"], ud.b) == (1, 2)
    assert "a" in ud and "c" not in ud and ud.keys() == ["a", "b"]


def test_missing_key_is_a_key_error_after_an_error_log(log):
    ud = smach.UserData()
    with pytest.raises(KeyError):
        ud.x  # noqa: B018
    with pytest.raises(KeyError, match="'x'"):
        ud["x"]
    assert len(log.error) == 2


def test_extract_and_merge_with_remapping():
    ud = smach.UserData()
    ud.a, ud.b = [1], 2
    local = ud.extract(["a", "b"], {"x": "a"})
    assert (local.x, local.b, len(local.keys())) == ([1], 2, 2)
    assert local.x is not ud.a  # a shallow copy
    local.x = [9]
    ud.merge(local, ["x"], {"x": "a"})
    assert ud.a == [9] and ud.a is not local.x
    with pytest.raises(KeyError):
        ud.extract(["nothing"], {})


def test_locked_makes_transactions():
    ud = smach.UserData()
    ud.n = 0
    view = smach.Remapper(ud, ["n"], ["n"], {})

    def count():
        for _ in range(100):
            with smach.user_data.locked(view):
                before = view.n
                time.sleep(0.0001)  # here the others come in
                view.n = before + 1

    threads = [threading.Thread(target=count) for _ in range(4)]
    [t.start() for t in threads], [t.join() for t in threads]
    assert ud.n == 400


class Thing:
    """An instance of a user class: it has a __dict__."""

    def __init__(self):
        self.x = 1
        self.inner = types.SimpleNamespace(y=2)
        self.items = {"k": types.SimpleNamespace(z=3)}

    def double(self):
        return 2 * self.x

    def __getitem__(self, key):
        return self.items[key]

    def __eq__(self, other):
        return isinstance(other, Thing) and other.x == self.x

    def __hash__(self):
        return 5

    def __str__(self):
        return "a thing"

    def __add__(self, other):
        return self.x + other

    def __len__(self):
        return 7


def view_of(value, outputs=()):
    ud = smach.UserData()
    ud.v = value
    return smach.Remapper(ud, ["v", "absent"], ["w", *outputs], {"w": "outer_w"}), ud


def test_remapper_undeclared_read_is_a_user_code_error():
    view, _ = view_of(1)
    for key in ("nothing", "w"):  # also keys that are only output keys
        with pytest.raises(smach.InvalidUserCodeError, match=key):
            view[key]
        with pytest.raises(smach.InvalidUserCodeError):
            getattr(view, key)


def test_remapper_undeclared_write_is_logged_and_ignored(log):
    view, ud = view_of(1)
    view.v = 2
    view["z"] = 3
    assert (ud.v, ud.keys()) == (1, ["v"]) and len(log.error) == 2 and "'v'" in log.error[0]


def test_remapper_renames():
    view, ud = view_of(1)
    view.w = 5
    assert ud.outer_w == 5 and "w" not in ud


def test_remapper_io_key_gives_the_very_object():
    thing = Thing()
    view, _ = view_of(thing, outputs=["v"])
    assert view.v is thing
    view.v.x = 9
    assert thing.x == 9


def test_const_reads_recursively():
    const = view_of(Thing())[0].v
    assert const.x == 1 and const.inner.y == 2 and const["k"].z == 3
    assert issubclass(type(const.inner), Const) and issubclass(type(const["k"]), Const)
    assert const.items["k"].z == 3


def test_const_refuses_assignment_and_del():
    thing = Thing()
    const = view_of(thing)[0].v
    for target in (const, const.inner):
        with pytest.raises(TypeError, match="io_keys"):
            target.x = 5
        with pytest.raises(TypeError, match="io_keys"):
            del target.x
    assert thing.x == 1 and not hasattr(thing.inner, "x")
    writable = types.SimpleNamespace(data={})
    type_with_items = type("T", (), {"__setitem__": lambda s, k, v: None, "__delitem__": lambda s, k: None})
    items = view_of(type_with_items())[0].v
    with pytest.raises(TypeError, match="__setitem__ .* T .* io_keys"):
        items["a"] = 1
    with pytest.raises(TypeError, match="__delitem__ .* T .* io_keys"):
        del items["a"]
    assert writable.data == {}


def test_const_forwards_calls_comparison_text_and_kind():
    const = view_of(Thing())[0].v
    assert const.double() == 2 and str(const) == "a thing" and f"{const}" == "a thing"
    assert const == Thing() and Thing() == const and const != 3 and const == view_of(Thing())[0].v
    assert isinstance(const, Thing) and hash(const) == 5
    assert const + 1 == 2 and len(const) == 7 and not callable(const)
    assert view_of(lambda x: x + 1)[0].v(1) == 2


def test_const_copies_are_free():
    thing = Thing()
    const = view_of(thing)[0].v
    for clone in (copy.copy(const), copy.deepcopy(const), pickle.loads(pickle.dumps(const))):
        clone.x = 4
        assert type(clone) is Thing and thing.x == 1
