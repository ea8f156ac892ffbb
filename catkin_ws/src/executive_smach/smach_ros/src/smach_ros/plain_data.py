"""User data as a message field: base64 text of a pickled dict, the format that existing viewers expect.

Pickle can contain code. So only plain data is written (None, bool, int, float, str, bytes, list, tuple,
dict; everything else as its repr), and text is read by a decoder that can only construct these types.
Pickle is used nowhere else here.
"""

from __future__ import annotations

import base64
import binascii
import io
import numbers
import pickle
import pickletools
from collections.abc import Mapping
from typing import Any

MAX_TEXT = 1 << 20  # characters of local_data that are read
MAX_STEPS = 20_000  # opcodes of one pickle
MAX_NODES = 20_000  # values in one dict; shared values count each time
MAX_DEPTH = 64  # levels of nesting
MAX_REPR = 2_000  # characters of a repr
MAX_STRING = 100_000  # characters of a string, bytes of a byte string

# Opcodes that construct plain values. All opcodes that name, call or restore objects are missing.
_ALLOWED = frozenset(
    """
    PROTO FRAME STOP MARK POP POP_MARK DUP MEMOIZE PUT BINPUT LONG_BINPUT GET BINGET LONG_BINGET
    NONE NEWTRUE NEWFALSE INT BININT BININT1 BININT2 LONG LONG1 LONG4 FLOAT BINFLOAT UNICODE
    BINUNICODE SHORT_BINUNICODE BINUNICODE8 BINBYTES SHORT_BINBYTES BINBYTES8 EMPTY_LIST LIST APPEND
    APPENDS EMPTY_TUPLE TUPLE TUPLE1 TUPLE2 TUPLE3 EMPTY_DICT DICT SETITEM SETITEMS
    """.split()
)
_LEAVES = (type(None), bool, int, float, str, bytes)


class InvalidDataError(ValueError):
    """Text that is not a plain dict in the expected format.

    Example: `decode("hello")` raises it.
    """


def encode(data: Mapping[Any, Any]) -> str:
    """The text for `local_data`. A value never causes an exception: values that are not plain are written as
    their repr.

    Protocol 2, for old viewers; protocol 3 if there are byte strings, which protocol 2 can only write as a
    function call. Example: `status.local_data = encode({"count": 3})`.
    """
    plain = to_plain(dict(data))
    protocol = 3 if _has_bytes(plain) else 2
    return base64.b64encode(pickle.dumps(plain, protocol)).decode("ascii")


def decode(text: str) -> dict[str, Any]:
    """The dict in `local_data`; {} for empty text. Raises InvalidDataError. Never executes code.

    Example: `decode(encode({"count": 3})) == {"count": 3}`.
    """
    if not text:
        return {}
    if len(text) > MAX_TEXT:
        raise InvalidDataError(f"local_data has {len(text)} characters, at most {MAX_TEXT} are read")
    try:
        raw = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InvalidDataError(f"local_data is no base64 text: {error}") from error
    _check_opcodes(raw)
    try:
        data = _PlainUnpickler(io.BytesIO(raw)).load()
    except Exception as error:
        raise InvalidDataError(f"local_data is no pickle of plain data: {type(error).__name__}: {error}") from error
    if type(data) is not dict or not all(type(key) is str for key in data):
        raise InvalidDataError("local_data must be a dict with strings as keys")
    _check_values(data)
    return data


class _PlainUnpickler(pickle.Unpickler):
    """An unpickler without classes and functions."""

    def find_class(self, module_name: str, global_name: str) -> Any:
        raise pickle.UnpicklingError(f"{module_name}.{global_name} is refused: only plain data is read")

    def persistent_load(self, pid: Any) -> Any:
        raise pickle.UnpicklingError("persistent ids are refused: only plain data is read")


