"""Smooths a recorded motion, which also bridges its gaps, and cuts the reaches out of it.

Smoothing is a cubic smoothing spline with a cut-off of 6 Hz and no delay: people's reaches end below 5 Hz, a tracker's
noise does not. Onset and end come from the speed, with two thresholds: a motion counts as a reach above
the higher one, and lasts from leaving the lower one until returning to it. Two motions without a rest between them, as
in a handover, are cut at the slowest point.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from coglab_tools.command import CheckFailed
from coglab_tools.dmp.demonstration import Array, Demonstration

CUT_OFF = 6.0  # Hz; usual for motions of the arm (Winter, Biomechanics and Motor Control of Human Movement)
SHORTEST = 0.1  # m, farthest point of a reach from its start
NOTED_GAP = 0.05  # s without a sample, mentioned in a note
LONGEST_GAP = 0.2  # s without a sample within a reach
FASTEST = 5.0  # m/s between two samples; above it the tracker confused the hand with something else
LARGEST_STEP = 0.5  # share of a reach between two samples without a gap; above it the tracker lost the hand
LOW = 0.02  # m/s; a slower hand rests
LOW_SHARE = 0.05  # share of the peak speed of a motion; a slower hand rests too
HIGH_SHARE = 0.25  # share of the largest speed that a motion must reach
PAUSE_SHARE = 0.35  # slowest point between two motions, share of the smaller of their peaks
MOVING_SHARE = 0.5  # of the mean speed: a reach that is faster at its first or last sample is incomplete
BACK = -0.5  # largest cosine between a way back and the reach before it
BACK_SHARE = 1.2  # longest way back, share of the length of the reach before it


def smooth(raw: Demonstration) -> Demonstration:
    """The motion without noise, at its own rate, without gaps. `noise`: the removed part."""
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


def reaches(raw: Demonstration, back: bool = False, cut_off: bool = False) -> list[Demonstration]:
    """The reaches of a recording, in order, smoothed and each from time 0; motions back too if `back`, and
    incomplete reaches at the ends of the recording if `cut_off`.

    A reach with a gap or a jump is left out, with a note. CheckFailed if there is no other one.
    """
    whole = smooth(raw)
    found: list[Demonstration] = []
    farthest = 0.0
    before: Array | None = None  # m, (3,): from start to end of the last reach
    lost = ""
    faults: list[str] = []
    for begin, end in motions(whole.times, whole.speed):
        part = _part(whole, begin, end)
        farthest = max(farthest, part.way)
        if part.way < SHORTEST:
            continue
        line = part.positions[-1] - part.positions[0]
        way = float(np.linalg.norm(line))
        if not back and before is not None and _goes_back(line, before):
            found[-1:] = [replace(each, notes=(*each.notes, "the way back was left out")) for each in found[-1:]]
            before = None
            continue
        before = line
        speed, mean = part.speed, part.way / max(part.duration, 1e-9)
        for at, edge, word in ((0, begin == 0, "begins"), (-1, end == len(whole.times) - 1, "ends")):
            if edge and speed[at] > MOVING_SHARE * mean and not cut_off:
                lost = f"the recording {word} within it, while the hand moves at {speed[at]:.2f} m/s"
        if lost and (begin == 0 or end == len(whole.times) - 1):
            continue
        try:
            gap = _refuse_gap(raw, whole.times[begin], whole.times[end])
            _refuse_jump(raw, whole.times[begin], whole.times[end], way)
        except CheckFailed as error:
            faults.append(str(error))
            continue
        if gap > NOTED_GAP:
            part = replace(part, notes=(*part.notes, f"a gap of {gap:.2f} s was bridged"))
        found.append(part)
    if not found and faults:
        raise CheckFailed(faults[0])
    if not found and lost:
        raise CheckFailed(f"{raw.name}: no whole reach in it: {lost}; record it again, or allow 'moving' in train")
    if not found:
        raise CheckFailed(
            f"{raw.name}: no reach in it: the longest motion goes {farthest:.3f} m, a reach at least {SHORTEST:g} m. "
            "Is it the right frame? A reach begins and ends slowly"
        )
    left_out = tuple(f"a reach was left out: {fault.removeprefix(f'{raw.name}: ')}" for fault in faults)
    found[0] = replace(found[0], notes=(*found[0].notes, *left_out))
    if len(found) == 1:
        return found
    return [replace(part, name=f"{raw.name}_{i + 1}") for i, part in enumerate(found)]


def motions(times: Array, speed: Array) -> list[tuple[int, int]]:
    """First and last index of each motion, from the speed (m/s)."""
    high = max(2.0 * LOW, HIGH_SHARE * float(speed.max()))
    around = np.pad(speed, 1)
    tops = (speed >= around[:-2]) & (speed > around[2:]) & (speed >= high)
    peaks: list[int] = []  # the fastest point of each motion
    valleys: list[int] = []  # the slowest point between two motions
    for i in np.flatnonzero(tops).tolist():
        if not peaks:
            peaks.append(i)
            continue
        valley = peaks[-1] + int(np.argmin(speed[peaks[-1] : i]))
        if speed[valley] <= max(LOW, PAUSE_SHARE * min(speed[peaks[-1]], speed[i])):
            peaks.append(i)
            valleys.append(valley)
        elif speed[i] > speed[peaks[-1]]:
            peaks[-1] = i
    if not peaks:
        return []
    bounds = [0, *valleys, len(speed) - 1]
    found = []
    for peak, first, last in zip(peaks, bounds[:-1], bounds[1:], strict=True):
        rests = speed <= max(LOW, LOW_SHARE * speed[peak])
        before, after = np.flatnonzero(rests[first:peak]), np.flatnonzero(rests[peak:last])
        found.append((first + int(before[-1]) if len(before) else first, peak + int(after[0]) if len(after) else last))
    return found


def _goes_back(line: Array, before: Array) -> bool:
    """True if a motion by `line` goes back, at least partly, after a reach by `before`; (3,) m."""
    a, b = float(np.linalg.norm(line)), float(np.linalg.norm(before))
    return bool(line @ before < BACK * a * b and a < BACK_SHARE * b)


def _part(whole: Demonstration, begin: int, end: int) -> Demonstration:
    part = slice(begin, end + 1)
    t = whole.times[part]
    note = f"reach from {t[0]:.2f} s to {t[-1]:.2f} s of the recording"
    return replace(
        whole,
        times=t - t[0],
        begin=float(t[0]),
        positions=whole.positions[part],
        orientations=None if whole.orientations is None else whole.orientations[part],
        closing=None if whole.closing is None else whole.closing[part],
        notes=(*whole.notes, note),
    )


def _refuse_gap(raw: Demonstration, begin: float, end: float) -> float:
    """The longest time between two samples within a reach, s. CheckFailed: it cannot be bridged."""
    t = raw.times
    inside = np.flatnonzero((t[1:] > begin) & (t[:-1] < end))
    if len(inside) == 0:
        return 0.0
    gaps = np.diff(t)[inside]
    worst = int(np.argmax(gaps))
    if gaps[worst] > LONGEST_GAP:
        raise CheckFailed(
            f"{raw.name}: a gap of {gaps[worst]:.2f} s at {t[inside[worst]]:.2f} s, within a reach; at most "
            f"{LONGEST_GAP:g} s can be bridged: record it again, or cut the file"
        )
    return float(gaps[worst])


def _refuse_jump(raw: Demonstration, begin: float, end: float, way: float) -> None:
    t = raw.times
    steps = np.linalg.norm(np.diff(raw.positions, axis=0), axis=1)
    steps[(t[1:] < begin) | (t[:-1] > end) | (np.diff(t) > 2.0 * float(np.median(np.diff(t))))] = 0.0
    worst = int(np.argmax(steps))
    if steps[worst] > min(LARGEST_STEP * way, FASTEST * (t[worst + 1] - t[worst])):
        raise CheckFailed(
            f"{raw.name}: the hand jumps by {steps[worst]:.2f} m at {t[worst + 1]:.2f} s, from one sample to the next: "
            "the tracker confused it with something else; cut the file there, or record again"
        )
