"""A read-only view of an object. A state receives it for a key that it declared only as input."""

from __future__ import annotations

import copy
import weakref
from typing import Any, SupportsIndex

# Python looks up special methods on the type, never on the instance: each needs its own forwarder.
_FORWARDED = """
__call__ __len__ __iter__ __next__ __reversed__ __contains__ __bool__ __int__ __float__
__complex__ __index__ __round__ __trunc__ __floor__ __ceil__ __abs__ __neg__ __pos__ __invert__
__bytes__ __fspath__ __array__ __add__ __radd__ __sub__ __rsub__ __mul__ __rmul__ __matmul__
__rmatmul__ __truediv__ __rtruediv__ __floordiv__ __rfloordiv__ __mod__ __rmod__ __divmod__
__rdivmod__ __pow__ __rpow__ __lshift__ __rlshift__ __rshift__ __rrshift__ __and__ __rand__ __or__
__ror__ __xor__ __rxor__ __lt__ __le__ __gt__ __ge__ __enter__ __exit__
""".split()
_REFUSED = ("__setitem__", "__delitem__")

_target = object.__getattribute__
_classes: weakref.WeakKeyDictionary[type, type] = weakref.WeakKeyDictionary()


def unwrap(value: Any) -> Any:
    """The object of a `Const`, or `value` itself. Example: `pickle.dumps(unwrap(ud.pose))`."""
    return _target(value, "_const_obj") if issubclass(type(value), Const) else value


def is_wrapped_kind(value: Any) -> bool:
    """True if reading `value` through an input-only key returns a `Const`: objects with a `__dict__`.

    Classes are excluded: `isinstance(x, wrapped_class)` would not work. Example:
    `is_wrapped_kind(3)` is False.
    """
    return not isinstance(value, type) and not issubclass(type(value), Const) and hasattr(value, "__dict__")


def const(value: Any) -> Any:
    """A read-only view of `value` if it has attributes that can be assigned, otherwise `value` itself.

    Example::

        >>> view = const(types.SimpleNamespace(x=1))
        >>> view.x
        1
        >>> view.x = 2
        TypeError: ...
    """
    return Const(value) if is_wrapped_kind(value) else value


class Const:
    """Read-only view of `obj`. Calls, comparison, text and `isinstance` act as on the object.
    Assignment and `del` raise TypeError. Attributes and items read through the view are read-only,
    too. The return value of a call is not.

    A method that changes its object does change it: the view prevents assignments, but not changes
    inside of methods. `copy.copy` and `copy.deepcopy` return a writable copy of the object. Example:
    see `const`.
    """

    __slots__ = ("_const_obj", "__weakref__")

    def __new__(cls, obj: Any) -> Const:
        kind = type(obj)
        view = _classes.get(kind)
        if view is None:
            view = _classes[kind] = _view_class(kind)
        self: Const = object.__new__(view)
        object.__setattr__(self, "_const_obj", obj)
        return self

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        return type(_target(self, "_const_obj"))

    def __getattr__(self, name: str) -> Any:
        return const(getattr(_target(self, "_const_obj"), name))

    def __setattr__(self, name: str, value: Any) -> None:
        raise TypeError(_refusal(self, f"attribute '{name}' cannot be set"))

    def __delattr__(self, name: str) -> None:
        raise TypeError(_refusal(self, f"attribute '{name}' cannot be deleted"))

    def __eq__(self, other: object) -> bool:
        return _target(self, "_const_obj") == unwrap(other)

    def __ne__(self, other: object) -> bool:
        return _target(self, "_const_obj") != unwrap(other)

    def __hash__(self) -> int:
        return hash(_target(self, "_const_obj"))

    def __str__(self) -> str:
        return str(_target(self, "_const_obj"))

    def __repr__(self) -> str:
        return repr(_target(self, "_const_obj"))

    def __format__(self, spec: str) -> str:
        return format(_target(self, "_const_obj"), spec)

    def __dir__(self) -> list[str]:
        return dir(_target(self, "_const_obj"))

    def __copy__(self) -> Any:
        return copy.copy(_target(self, "_const_obj"))

    def __deepcopy__(self, memo: dict) -> Any:
        return copy.deepcopy(_target(self, "_const_obj"), memo)

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        return _target(self, "_const_obj").__reduce_ex__(protocol)


def _refusal(view: Const, what: str) -> str:
    kind = type(_target(view, "_const_obj")).__name__
    return f"{what}: this {kind} came through an input-only key; declare the key among io_keys to change it"


def _forwarder(name: str) -> Any:
    def forward(self: Const, *args: Any, **kwargs: Any) -> Any:
        # Look the method up on the type, as Python does. A NotImplemented is returned unchanged.
        obj = _target(self, "_const_obj")
        return getattr(type(obj), name)(obj, *map(unwrap, args), **kwargs)

    forward.__name__ = name
    return forward


def _refuser(name: str) -> Any:
    def refuse(self: Const, *_args: Any) -> None:
        raise TypeError(_refusal(self, f"{name} is not allowed"))

    refuse.__name__ = name
    return refuse


def _getitem(self: Const, key: Any) -> Any:
    return const(_target(self, "_const_obj")[unwrap(key)])


def _has(kind: type, name: str) -> bool:
    """True if instances have the special method; `getattr(kind, name)` would also find the metaclass's."""
    return any(vars(base).get(name) is not None for base in kind.__mro__)


def _view_class(kind: type) -> type:
    """A Const class with exactly the special methods of `kind`, so that e.g. `callable(view)` is correct."""
    members: dict[str, Any] = {"__slots__": (), "__doc__": Const.__doc__}
    members.update({name: _forwarder(name) for name in _FORWARDED if _has(kind, name)})
    members.update({name: _refuser(name) for name in _REFUSED if _has(kind, name)})
    if _has(kind, "__getitem__"):
        members["__getitem__"] = _getitem
    return type("Const", (Const,), members)
