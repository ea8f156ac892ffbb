"""Statistics of a study's report: Wilson interval of a rate, paired comparison of two conditions with effect size.

Conditions are compared by participants: the mean of each participant under each condition is one value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

LEVEL = 0.95


@dataclass(frozen=True)
class Comparison:
    """Paired difference b - a over participants. NaN where there are too few participants, or no scatter."""

    pairs: int
    difference: float
    """mean of b - a"""
    low: float
    high: float
    """95 % interval of the difference (t)"""
    effect: float
    """Hedges' g of the paired differences: d_z = mean / standard deviation, times 1 - 3 / (4 df - 1)"""
    effect_low: float
    effect_high: float
    """95 % interval of the effect, from the noncentral t distribution"""
    p: float
    """two-sided paired t test"""


def wilson(successes: int, trials: int, level: float = LEVEL) -> tuple[float, float]:
    """Wilson score interval of a rate (E. B. Wilson, J. Am. Stat. Assoc., 1927); (0, 1) without trials."""
    from scipy.stats import norm

    if trials == 0:
        return 0.0, 1.0
    z = float(norm.ppf(0.5 + level / 2))
    rate = successes / trials
    middle = (rate + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(rate * (1 - rate) / trials + z * z / (4 * trials * trials))
    return max(0.0, middle - half), min(1.0, middle + half)


def compare(a: Sequence[float], b: Sequence[float], level: float = LEVEL) -> Comparison:
    """Compare two conditions; ``a`` and ``b`` have one value per participant, in the same order. Participants with a
    NaN are left out. Effect size and its interval: D. Lakens, Frontiers in Psychology 4, 2013 (d_z); G. Cumming,
    S. Finch, Educational and Psychological Measurement 61, 2001 (noncentral t)."""
    from scipy.stats import t

    change = np.asarray(b, dtype=float) - np.asarray(a, dtype=float)
    change = change[np.isfinite(change)]
    n, nan = len(change), math.nan
    mean = float(change.mean()) if n else nan
    scatter = float(change.std(ddof=1)) if n > 1 else nan
    if n < 2 or not scatter > 1e-12 * max(1.0, abs(mean)):
        return Comparison(n, mean, nan, nan, nan, nan, nan, nan)
    df, error = n - 1, scatter / math.sqrt(n)
    half = float(t.ppf(0.5 + level / 2, df)) * error
    statistic = mean / error
    # With two participants the correction is 0, and the effect has no unbiased estimate.
    correction = 1 - 3 / (4 * df - 1) if df > 1 else nan
    low, high = (correction * value / math.sqrt(n) for value in _noncentral(statistic, df, level))
    p = float(2 * t.sf(abs(statistic), df))
    return Comparison(n, mean, mean - half, mean + half, correction * mean / scatter, low, high, p)


def _noncentral(statistic: float, df: int, level: float) -> tuple[float, float]:
    """Interval of the noncentrality of a t statistic."""
    from scipy.optimize import brentq
    from scipy.stats import nct

    width = 8.0 + 2.0 * abs(statistic)

    def below(c: float) -> float:
        with np.errstate(all="ignore"):
            value = float(nct.cdf(statistic, df, c))
        return value if math.isfinite(value) else float(c < statistic)  # scipy returns NaN far out, instead of 1 or 0

    def at(share: float) -> float:
        return float(brentq(lambda c: below(c) - share, statistic - width, statistic + width))

    return at(0.5 + level / 2), at(0.5 - level / 2)


def holm(p: Sequence[float]) -> list[float]:
    """p values corrected for their number (S. Holm, 1979); NaN stays NaN and does not count."""
    order = sorted((i for i in range(len(p)) if math.isfinite(p[i])), key=lambda i: p[i])
    corrected = [math.nan] * len(p)
    largest = 0.0
    for place, index in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - place) * p[index]))
        corrected[index] = largest
    return corrected
