"""Figures of a recorded reach: how late it is compared with a person's, how smooth, how far off at its end."""

from __future__ import annotations

import numpy as np

HUMAN_BASE = 1.1
"""s, a person's reach over 0.45 m (coglab_sim.person.participant.Participant.reach_time)"""
NEAR = 0.005
"""m: the hand has arrived when it stays this close to the goal in use"""


def human_time(way: float) -> float:
    """Duration (s) of a person's reach over ``way`` m, as coglab_sim.person.reach.duration_for has it."""
    return HUMAN_BASE * max(0.3, (max(way, 1e-3) / 0.45) ** 0.3)


def sparc(speed, rate: float, cut: float = 10.0, amplitude: float = 0.05) -> float:
    """Spectral arc length of a speed profile (Balasubramanian et al.), 10 Hz, amplitude threshold 0.05; 0 is
    smoothest."""
    n = int(2 ** (np.ceil(np.log2(len(speed))) + 4))
    f = np.arange(n) * rate / n
    spectrum = np.abs(np.fft.fft(speed, n))
    spectrum = spectrum / spectrum.max()
    keep = f <= cut
    f, spectrum = f[keep], spectrum[keep]
    above = np.flatnonzero(spectrum >= amplitude)
    f, spectrum = f[above[0] : above[-1] + 1], spectrum[above[0] : above[-1] + 1]
    return -float(np.sum(np.sqrt((np.diff(f) / (f[-1] - f[0])) ** 2 + np.diff(spectrum) ** 2)))


def figures(reach) -> dict[str, float]:
    """Of one ReachRecord that has ended: whether it ``stood`` still or was ``met``; mm and deg from palm to goal,
    newest sight and truth where it stood, else at its end; those of its way, unless it was shorter than 20 cycles."""
    out: dict[str, float] = {"stood": reach.stood, "met": reach.met}
    for name in ("goal", "sight", "truth"):
        if getattr(reach, f"to_{name}") is not None:
            metres, angle = getattr(reach, f"to_{name}")
            out[f"{name}_mm"], out[f"{name}_deg"] = 1000.0 * metres, float(np.degrees(angle))
    return out | (way(reach) if len(reach.path) >= 20 else {})


def way(reach) -> dict[str, float]:
    """``sparc``; and, unless the reach is unfinished, ``late`` and ``reached_late`` (s after a person's arrival: there,
    and told so) and ``reached`` (s). One that was met is told so when it was met. One whose palm was farther than NEAR
    from its goal then, or as it stood, is never there: it has no ``late``. ``met_late``: ``late`` of those that stood,
    and of those that were met, wherever that was, when it was."""
    times = np.array([t for t, _, _ in reach.path])
    palm = np.array([p for _, p, _ in reach.path])
    goal = np.array([g for _, _, g in reach.path])
    told = reach.reached if reach.stood else reach.over if reach.met else None
    inside = times <= (times[-1] if told is None else told)
    speed = np.linalg.norm(np.diff(palm[inside], axis=0), axis=1) / np.diff(times[inside])
    out = {"sparc": sparc(speed, 1.0 / float(np.median(np.diff(times))))}
    if told is None:
        return out
    far = np.flatnonzero(np.linalg.norm(palm[inside] - goal[inside], axis=1) > NEAR)
    human = human_time(float(np.linalg.norm(palm[inside][-1] - palm[0])))
    out |= {"reached_late": told - times[0] - human, "reached": told - reach.begin}
    if not reach.stood:
        out["met_late"] = out["reached_late"]
    if len(far) and far[-1] == np.count_nonzero(inside) - 1:
        return out
    late = (float(times[far[-1]]) if len(far) else reach.begin) - times[0] - human
    return {"met_late": late} | out | {"late": late}
