"""The data that states share: one store per container, and a restricted view of it for each state."""

from __future__ import annotations

import copy
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import smach
from smach.const import Const, const
from smach.exceptions import InvalidUserCodeError

__all__ = ["Const", "Remapper", "UserData", "locked"]


class MissingKeyError(KeyError, AttributeError):
    """A key that is not in the user data. It is both a KeyError and an AttributeError, so that `hasattr(ud, "x")`
    is False.

    Example: `UserData().x` raises it, and `except KeyError` catches it.
    """

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class UserData:
    """Named values, accessible as attributes or as items. Names with a leading underscore are plain attributes.

    Each single access is atomic; for several accesses use `locked`.

    Example::

        ud = UserData()
        ud.count = 1
        assert ud["count"] == 1 and "count" in ud
    """

    def __init__(self) -> None:
        self._data: dict[str, Any] = {}
        self._lock = threading.RLock()

    def __getitem__(self, key: str) -> Any:
        try:
            return self._data[key]
        except KeyError:
            present = ", ".join(map(repr, self.keys())) or "none"
            message = f"user data has no key {key!r}; present: {present}"
        smach.logerr(message)
        raise MissingKeyError(message)

    def __setitem__(self, key: str, value: Any) -> None:
        with self._lock:
            self._data[key] = value

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        return self[name]

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith("_"):
            object.__setattr__(self, name, value)
        else:
            self[name] = value

    def __contains__(self, key: object) -> bool:
        return key in self._data

    def keys(self) -> list[str]:
        """The names, oldest first. Example: `ud.keys()`."""
        with self._lock:
            return list(self._data)

    def update(self, ud: UserData | Mapping[str, Any]) -> None:
        """Copy every value of another store or of a dict into this one. Example: `ud.update(other)`."""
        data = dict(ud) if isinstance(ud, Mapping) else ud._data
        with self._lock:
            self._data.update(data)

    def extract(self, keys: Iterable[str], remapping: Mapping[str, str]) -> UserData:
        """New store with shallow copies of the values `keys`, under their local names.

        `keys` are names of this store, `remapping` is {local name: name here}. Raises KeyError if a key is
        absent. Example: `ud.extract(["a"], {"x": "a"}).x` is a copy of `ud.a`.
        """
        local_names: dict[str, list[str]] = {}
        for local, outer in remapping.items():
            local_names.setdefault(outer, []).append(local)
        result = UserData()
        for key in keys:
            for local in local_names.get(key, [key]):
                result[local] = copy.copy(self[key])
        return result

    def merge(self, ud: UserData, keys: Iterable[str], remapping: Mapping[str, str]) -> None:
        """Inverse of `extract`: copy the values `keys` (local names) of `ud` into this store, renamed by `remapping`.

        Example: `ud.merge(local, ["x"], {"x": "a"})` sets `ud.a` to a copy of `local.x`.
        """
        for key in keys:
            self[remapping.get(key, key)] = copy.copy(ud[key])

    def __getstate__(self) -> dict:
        state = self.__dict__.copy()
        state.pop("_lock", None)
        return state

    def __setstate__(self, state: dict) -> None:
        self.__dict__.update(state)
        self._lock = threading.RLock()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._data!r})"


class Remapper:
    """A state's view of its container's user data: with the state's own names, and only its declared keys.

    `remapping` is {the state's name: the container's name}. Reading a key outside of `input_keys`
    raises InvalidUserCodeError. Writing a key outside of `output_keys` is logged and ignored. An
    object that is read through a key that is not also an output key is read-only (`Const`).

    Example::

        view = Remapper(ud, input_keys=["x"], output_keys=["y"], remapping={"x": "count"})
        view.y = view.x + 1       # ud.y = ud.count + 1
    """

    def __init__(
        self,
        ud: UserData | Remapper,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        remapping: Mapping[str, str] | None = None,
    ) -> None:
        self._ud = ud
        self._input_keys = frozenset(input_keys)
        self._output_keys = frozenset(output_keys)
        self._map = remapping if remapping is not None else {}

    def _remap(self, key: str) -> str:
        return self._map.get(key, key)

    def __getitem__(self, key: str) -> Any:
        if key not in self._input_keys:
            declared = ", ".join(sorted(map(repr, self._input_keys))) or "none"
            raise InvalidUserCodeError(
                f"reading user data key {key!r}, which is not among this state's input keys "
                f"({declared}); "
                f"add it to input_keys or io_keys"
            )
        value = self._ud[self._remap(key)]
        return value if key in self._output_keys else const(value)

    def __setitem__(self, key: str, value: Any) -> None:
        if key not in self._output_keys:
            declared = ", ".join(sorted(map(repr, self._output_keys))) or "none"
            smach.logerr(
                f"writing user data key {key!r} ignored: it is not among this state's output keys "
                f"({declared}); add it to output_keys or io_keys"
            )
            return
        self._ud[self._remap(key)] = value

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        return self[name]

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith("_"):
            object.__setattr__(self, name, value)
        else:
            self[name] = value

    def __contains__(self, key: object) -> bool:
        return key in self._input_keys and self._remap(key) in self._ud  # type: ignore

    def keys(self) -> list[str]:
        """Names of the existing input keys, as the state uses them. Example: `ud.keys()`."""
        return [key for key in sorted(self._input_keys) if key in self]

    def update(self, ud: UserData | Mapping[str, Any]) -> None:
        """Write every value of `ud` to the container's store, without key checks.

        Example: `ud.update(other)`.
        """
        self._ud.update(ud)

    def __repr__(self) -> str:
        return f"Remapper({{{', '.join(f'{key!r}: {self[key]!r}' for key in self.keys())}}})"


@contextmanager
def locked(ud: UserData | Remapper) -> Iterator[UserData | Remapper]:
    """Group several accesses: no other thread writes to this user data until the end of the block.

    Keep the block short and do not wait in it. Concurrent children share one store, so this also
    protects them from each other.

    Example::

        with smach.user_data.locked(ud):
            ud.count = ud.count + 1
    """
    store = ud
    while isinstance(store, Remapper):
        store = store._ud
    with store._lock:
        yield ud