def _check_opcodes(raw: bytes) -> None:
    """Refuse bad opcodes before anything is built, and memo indices that would make the unpickler reserve gigabytes."""
    try:
        for step, (opcode, argument, _position) in enumerate(pickletools.genops(raw)):
            if opcode.name not in _ALLOWED:
                raise InvalidDataError(f"local_data contains {opcode.name}: only plain data is read")
            if step >= MAX_STEPS:
                raise InvalidDataError(f"local_data is larger than {MAX_STEPS} pickle steps")
            if "PUT" in opcode.name and not 0 <= int(argument or 0) <= MAX_STEPS:
                raise InvalidDataError(f"local_data uses memo number {argument}, at most {MAX_STEPS} is read")
    except InvalidDataError:
        raise
    except Exception as error:
        raise InvalidDataError(f"local_data is no pickle: {type(error).__name__}: {error}") from error


def _check_values(data: Any) -> None:
    """Refuse other types, cycles and deep nesting. Shared values count each time, so that the data stays small."""
    nodes = 0
    todo: list[tuple[Any, int]] = [(data, 0)]
    while todo:
        value, depth = todo.pop()
        nodes += 1
        if nodes > MAX_NODES or depth > MAX_DEPTH:
            raise InvalidDataError(f"local_data holds more than {MAX_NODES} values or {MAX_DEPTH} levels")
        if type(value) is dict:
            todo.extend((part, depth + 1) for item in value.items() for part in item)
        elif type(value) in (list, tuple):
            todo.extend((part, depth + 1) for part in value)
        elif type(value) not in _LEAVES:
            raise InvalidDataError(f"local_data holds a {type(value).__name__}: only plain data is read")


def to_plain(value: Any) -> Any:
    """A plain copy of `value`. Parts that are not plain, too large or too deep are replaced by their repr.

    Example: `to_plain({"lock": threading.Lock()})` is `{"lock": "<unlocked ...>"}`.
    """
    return _to_plain(value, 0, [0])


def _to_plain(value: Any, depth: int, nodes: list[int]) -> Any:
    nodes[0] += 1
    try:
        if value is None or type(value) in (bool, float):
            return value
        if isinstance(value, numbers.Integral) and not isinstance(value, bool):
            return int(value) if abs(int(value)) < 1 << 4096 else _repr(value)
        if isinstance(value, numbers.Real):
            return float(value)
        if isinstance(value, str):
            return str.__str__(value[:MAX_STRING])
        if isinstance(value, bytes) and len(value) <= MAX_STRING:
            return bytes(value)
        if not isinstance(value, (list, tuple, dict)):
            return _repr(value)
        if depth >= MAX_DEPTH // 2 or nodes[0] + len(value) > MAX_NODES // 4:
            # Not the repr, which may exceed the memory: parts can be shared many times.
            return f"<{type(value).__name__} of {len(value)} items, too large or too deep to show>"
        if isinstance(value, dict):
            return {_to_key(key, depth, nodes): _to_plain(item, depth + 1, nodes) for key, item in list(value.items())}
        items = [_to_plain(item, depth + 1, nodes) for item in list(value)]
        return items if isinstance(value, list) else tuple(items)
    except Exception:  # raised by a property or conversion of the value
        return _repr(value)


def _to_key(key: Any, depth: int, nodes: list[int]) -> Any:
    plain = _to_plain(key, depth + 1, nodes)
    try:
        hash(plain)
    except TypeError:
        return _repr(key)
    return plain if depth > 0 or isinstance(plain, str) else _repr(key)


def _repr(value: Any) -> str:
    try:
        text = repr(value)
        return text if len(text) <= MAX_REPR else text[: MAX_REPR - 3] + "..."
    except Exception as error:
        return f"<{value.__class__.__name__} whose repr raised {type(error).__name__}>"


def _has_bytes(value: Any) -> bool:
    if isinstance(value, dict):
        return any(_has_bytes(part) for item in value.items() for part in item)
    if isinstance(value, (list, tuple)):
        return any(map(_has_bytes, value))
    return isinstance(value, bytes)
