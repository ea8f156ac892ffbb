"""Figures of one handover, from a recorded bag or a trial in virtual time. DEFINITIONS says what each means.

Sources: G. Hoffman, "Evaluating Fluency in Human-Robot Collaboration", IEEE Transactions on Human-Machine Systems
49(3), 2019 (fluency); S. Balasubramanian et al., "On the analysis of movement smoothness", Journal of NeuroEngineering
and Rehabilitation 12:112, 2015 (SPARC).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from coglab.fluency import active_intervals, fluency_of
from coglab.series import Series

if TYPE_CHECKING:
    from coglab.trial import Trial

DEFINITIONS = {
    "duration_s": "s from the start of the action to its result",
    "offer_to_contact_s": "s from the offer, or the request, as the robot noticed it to the contact",
    "contact_to_release_s": "s from the contact to the moment at which the object changed hands",
    "human_idle": "share of the duration in which the person's hand is slower than 0.05 m/s (Hoffman 2019, H-IDLE)",
    "robot_idle": "share in which palm (0.05 m/s) and fingers (20 of 254 per s) do not move (Hoffman 2019, R-IDLE)",
    "concurrent_activity": "share of the duration in which both move (Hoffman 2019, C-ACT)",
    "functional_delay": "s between the end of one's activity and the start of the other's, summed over the turns, as a "
    "share of the duration; negative where they overlap (Hoffman 2019, F-DEL)",
    "peak_force_n": "N, largest force on palm and fingers of the robot; from the simulation's truth alone",
    "palm_peak_speed_m_s": "m/s, largest speed of the palm",
    "palm_sparc": "spectral arc length of the palm's speed from the start of the reach to its end or the contact: "
    "smoother is nearer to zero (Balasubramanian 2015)",
    "person_sparc": "the same of the person's hand in its longest movement",
    "detection_delay_s": "s from the first true touch (0.3 N) to the contact event; from the simulation's truth alone",
}
"""name of each figure, with its unit as the ending where it has one, and its definition"""

PERSON_SPEED, PALM_SPEED, FINGER_SPEED = 0.05, 0.05, 20.0  # m/s, m/s, counts/s: from which one counts as active
TOUCH = 0.3  # N
RATE = 100.0  # Hz, of the even grid on which paths are differentiated


def metrics_of(series: Series, start: float, end: float, marks: Mapping[str, float]) -> dict[str, float]:
    """The figures between ``start`` and ``end`` (s, as in the series). ``marks``: times of events, s since the start.
    A figure without its data is not there."""
    found = {"duration_s": end - start}
    told = [marks[name] for name in ("offered", "requested", "motion_started") if name in marks]
    contact = marks.get("contact")
    if told and contact is not None:
        found["offer_to_contact_s"] = contact - told[0]
    if contact is not None and "released" in marks:
        found["contact_to_release_s"] = marks["released"] - contact
    rows = [row for row in series.truth if start <= row[0] <= end]
    if len(rows) > 10:
        grid = np.arange(rows[0][0], rows[-1][0], 1.0 / RATE)
        palm, person = (speed_on(grid, rows, column) for column in (1, 2))
        robot = active_intervals(grid, (palm > PALM_SPEED) | _fingers_move(series.fingers, grid))
        fluency = fluency_of(active_intervals(grid, person > PERSON_SPEED), robot, start, end)
        found["human_idle"], found["robot_idle"] = fluency.human_idle, fluency.robot_idle
        found["concurrent_activity"] = fluency.concurrent_activity
        found["functional_delay"] = fluency.functional_delay
        found["palm_peak_speed_m_s"] = float(palm.max())
        if "motion_started" in marks:
            reach = start + marks["motion_started"]
            ends = [start + marks[name] for name in ("motion_reached", "contact") if name in marks]
            found["palm_sparc"] = _sparc_of(palm, grid, reach, min((t for t in ends if t > reach), default=end))
        moves = active_intervals(grid, person > PERSON_SPEED)
        if moves:
            found["person_sparc"] = _sparc_of(person, grid, *max(moves, key=lambda each: each[1] - each[0]))
        forces = np.array([row[4] for row in rows], dtype=float)
        if np.isfinite(forces).all():
            found["peak_force_n"] = float(forces.max())
            touched = [row[0] for row, force in zip(rows, forces, strict=True) if force > TOUCH]
            events = [row[0] for row in series.contacts if row[1] and start <= row[0] <= end]
            if touched and events:
                found["detection_delay_s"] = events[0] - touched[0]
    return {name: float(value) for name, value in found.items() if np.isfinite(value)}


def metrics_of_trial(trial: Trial) -> dict[str, float]:
    """The figures of the first action of a trial in virtual time."""
    action = trial.results[0]
    marks = {name: t - action.started for name, t in action.marks.items()}
    return metrics_of(trial.series(), action.started, action.ended, marks)


def _sparc_of(speed: np.ndarray, grid: np.ndarray, start: float, end: float) -> float:
    return sparc(speed[(grid >= start) & (grid <= end)], RATE)


def speed_on(grid: np.ndarray, rows: Sequence[tuple[Any, ...]], column: int) -> np.ndarray:
    """Speed (m/s) on an even grid of times (s), from rows with a time and a point (m) in this column. The path is
    smoothed over 60 ms, so that the noise of a tracker does not count as motion."""
    times = np.array([row[0] for row in rows])
    points = np.array([row[column] for row in rows])
    even = np.column_stack([np.interp(grid, times, axis) for axis in points.T])
    width = max(1, round(0.06 * RATE))
    padded = np.pad(even, ((width // 2, width - 1 - width // 2), (0, 0)), mode="edge")
    smooth = np.column_stack([np.convolve(axis, np.ones(width) / width, mode="valid") for axis in padded.T])
    return np.linalg.norm(np.gradient(smooth, 1.0 / RATE, axis=0), axis=1)


def _fingers_move(rows: Sequence[tuple[Any, ...]], grid: np.ndarray) -> np.ndarray:
    if len(rows) < 2:
        return np.zeros(len(grid), dtype=bool)
    times, positions = np.array([row[0] for row in rows]), np.array([row[1] for row in rows], dtype=float)
    even = np.column_stack([np.interp(grid, times, axis) for axis in positions.T])
    return np.abs(np.gradient(even, 1.0 / RATE, axis=0)).max(axis=1) > FINGER_SPEED


def sparc(speed: np.ndarray, rate: float, cutoff: float = 10.0, threshold: float = 0.05) -> float:
    """Spectral arc length of a speed profile [n] sampled at ``rate`` Hz, a negative pure number; NaN if nothing moves.

    The arc length of the magnitude of its Fourier spectrum, normalised by its value at 0 Hz, up to the last frequency
    below ``cutoff`` Hz at which the magnitude reaches ``threshold``, with the frequency axis scaled to 0..1.
    """
    speed = np.asarray(speed, dtype=float)
    if len(speed) < 4 or not speed.max() > 0.0:
        return float("nan")
    size = 1 << (int(np.ceil(np.log2(len(speed)))) + 4)
    spectrum = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    spectrum = (spectrum / spectrum[0])[frequency <= cutoff]
    frequency = frequency[frequency <= cutoff]
    last = np.flatnonzero(spectrum >= threshold)[-1]
    if last == 0:
        return float("nan")
    spectrum, frequency = spectrum[: last + 1], frequency[: last + 1]
    return -float(np.sum(np.hypot(np.diff(frequency) / frequency[-1], np.diff(spectrum))))
