"""The interval of the median over FRI covers what it says: ranks by the exact binomial, never fewer than 95 %."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_fri


def coverage(n: int, low: int, high: int) -> float:
    """Probability that the median lies between two order statistics, ranks from 1: `low` to `high` - 1 values are
    below it."""
    return sum(math.comb(n, k) for k in range(low, high)) / 2**n


def ranks(n: int) -> tuple[int, int]:
    """Of the ends of the interval of n values that are their own ranks."""
    low, high = bench_fri.median_interval([float(n - i) for i in range(n)])
    return int(low), int(high)


def test_of_eighty_ratios():
    assert ranks(80) == (31, 50)
    assert coverage(80, 32, 49) < 0.95 < coverage(80, 31, 50)


@pytest.mark.parametrize("n", range(6, 200))
def test_it_covers_at_least_95_percent_and_is_the_narrowest_that_does(n):
    low, high = ranks(n)
    assert low + high == n + 1 and coverage(n, low, high) >= 0.95
    assert coverage(n, low + 1, high - 1) < 0.95


def test_of_few_values_it_is_all_of_them():
    assert [ranks(n) for n in (1, 2, 5)] == [(1, 1), (1, 2), (1, 5)]
