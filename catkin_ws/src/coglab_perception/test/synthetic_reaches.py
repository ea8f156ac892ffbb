"""Synthetic reaches of four patterns for tests, bench and the sample pattern file: minimum jerk with human scatter.

Self-contained: the recogniser must not depend on the simulator that it is tried with.
"""

import numpy as np

START = np.array([1.30, 0.20, 0.15])
ENDS = {
    "centre": (0.86, 0.03, 0.44),
    "high": (0.86, 0.05, 0.66),
    "left": (0.90, -0.28, 0.42),
    "right": (0.92, 0.42, 0.40),
}
START_DEVIATION, END_DEVIATION = 0.02, (0.03, 0.035, 0.03)
"""m, standard deviations per axis of where a reach begins and ends"""
MIDDLE = 11.345
"""chi square of three degrees of freedom that 99 % do not exceed"""


def share(x):
    """Share of the way at share x of the duration (Flash and Hogan's polynomial)."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def path(stamps, start, end, begin, duration, vertical_share, bow):
    """Positions (T, 3): the vertical part a little quicker, and an arc of an ellipse upward."""
    s = share((stamps - begin) / duration)
    sz = share((stamps - begin) / (duration * vertical_share))
    places = start + (end - start) * np.column_stack([s, s, sz])
    places[:, 2] += bow * np.sin(np.pi * s)
    return places


def reach(name, rng, noise=0.004, rate=30.0, rest=0.6, hold=0.4):
    """One noisy recording: (stamps, positions, onset time, duration)."""
    start = START + rng.normal(0, START_DEVIATION, 3)
    end = np.array(ENDS[name]) + rng.normal(0, 1, 3) * END_DEVIATION
    distance = float(np.linalg.norm(end - start))
    duration = 1.1 * max(0.3, (distance / 0.45) ** 0.3) * float(np.exp(rng.normal(0, 0.15)))
    vertical_share, bow = float(rng.uniform(0.8, 0.95)), float(rng.normal(0, 0.015))
    stamps = np.arange(0.0, rest + duration + hold, 1.0 / rate) + rng.normal(0, 0.002)
    positions = path(stamps, start, end, rest, duration, vertical_share, bow)
    return stamps, positions + rng.normal(0, noise, (len(stamps), 3)), rest, duration


def pattern_of(way):
    """Of a motion with this displacement (3), m: the pattern in whose middle 99 % of displacements it lies, the nearest
    of several; empty if there is none."""
    deviation = np.hypot(START_DEVIATION, END_DEVIATION)
    off = {name: float(np.sum(((way - (np.array(end) - START)) / deviation) ** 2)) for name, end in ENDS.items()}
    name = min(off, key=off.get)
    return name if off[name] <= MIDDLE else ""


def demonstrations(n, seed, **kw):
    """n recordings per pattern: {name: [(stamps, positions), ...]}."""
    rng = np.random.default_rng(seed)
    return {name: [reach(name, rng, **kw)[:2] for _ in range(n)] for name in ENDS}
