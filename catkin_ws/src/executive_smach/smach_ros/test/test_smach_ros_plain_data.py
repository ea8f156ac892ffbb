"""Introspection without a roscore: message sums, user data on the wire, and hostile texts."""

import base64
import collections
import enum
import os
import pickle
import random
import struct
import threading

import pytest
import smach
import smach_msgs.msg
from smach_ros.plain_data import InvalidDataError, decode, encode, to_plain


@pytest.mark.parametrize(
    "name, md5",
    [
        ("SmachContainerStatus", "5ba2bb79ac19e3842d562a191f2a675b"),
        ("SmachContainerStructure", "3d3d1e0d0f99779ee9e58101a5dcf7ea"),
        ("SmachContainerInitialStatusCmd", "45f8cf31fc29b829db77f23001f788d6"),
    ],
)
def test_messages_match_those_of_other_viewers(name, md5):
    assert getattr(smach_msgs.msg, name)._md5sum == md5


PLAIN = {
    "none": None,
    "bools": [True, False],
    "ints": [0, -1, 1 << 70, 255, 65536],
    "float": 2.5,
    "text": "ä \N{SNOWMAN} \x00",
    "tuple": (1, (2, ()), [3]),
    "dict": {"a": {1: 2}},
}


def test_plain_data_goes_there_and_back():
    assert decode(encode(PLAIN)) == PLAIN
    assert decode(encode({"b": b"\x00\xff", "l": [b""]})) == {"b": b"\x00\xff", "l": [b""]}


def test_the_text_is_base64_of_a_protocol_2_pickle_of_a_dict():
    text = encode(PLAIN)
    raw = base64.b64decode(text, validate=True)
    assert raw[:2] == b"\x80\x02" and "\n" not in text
    assert pickle.loads(raw) == PLAIN  # as a viewer does


class Odd:
    def __repr__(self):
        raise RuntimeError("no repr")


class Colour(enum.IntEnum):
    RED = 1


def test_what_is_not_plain_shows_as_its_repr():
    lock = threading.Lock()
    shown = decode(encode({"lock": lock, "f": len, "odd": Odd(), "set": {1}, "inside": [lock, {"x": lock}]}))
    assert shown["lock"] == repr(lock) == shown["inside"][0] == shown["inside"][1]["x"]
    assert shown["f"] == repr(len) and shown["set"] == "{1}" and "Odd" in shown["odd"]


def test_subclasses_of_plain_types_become_plain():
    point = collections.namedtuple("Point", "x y")(1, 2)
    shown = decode(
        encode(
            {
                "p": point,
                "c": Colour.RED,
                "d": collections.OrderedDict(a=1),
                "s": type("S", (str,), {})("t"),
            }
        )
    )
    assert shown == {"p": (1, 2), "c": 1, "d": {"a": 1}, "s": "t"}
    assert type(shown["p"]) is tuple and type(shown["c"]) is int


def test_numpy():
    import numpy

    shown = decode(encode({"i": numpy.int32(3), "f": numpy.float32(0.5), "a": numpy.zeros(3)}))
    assert shown["i"] == 3 and shown["f"] == 0.5 and isinstance(shown["a"], str)


def test_read_only_view_is_encoded_as_its_object():
    ud = smach.UserData()
    ud.f = Odd()
    assert "Odd" in to_plain(smach.Remapper(ud, ["f"]).f)


def test_cycles_depth_and_size_end():
    loop = []
    loop.append(loop)
    deep = []
    for _ in range(5000):
        deep = [deep]
    shared = [1]
    for _ in range(60):
        shared = [shared, shared]
    shown = decode(
        encode(
            {
                "loop": loop,
                "deep": deep,
                "shared": shared,
                "long": list(range(10**6)),
                "s": "x" * 10**7,
            }
        )
    )
    assert set(shown) == {"loop", "deep", "shared", "long", "s"} and len(encode({"s": "x" * 10**7})) < 200_000


# Hostile texts. `fired` must stay empty whatever is decoded.

fired = []


def fire(*args):
    fired.append(args)
    return {}


class Bomb:
    def __reduce__(self):
        return fire, ("boom",)


