"""Statistics of the report against published and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from coglab_tools.study.statistics import compare, holm, wilson


def test_wilson_intervals():
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)  # R. G. Newcombe, 1998, table I
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_paired_comparison():
    a, b = np.array([1.0, 2.0, 3.0, 4.0, np.nan]), np.array([2.0, 4.0, 3.0, 7.0, 1.0])
    found = compare(a, b)  # differences 1, 2, 0, 3
    assert (found.pairs, found.difference) == (4, 1.5)
    d = 1.5 / np.std([1, 2, 0, 3], ddof=1)
    assert found.effect == pytest.approx(d * (1 - 3 / 11))
    assert found.p == pytest.approx(0.1027, abs=1e-4)
    assert found.low < 0.0 < found.high and found.effect_low < 0.0 < found.effect < found.effect_high


def test_the_interval_of_the_effect_covers_the_true_one():
    chance = np.random.default_rng(4)
    inside = 0
    for _ in range(100):
        found = compare(np.zeros(12), chance.normal(0.8, 1.0, 12))
        correction = 1 - 3 / (4 * 11 - 1)
        inside += found.effect_low <= 0.8 * correction <= found.effect_high
    assert 89 <= inside <= 100


@pytest.mark.parametrize("shift", [0.01, 1.0, 4.0, 50.0])
def test_interval_of_the_effect_has_two_ends_in_both_directions(shift):
    scatter = np.array([-1.2, 0.4, 0.9, -0.3, 0.1, 0.6])
    up, down = compare(scatter * 0, scatter + shift), compare(scatter * 0, -scatter - shift)
    assert (up.effect_low, up.effect_high) == pytest.approx((-down.effect_high, -down.effect_low), rel=1e-6)
    assert up.effect_low < up.effect < up.effect_high


def test_no_scatter_and_no_pairs_give_no_effect():
    assert np.isnan(compare([1.0, 1.0], [2.0, 2.0]).effect) and compare([], []).pairs == 0


def test_two_participants_have_a_difference_and_no_effect():
    found = compare([1.0, 2.0], [2.0, 5.0])
    assert found.low < 2.0 < found.high and np.isnan([found.effect, found.effect_low, found.effect_high]).all()


def test_holm():
    assert holm([0.01, 0.04, float("nan"), 0.03])[:2] == pytest.approx([0.03, 0.06])
