"""Which primitives are valid: each documented range at both ends and just beyond."""

from __future__ import annotations

import math
from collections.abc import Callable

import coglab_controllers as cc
import numpy as np
import pytest


def beyond(value: float, away: float) -> float:
    """A little outside of an end of a range."""
    return value + math.copysign(max(1e-9, 1e-6 * abs(value)), away)


def check_range(build: Callable[[float], object], least: float, most: float, words: str) -> None:
    """Both ends are taken; what is beyond them, and what is no number, is refused with these words."""
    outside = [beyond(end, away) for end, away in ((least, -1.0), (most, 1.0)) if math.isfinite(end)]
    for end in (least, most):
        build(end)
    for value in (*outside, math.nan):
        with pytest.raises(ValueError) as refusal:
            build(value)
        assert words in str(refusal.value), (value, str(refusal.value))


def primitive(**fields: object) -> cc.Primitive:
    """A valid primitive of three basis functions, changed as told."""
    made = cc.Primitive()
    made.id, made.centres, made.widths = "p", [1.0, 0.5, 0.1], [4.0, 4.0, 4.0]
    made.weights, made.goal = np.zeros((3, 3)), [0.5, 0.0, 0.0]
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def with_entry(size: tuple[int, ...], place: tuple[int, ...], fill: float = 0.0) -> Callable[[float], np.ndarray]:
    """Arrays with a value at one place."""

    def build(value: float) -> np.ndarray:
        array = np.full(size, fill)
        array[place] = value
        return array

    return build


@pytest.mark.parametrize(
    "field, least, most",
    [("duration", 0.05, 600), ("alpha", 0.5, 50), ("stiffness", 1, 1e5), ("damping", 0.1, 1e4)],
)
def test_a_system_has_numbers_in_their_ranges(field: str, least: float, most: float) -> None:
    words = f"{field}: expected a number from {least:g} to {most:g}"
    words = words.replace("1e+05", "100000")
    check_range(lambda value: primitive(**{field: value}).validate(), least, most, words)


@pytest.mark.parametrize("function", [0, 1, 2])
def test_basis_functions_are_placed_in_the_phase(function: int) -> None:
    centres, widths = with_entry((3,), (function,), 0.5), with_entry((3,), (function,), 4.0)
    check_range(lambda v: primitive(centres=centres(v)).validate(), 0.0, 1.0, f"basis[{function}].centre")
    made = [1e-6, 1e14]
    for width in made:
        primitive(widths=widths(width)).validate()
    for width in (0.9e-6, 1.1e14, math.nan):
        with pytest.raises(ValueError, match=rf"basis\[{function}\].width"):
            primitive(widths=widths(width)).validate()


def test_a_sigmoid_has_its_place_and_steepness_in_range_and_a_linear_weight_needs_none() -> None:
    weight = cc.GoalWeight
    check_range(lambda v: primitive(goal_weight=weight("sigmoid", v, 5.0)).validate(), 0.0, 1.0, "goal_weight.centre")
    steep = "goal_weight.steepness: expected a number from 1 to 100"
    check_range(lambda v: primitive(goal_weight=weight("sigmoid", 0.5, v)).validate(), 1.0, 100.0, steep)
    primitive(goal_weight=weight("linear", 7.0, 500.0)).validate()
    steepness, centre = 8.0, 0.3
    logistic = lambda s: 1.0 / (1.0 + np.exp(steepness * (s - centre)))  # noqa: E731
    for s in (0.0, 0.2, 0.5, 0.9, 1.0):
        expected = (logistic(s) - logistic(1.0)) / (logistic(0.0) - logistic(1.0))
        assert weight("sigmoid", centre, steepness)(s) == pytest.approx(expected, abs=1e-12)
        assert weight()(s) == 1.0 - s