class Builds:
    def __setstate__(self, state):
        fired.append(state)


def b64(raw):
    return base64.b64encode(raw).decode()


def hostile():
    yield "class", pickle.dumps({"a": Bomb()}, 2)
    yield "top", pickle.dumps(Bomb(), 2)
    for protocol in range(6):
        yield f"setstate {protocol}", pickle.dumps({"a": Builds()}, protocol)
        yield f"set {protocol}", pickle.dumps({"a": {1}}, protocol)
        yield f"function {protocol}", pickle.dumps({"a": os.system}, protocol)
        yield f"complex {protocol}", pickle.dumps({"a": 1j}, protocol)
    yield "os.system", b"cos\nsystem\n(S'touch /tmp/never'\ntR."
    yield "inst", b"(S'touch /tmp/never'\nios\nsystem\n."
    yield "obj", b"(cos\nsystem\nS'x'\no."
    yield "newobj", b"\x80\x02cbuiltins\nobject\n)\x81."
    yield "ext", b"\x80\x02}\x82\x01."
    yield "persistent", b"Pid\n."
    yield "binary persistent", b"\x80\x02}Q."
    yield "bytearray", pickle.dumps({"a": bytearray(b"x")}, 5)
    yield "next buffer", b"\x80\x05\x97."
    yield "memo reserve", b"\x80\x02}r\xff\xff\xff\x7f."
    yield "text memo reserve", b"\x80\x02}p99999999999\n."
    yield "huge length", b"\x80\x04\x8d" + struct.pack("<Q", 1 << 60) + b"x."
    yield "huge frame", b"\x80\x04\x95" + struct.pack("<Q", 1 << 60) + b"}."
    yield "many digits", b"I" + b"9" * 5000 + b"\n."
    yield "no stop", b"\x80\x02}"
    yield "empty stack", b"."
    yield "pop", b"0."
    yield "unhashable key", b"\x80\x02}]K\x01s."
    yield "no dict", pickle.dumps([1], 2)
    yield "number keys", pickle.dumps({1: 1}, 2)
    yield "nested too deep", b"\x80\x02}U\x01a" + b"]" * 4000 + b"a" * 3999 + b"s."
    yield "too many", pickle.dumps({"a": [object] and list(range(300_000))}, 2)
    shared = [1]
    for _ in range(60):
        shared = [shared, shared]
    yield "shared", pickle.dumps({"a": shared}, 2)
    loop = []
    loop.append(loop)
    yield "loop", pickle.dumps({"a": loop}, 2)
    # Numbers with one hash: a dict of them costs quadratic time.
    keys = b"".join(pickle.dumps(k * ((1 << 61) - 1), 2)[2:-1] + b"N" for k in range(1, 40_000))
    yield "colliding keys", b"\x80\x02}(" + keys + b"u."
    yield "old strings", b"\x80\x02}U\x01aK\x01s."


@pytest.mark.parametrize("name, raw", hostile(), ids=lambda value: value if isinstance(value, str) else "")
def test_hostile_pickles_are_refused(name, raw):
    with pytest.raises(InvalidDataError):
        decode(b64(raw))
    assert fired == [] and not os.path.exists("/tmp/never")


@pytest.mark.parametrize("text", ["hello", "====", "gAJ9cQAu\n", "\x00", "ä", "A" * (2 << 20), "gAJ9cQ"])
def test_texts_that_are_no_base64_pickle_are_refused(text):
    with pytest.raises(InvalidDataError):
        decode(text)


def test_ten_thousand_damaged_pickles_never_do_more_than_be_refused():
    seed = random.Random(11)
    sources = [pickle.dumps(PLAIN, p) for p in range(6)] + [pickle.dumps({"a": Bomb()}, p) for p in range(6)]
    for _ in range(10_000):
        raw = bytearray(seed.choice(sources))
        for _ in range(seed.randint(1, 6)):
            raw[seed.randrange(len(raw))] = seed.randrange(256)
        try:
            assert type(decode(b64(bytes(raw)))) is dict
        except InvalidDataError:
            pass
    assert fired == []
