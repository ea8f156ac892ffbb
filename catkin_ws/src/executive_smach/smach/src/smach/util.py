"""Callbacks that declare outcomes and keys like states."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Any

from smach.ordered_set import OrderedSet, names


class CBInterface:
    """A callable with outcomes and keys. Usually created by the decorator `cb_interface`.

    Example::

        check = CBInterface(lambda ud: "ok", outcomes=["ok"], io_keys=["n"])
        check.get_registered_output_keys()      # ('n',)
    """

    def __init__(
        self,
        cb: Callable[..., Any],
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        if not callable(cb):
            raise TypeError(f"CBInterface: expected a callable, got {type(cb).__name__}")
        self._cb = cb
        io_keys = names("io_keys", io_keys)
        self._outcomes = OrderedSet(names("outcomes", outcomes))
        self._input_keys = OrderedSet((*names("input_keys", input_keys), *io_keys))
        self._output_keys = OrderedSet((*names("output_keys", output_keys), *io_keys))
        functools.update_wrapper(self, cb, updated=())

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._cb(*args, **kwargs)

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        """Bind a decorated method like any other method."""
        if instance is None or not hasattr(self._cb, "__get__"):
            return self
        return CBInterface(self._cb.__get__(instance, owner), self._outcomes, self._input_keys, self._output_keys)

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """The declared outcomes. Example: `check.get_registered_outcomes()`."""
        return tuple(self._outcomes)

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """The keys that the callback reads. Example: `check.get_registered_input_keys()`."""
        return tuple(self._input_keys)

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """The keys that the callback writes. Example: `check.get_registered_output_keys()`."""
        return tuple(self._output_keys)


class cb_interface:
    """Decorator that declares the outcomes and keys of a callback.

    Example::

        @smach.cb_interface(outcomes=["done"], input_keys=["x"], output_keys=["y"])
        def double(ud):
            ud.y = 2 * ud.x
            return "done"
    """

    def __init__(
        self,
        outcomes: Iterable[str] | None = None,
        input_keys: Iterable[str] | None = None,
        output_keys: Iterable[str] | None = None,
        io_keys: Iterable[str] | None = None,
    ) -> None:
        self._interface = (outcomes or (), input_keys or (), output_keys or (), io_keys or ())

    def __call__(self, cb: Callable[..., Any]) -> CBInterface:
        return CBInterface(cb, *self._interface)


def has_smach_interface(obj: Any) -> bool:
    """True if `obj` declares outcomes and keys, as states and decorated callbacks do.

    Example: `has_smach_interface(smach.State())` is True.
    """
    return all(hasattr(obj, f"get_registered_{what}") for what in ("outcomes", "input_keys", "output_keys"))
