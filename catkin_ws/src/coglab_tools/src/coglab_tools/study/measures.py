"""Measures of one handover, from the record of a trial in virtual time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from coglab import Exchange, Trial

DIGITS = 6  # of a measure in the table
_HUMAN = "The person is active while their hand moves at 0.05 m/s or more."
_ROBOT = "The robot is active while its palm moves at 0.05 m/s or more, or its fingers move."
MEASURES: dict[str, tuple[str, str, str]] = {
    "duration_s": ("duration", "s", "From the start of the action to its end, when the robot is ready again."),
    "reaction_s": ("reaction", "s", "From the moment in which the offer or request is believed to the arm's start."),
    "approach_s": ("approach", "s", "From the arm's start to the contact of both with the object."),
    "transfer_s": ("transfer", "s", "From the contact until the person has let go (receive): both hold the object."),
    "human_idle": ("person idle", "share", f"1 - |H| / T. {_HUMAN}"),
    "robot_idle": ("robot idle", "share", f"1 - |R| / T. {_ROBOT}"),
    "concurrent_activity": ("both active", "share", "|H and R| / T."),
    "functional_delay": (
        "functional delay",
        "share",
        "Sum over the turns of (start of one's activity - end of the other's before it) / T; negative if they overlap.",
    ),
    "peak_force_n": ("peak force", "N", "Largest force on the robot's hand while the person touches the object too."),
    "sparc": (
        "smoothness (SPARC)",
        "",
        "Spectral arc length of the palm's speed from the arm's start to the contact (Balasubramanian et al. 2015; cut "
        "at 10 Hz, amplitude 0.05). Nearer to 0 is smoother; a minimum-jerk reach has -1.40.",
    ),
}
"""Name of each measure in trials.csv: (short name, unit, definition)"""


def measures_of(trial: Trial, exchange: Exchange) -> dict[str, Any]:
    """Measures of one handover of a trial; those that do not apply are left out."""
    from coglab import fluency_of

    marks = exchange.marks
    found = times_of(exchange)
    if exchange.ended > exchange.started:
        fluency = fluency_of(trial.person_activity(), trial.robot_activity(), exchange.started, exchange.ended)
        for name in ("human_idle", "robot_idle", "concurrent_activity", "functional_delay"):
            found[name] = getattr(fluency, name)
    inside = (trial.time >= exchange.started) & (trial.time <= exchange.ended)
    shared = inside & (np.linalg.norm(trial.person_force, axis=1) > 0.05)
    found["peak_force_n"] = float(np.linalg.norm(trial.hand_force[shared], axis=1).max(initial=0.0))
    reach = inside & (trial.time >= marks.get("motion_started", np.inf)) & (trial.time <= marks.get("contact", -np.inf))
    if reach.sum() >= 20:
        speed = np.linalg.norm(np.gradient(trial.palm_position, trial.time, axis=0), axis=1)
        found["sparc"] = sparc(speed[reach], 1.0 / float(np.median(np.diff(trial.time))))
    return {name: round(float(value), DIGITS) for name, value in found.items() if np.isfinite(value)}


def times_of(exchange: Exchange) -> dict[str, float]:
    """Duration, and the times between the marks that the handover has; s."""
    marks = exchange.marks
    found = {"duration_s": exchange.duration}
    for name, first, last in (
        ("reaction_s", "offered", "motion_started"),
        ("approach_s", "motion_started", "contact"),
        ("transfer_s", "contact", "released"),
    ):
        if first in marks and last in marks:
            found[name] = marks[last] - marks[first]
    return {name: round(value, DIGITS) for name, value in found.items()}


def sparc(speed: np.ndarray, rate: float, cut: float = 10.0, share: float = 0.05) -> float:
    """Spectral arc length of a speed profile ([n] m/s at ``rate`` Hz): the length of its normalised amplitude spectrum
    up to ``cut`` Hz, or to the last amplitude above ``share`` of the largest. S. Balasubramanian et al., "On the
    analysis of movement smoothness", Journal of NeuroEngineering and Rehabilitation 12, 2015. NaN without motion."""
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + 4)
    frequency = np.arange(size) * rate / size
    amplitude = np.abs(np.fft.fft(speed, size))
    if not amplitude.max() > 0.0:
        return float("nan")
    amplitude = amplitude / amplitude.max()
    amplitude, frequency = amplitude[frequency <= cut], frequency[frequency <= cut]
    last = int(np.flatnonzero(amplitude >= share)[-1])
    if last < 1:
        return float("nan")
    frequency, amplitude = frequency[: last + 1], amplitude[: last + 1]
    return -float(np.hypot(np.diff(frequency) / (frequency[-1] - frequency[0]), np.diff(amplitude)).sum())
