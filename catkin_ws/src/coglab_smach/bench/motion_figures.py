"""Figures of a motion as it truly was: when it begins, how straight it is, how often it hesitates. Arrays alone."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, find_peaks, sosfiltfilt

MOVES = 0.02
"""m/s above which a hand moves"""
KEPT = 0.10
"""s for which it has to move, or to stand, to count"""
CUT = 10.0
"""Hz, low-pass of a speed before its peaks are counted"""
PROMINENCE = 0.10
"""share of the largest speed by which a peak has to stand out"""


def _kept(where: np.ndarray, number: int) -> int | None:
    """The first index from which so many samples in a row are true; None where there are none."""
    run = 0
    for index, true in enumerate(where):
        run = run + 1 if true else 0
        if run >= number:
            return index - number + 1
    return None


def onset(speed: np.ndarray, rate: float) -> int | None:
    """Index at which a hand with these speeds (m/s, ``rate`` Hz) begins to move; None: it does not."""
    return _kept(np.asarray(speed) > MOVES, round(KEPT * rate))


def rest(speed: np.ndarray, rate: float) -> int | None:
    """Index from which it stands; None: never."""
    return _kept(np.asarray(speed) <= MOVES, round(KEPT * rate))


def along(path: np.ndarray) -> np.ndarray:
    """m, of each place (n, 3) along the straight line from the first to the last one; zero where these are the same."""
    way = path[-1] - path[0]
    length = float(np.linalg.norm(way))
    return (path - path[0]) @ way / length if length > 1e-9 else np.zeros(len(path))


def wrong_way(progress: np.ndarray) -> float:
    """m, the farthest that a hand is behind where it had already been, of its progress along a line."""
    return float(np.max(np.maximum.accumulate(progress) - progress))


def detour(path: np.ndarray) -> float:
    """Length of a path (n, 3) over the straight line from its first to its last place; infinite for a closed one."""
    straight = float(np.linalg.norm(path[-1] - path[0]))
    length = float(np.sum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    return length / straight if straight > 0.0 else float("inf")


def peaks(speed: np.ndarray, rate: float) -> int:
    """How many maxima a speed (m/s, ``rate`` Hz) has, of a hand that stands before and after it."""
    still = np.zeros(round(0.5 * rate))
    smooth = sosfiltfilt(butter(2, CUT, fs=rate, output="sos"), np.concatenate([still, speed, still]))
    return len(find_peaks(smooth, prominence=PROMINENCE * float(smooth.max()))[0])
