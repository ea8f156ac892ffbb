"""Smooths a recorded motion, which also bridges its gaps, and cuts the reaches out of it.

Smoothing is a cubic smoothing spline with a cut-off of 8 Hz and no delay: people's reaches end below 5 Hz, a tracker's
noise does not. Onset and end come from the speed, with two thresholds: a reach begins to count at the higher one, and
goes from where the speed left the lower one to where it comes back to it. A hand that never rests between two motions,
as in a handover, is cut where it is slowest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from coglab_tools.command import CheckFailed
from coglab_tools.dmp.demonstration import Array, Demonstration

CUT_OFF = 8.0  # Hz
SHORTEST = 0.1  # m, farthest point of a reach from its start
LONGEST_GAP = 0.2  # s without a sample within a reach
LOW, LOW_SHARE = 0.02, 0.05  # m/s, and share of the peak speed: below the larger one the hand rests
HIGH_SHARE = 0.25  # share of the largest speed that a motion must reach
PAUSE_SHARE = 0.35  # slowest point between two motions, share of the smaller of their peaks
BACK_SHARE = 0.35  # a motion that ends this near to where the last one began, share of the way, is a way back


def smooth(raw: Demonstration) -> Demonstration:
    """The motion without noise, at its own rate, without gaps. `noise` is what was taken away."""
    from scipy.interpolate import make_smoothing_spline
    from scipy.spatial.transform import Rotation

    t = raw.times
    step = float(np.median(np.diff(t)))
    if not 0.001 <= step <= 0.1:
        raise CheckFailed(f"{raw.name}: a sample every {step:.4g} s; expected 10 to 1000 samples per second")
    # A smoothing spline passes the share 1 / (1 + lam / rate * omega^4) of a frequency; at the cut-off a half.
    lam = 1.0 / (step * (2.0 * np.pi * CUT_OFF) ** 4)
    grid = np.append(np.arange(t[0], t[-1], step), t[-1])

    def line(values: Array) -> tuple[Array, Array]:
        """Smoothed values on the grid, and at the samples."""
        splines = [make_smoothing_spline(t, column, lam=lam) for column in values.T]
        return np.column_stack([s(grid) for s in splines]), np.column_stack([s(t) for s in splines])

    positions, at_samples = line(raw.positions)
    turns = None
    if raw.orientations is not None:
        q, _ = line(raw.orientations)  # their signs are continuous, so that they can be smoothed as numbers
        turns = Rotation.from_quat(q).as_quat()
        turns *= np.where(np.sum(turns * q, axis=1) < 0.0, -1.0, 1.0)[:, None]
    closing = None if raw.closing is None else np.interp(grid, t, raw.closing)
    noise = float(np.sqrt(np.mean((raw.positions - at_samples) ** 2)))
    return replace(raw, times=grid, positions=positions, orientations=turns, closing=closing, noise=noise)


def reaches(raw: Demonstration, back: bool = False) -> list[Demonstration]:
    """The reaches of a recording, in order, smoothed and each from time 0; ways back too if `back`.

    CheckFailed if there is none, or if a gap lies in one.
    """
    whole = smooth(raw)
    found: list[Demonstration] = []
    farthest = 0.0
    origin: Array | None = None
    for begin, end in motions(whole.times, whole.speed):
        part = _part(whole, begin, end)
        farthest = max(farthest, part.way)
        if part.way < SHORTEST:
            continue
        way = float(np.linalg.norm(part.positions[-1] - part.positions[0]))
        returns = origin is not None and np.linalg.norm(part.positions[-1] - origin) < BACK_SHARE * way
        if returns and not back:
            origin = None
            continue
        origin = part.positions[0]
        _refuse_gap(raw, whole.times[begin], whole.times[end])
        found.append(part)
    if not found:
        raise CheckFailed(
            f"{raw.name}: no reach in it: the longest motion goes {farthest:.3f} m, a reach at least {SHORTEST:g} m. "
            "Is it the right frame? A reach begins and ends slowly"
        )
    if len(found) == 1:
        return found
    return [replace(part, name=f"{raw.name}_{i + 1}") for i, part in enumerate(found)]


def motions(times: Array, speed: Array) -> list[tuple[int, int]]:
    """First and last index of each motion, from the speed (m/s)."""
    high = max(2.0 * LOW, HIGH_SHARE * float(speed.max()))
    found: list[tuple[int, int]] = []
    i, last = 0, len(speed) - 1
    while i <= last:
        if speed[i] < high:
            i += 1
            continue
        peak, end = i, i
        while end < last and not _pauses(speed, end, speed[peak]):
            end += 1
            peak = end if speed[end] > speed[peak] else peak
        begin, floor = peak, (found[-1][1] if found else 0)
        while begin > floor and not _pauses(speed, begin, speed[peak]):
            begin -= 1
        found.append((begin, end))
        i = end + 1
    return found


def _pauses(speed: Array, i: int, peak: float) -> bool:
    """Whether the hand rests at i, or is slowest there between two motions."""
    if speed[i] <= max(LOW, LOW_SHARE * peak):
        return True
    around = speed[max(0, i - 3) : i + 4]
    return bool(speed[i] <= PAUSE_SHARE * peak and speed[i] == around.min() and 3 <= i < len(speed) - 3)


def _part(whole: Demonstration, begin: int, end: int) -> Demonstration:
    part = slice(begin, end + 1)
    t = whole.times[part]
    note = f"reach from {t[0]:.2f} s to {t[-1]:.2f} s of the recording"
    return replace(
        whole,
        times=t - t[0],
        positions=whole.positions[part],
        orientations=None if whole.orientations is None else whole.orientations[part],
        closing=None if whole.closing is None else whole.closing[part],
        notes=(*whole.notes, note),
    )


def _refuse_gap(raw: Demonstration, begin: float, end: float) -> None:
    t = raw.times
    inside = np.flatnonzero((t[1:] > begin) & (t[:-1] < end))
    if len(inside) == 0:
        return
    gaps = np.diff(t)[inside]
    worst = int(np.argmax(gaps))
    if gaps[worst] > LONGEST_GAP:
        raise CheckFailed(
            f"{raw.name}: a gap of {gaps[worst]:.2f} s at {t[inside[worst]]:.2f} s, within a reach; at most "
            f"{LONGEST_GAP:g} s can be bridged: record it again, or cut the file"
        )
