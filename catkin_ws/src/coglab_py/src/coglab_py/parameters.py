"""Reads ROS parameters with a type and a range, once at the start of a node. An error is one sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeVar, cast

import rospy

T = TypeVar("T", bool, int, float, str, dict[str, Any])


class ParameterError(ValueError):
    """A parameter is invalid. The message contains its name, the expected value and its value."""


def read(
    name: str,
    kind: type[T],
    default: T | None = None,
    low: float = -math.inf,
    high: float = math.inf,
    among: Sequence[str] = (),
) -> T:
    """A parameter of type bool, int, float, str or dict. A whole number is also accepted as a float.

    ``default`` is used if the parameter is not set; without a default it must be set. A number must lie in low..high,
    a text must be one of ``among`` if given. Raises ParameterError.
    """
    return checked(rospy.resolve_name(name), rospy.get_param(name, default), kind, low, high, among)


def numbers(name: str, default: Sequence[float] | None = None, length: int = 0) -> list[float]:
    """A parameter that is a list of finite numbers, of this ``length`` unless 0. Raises ParameterError."""
    return checked_numbers(rospy.resolve_name(name), rospy.get_param(name, default), length)


def points(name: str, default: Sequence[Sequence[float]]) -> list[list[float]]:
    """A parameter that is a list of points, with three finite numbers each. Raises ParameterError."""
    found, shown = rospy.get_param(name, default), rospy.resolve_name(name)
    if not isinstance(found, (list, tuple)):
        raise ParameterError(f"parameter {shown}: expected a list of points, got {str(found)[:60]!r}")
    return [checked_numbers(f"{shown}[{i}]", point, 3) for i, point in enumerate(found)]


def found_above(name: str, kind: type[T]) -> T | None:
    """The parameter with this name in the nearest namespace above the node; None if there is none."""
    found = rospy.search_param(name)
    return None if found is None else read(found, kind)


def checked(
    name: str, value: Any, kind: type[T], low: float = -math.inf, high: float = math.inf, among: Sequence[str] = ()
) -> T:
    """``value`` if it has this type and lies in this range. Otherwise raises ParameterError."""
    wanted = _wanted(kind, low, high, among)
    if value is None:
        raise ParameterError(f"parameter {name} is missing; expected {wanted}")
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    if fits and kind in (int, float):
        fits = low <= value <= high  # False for nan
    if not fits or (among and value not in among):
        raise ParameterError(f"parameter {name}: expected {wanted}, got {str(value)[:60]!r}")
    return cast(T, value)


def checked_numbers(name: str, value: Any, length: int = 0) -> list[float]:
    """``value`` if it is a list of finite numbers of this length (0: any). Otherwise raises ParameterError."""
    good = isinstance(value, (list, tuple)) and all(
        isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in value
    )
    if not good or (length and len(value) != length):
        raise ParameterError(
            f"parameter {name}: expected a list of {f'{length} ' if length else ''}finite numbers, "
            f"got {str(value)[:60]!r}"
        )
    return [float(v) for v in value]


def _wanted(kind: type, low: float, high: float, among: Sequence[str]) -> str:
    if among:
        return f"one of {', '.join(among)}"
    words = {bool: "true or false", int: "a whole number", float: "a number", str: "a text", dict: "a mapping"}[kind]
    if math.isinf(low) and math.isinf(high):
        return words
    return f"{words} in {low:g}..{high:g}"
