"""Metrics of one trial, each with its definition, from a bag or from virtual time.

`metrics_of(read_trial(folder))` gives the values; METRICS has their definitions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from coglab.fluency import (
    FINGER_SPEED,
    PALM_SPEED,
    PERSON_SPEED,
    TOUCH,
    Interval,
    active_intervals,
    fluency_of,
    speed_of,
)

from coglab_tools.trial.read import Measured

CUT = 10.0  # Hz, highest frequency in the spectrum of SPARC
SHARE = 0.05  # of the largest amplitude; the spectrum of SPARC ends at the last amplitude above it
FIRST_TOUCH = 0.3  # N, true force from which the robot's hand is touched


@dataclass(frozen=True)
class Metric:
    """Name, unit and definition of a figure."""

    label: str
    unit: str
    definition: str


_PERSON = f"The person is active while their hand moves faster than {PERSON_SPEED} m/s"
_ROBOT = f"the robot while its palm moves faster than {PALM_SPEED} m/s or a finger by {FINGER_SPEED:g} of 254 counts/s"
METRICS = {
    "duration_s": Metric("duration", "s", "From the start of the action to its end, when the robot is ready again."),
    "reaction_s": Metric(
        "reaction", "s", "From the beginning of the person's last motion before the arm's start to the arm's start."
    ),
    "approach_s": Metric("approach", "s", "From the arm's start until it is at its goal or feels a contact."),
    "transfer_s": Metric(
        "transfer", "s", "From there until the giver lets go: the person (receiving), or the opening hand (giving)."
    ),
    "human_idle": Metric("person idle", "", f"1 - |H| / T (Hoffman 2019). {_PERSON}, {_ROBOT}; T is the duration."),
    "robot_idle": Metric("robot idle", "", "1 - |R| / T, active as above."),
    "concurrent_activity": Metric("both active", "", "|H and R| / T: share of the time in which both are active."),
    "functional_delay": Metric(
        "functional delay",
        "",
        "Sum over the turns of (start of one's activity - end of the other's before it) / T; negative if they overlap.",
    ),
    "peak_force_n": Metric("peak force", "N", "Largest force on the robot's hand while both touch the object."),
    "mean_force_n": Metric("mean force", "N", "Mean of that force over the same time."),
    "impulse_ns": Metric("impulse", "Ns", "Integral of that force over the same time."),
    "sparc": Metric(
        "smoothness (SPARC)",
        "",
        f"Spectral arc length of the palm's speed over the approach (Balasubramanian 2015; "
        f"cut at {CUT:g} Hz, amplitude {SHARE:g}). Nearer to 0 is smoother; a minimum-jerk reach has -1.40.",
    ),
    "detection_delay_s": Metric(
        "detection delay",
        "s",
        f"From the first true force above {FIRST_TOUCH} N on the hand to the detector's sample. Only in simulation.",
    ),
    "peak_palm_speed": Metric("peak speed of the palm", "m/s", "Largest speed of the palm, smoothed over 60 ms."),
    "nearest_m": Metric("least distance of the hands", "m", "Least distance of the palm from the person's hand."),
}
"""Name of each metric -> its unit and definition."""


def spans_of(marks: Mapping[str, float]) -> dict[str, float]:
    """approach_s and transfer_s of one action from its marks (s), as far as it has them."""
    arrived = min((marks[name] for name in ("motion_reached", "contact") if name in marks), default=None)
    let_go = marks.get("released", marks.get("opening"))
    found = {}
    if arrived is not None and "motion_started" in marks:
        found["approach_s"] = arrived - marks["motion_started"]
    if arrived is not None and let_go is not None:
        found["transfer_s"] = let_go - arrived
    return found


def metrics_of(trial: Measured) -> dict[str, float | None]:
    """Value of each of METRICS for a trial of one action (`Measured.parts`); None: there is no measurement for it."""
    found: dict[str, float | None] = dict.fromkeys(METRICS)
    found["duration_s"] = trial.end - trial.start
    marks = trial.exchanges[0].marks if trial.exchanges else {k: v + trial.start for k, v in trial.marks.items()}
    found.update(spans_of(marks))
    rows = [row for row in trial.series.truth if trial.start <= row[0] <= trial.end]
    if len(rows) < 3:
        return _numbers(found)
    times = np.array([row[0] for row in rows])
    times, first_of = np.unique(times, return_index=True)
    palm, person = (np.array([rows[i][k] for i in first_of], dtype=float) for k in (1, 2))
    force = np.array([rows[i][4] for i in first_of], dtype=float)
    human, robot = _active(trial, times, palm, person)
    begun = [start for start, _ in human if start <= marks.get("motion_started", -np.inf)]
    if begun:
        found["reaction_s"] = marks["motion_started"] - begun[-1]
    found.update(_fluency(trial, human, robot, bool(np.isfinite(person).any())))
    found.update(_forces(trial, times, force))
    speed = speed_of(times, palm)
    found["peak_palm_speed"] = float(np.nanmax(speed, initial=0.0))
    if np.isfinite(person).any():
        found["nearest_m"] = float(np.nanmin(np.linalg.norm(palm - person, axis=1)))
    begin = marks.get("motion_started", np.inf)
    reach = (times >= begin) & (times <= begin + found["approach_s"] if found["approach_s"] is not None else False)
    if reach.sum() >= 20:
        found["sparc"] = sparc(times[reach], palm[reach])
    felt = next((t for t, contact, *_ in trial.series.contacts if contact and trial.start <= t <= trial.end), None)
    if trial.true_hands and felt is not None and trial.record.action in ("exchange_human_to_robot", "take"):
        touched = times[force > FIRST_TOUCH]
        if len(touched) and touched[0] <= felt:
            found["detection_delay_s"] = felt - float(touched[0])
    return _numbers(found)


def _numbers(values: dict[str, float | None]) -> dict[str, float | None]:
    return {k: None if v is None or not np.isfinite(v) else round(float(v), 6) for k, v in values.items()}


def activities(trial: Measured) -> tuple[list[Interval], list[Interval]]:
    """Intervals (s) in which the person and the robot are active, as METRICS defines it."""
    rows = [row for row in trial.series.truth if trial.start <= row[0] <= trial.end]
    if len(rows) < 3:
        return [], []
    times = np.array([row[0] for row in rows])
    times, first_of = np.unique(times, return_index=True)
    palm, person = (np.array([rows[i][k] for i in first_of], dtype=float) for k in (1, 2))
    return _active(trial, times, palm, person)


def _active(
    trial: Measured, times: np.ndarray, palm: np.ndarray, person: np.ndarray
) -> tuple[list[Interval], list[Interval]]:
    robot = speed_of(times, palm) > PALM_SPEED
    fingers = [row for row in trial.series.fingers if np.isfinite(row[1]).all()]
    if len(fingers) > 2:
        at = np.array([row[0] for row in fingers])
        at, first_of = np.unique(at, return_index=True)
        positions = np.array([fingers[i][1] for i in first_of], dtype=float)
        if len(at) > 2:
            closing = np.abs(np.gradient(positions, at, axis=0)).max(axis=1)
            robot |= np.interp(times, at, closing, left=0.0, right=0.0) > FINGER_SPEED
    with np.errstate(invalid="ignore"):
        human = speed_of(times, person) > PERSON_SPEED  # an unseen hand (NaN) is not active
    return active_intervals(times, human), active_intervals(times, robot)


def _fluency(trial: Measured, human: list[Interval], robot: list[Interval], seen: bool) -> dict[str, float | None]:
    if not trial.end > trial.start:
        return {}
    found = fluency_of(human, robot, trial.start, trial.end)
    names = ("human_idle", "robot_idle", "concurrent_activity", "functional_delay") if seen else ("robot_idle",)
    return {name: getattr(found, name) for name in names}


def _forces(trial: Measured, times: np.ndarray, force: np.ndarray) -> dict[str, float | None]:
    """Force on the robot's hand while both touch the object."""
    if trial.person_force:
        at, size = np.array(trial.person_force).T
        shared = (np.interp(times, at, size) > TOUCH) & (force > TOUCH)
    else:  # a real robot: between contact and release
        marks = trial.exchanges[0].marks if trial.exchanges else {}
        shared = (times >= marks.get("contact", np.inf)) & (times <= marks.get("released", trial.end))
    shared &= np.isfinite(force)
    if shared.sum() < 2:
        return {}
    steps = np.gradient(times)
    return {
        "peak_force_n": float(force[shared].max()),
        "mean_force_n": float(np.average(force[shared], weights=steps[shared])),
        "impulse_ns": float((force * steps)[shared].sum()),
    }


def sparc(times: np.ndarray, points: np.ndarray) -> float:
    """Spectral arc length of the speed along a path, `times` [n] s, `points` [n, 3] m. NaN without motion."""
    rate = 1.0 / float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], 1.0 / rate)
    even = np.column_stack([np.interp(grid, times, axis) for axis in points.T])
    return sparc_of_speed(np.linalg.norm(np.gradient(even, 1.0 / rate, axis=0), axis=1), rate)


def sparc_of_speed(speed: Sequence[float] | np.ndarray, rate: float) -> float:
    """Spectral arc length of a speed profile, `speed` [n] m/s at `rate` Hz: the length of its normalised amplitude
    spectrum up to 10 Hz, or to the last amplitude above 0.05 of the largest. NaN without motion."""
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + 4)
    amplitude = np.abs(np.fft.rfft(speed, size))
    if not amplitude.max() > 0.0:
        return float("nan")
    frequency = np.arange(len(amplitude)) * rate / size
    amplitude = (amplitude / amplitude.max())[frequency <= CUT]
    last = int(np.flatnonzero(amplitude >= SHARE)[-1])
    if last < 1:
        return float("nan")
    return -float(np.hypot(np.full(last, 1.0 / last), np.diff(amplitude[: last + 1])).sum())
