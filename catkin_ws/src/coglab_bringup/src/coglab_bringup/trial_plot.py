"""One picture of a trial: phases, paths, speeds, torques and fingers on one time axis."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from coglab_bringup.trial_recorder import Trial

# Okabe and Ito's colours: told apart by colour-blind readers too
COLOURS = ["#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#1B1F24"]
JOINTS = ["A1", "A2", "E1", "A3", "A4", "A5", "A6"]
FINGERS = ["thumb abduction", "thumb", "index", "middle", "ring+little"]


def _column(rows: list[tuple], index: int, origin: float) -> tuple[np.ndarray, np.ndarray]:
    """Times relative to `origin` and one column of the rows."""
    return np.array([row[0] for row in rows]) - origin, np.array([row[index] for row in rows])


def _speed(times: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed of a path on an even 50 Hz grid, smoothed over 60 ms: times and m/s."""
    grid = np.arange(times[0], times[-1], 0.02)
    even = np.column_stack([np.interp(grid, times, axis) for axis in points.T])
    speed = np.linalg.norm(np.gradient(even, 0.02, axis=0), axis=1)
    return grid, np.convolve(speed, np.ones(3) / 3, mode="same")


def state_intervals(trial: Trial, end: float) -> dict[str, list[tuple[float, float, str]]]:
    """For each container: when its states began and ended, from the transitions; what is still active ends at `end`."""
    intervals: dict[str, list[tuple[float, float, str]]] = {}
    entered: dict[tuple[str, str], float] = {}  # (container, state) -> time
    begun: dict[str, float] = {}  # container -> time
    left = {(path, from_state) for _, path, from_state, _, _, _ in trial.transitions}
    for t, path, from_state, outcome, to_state, _ in trial.transitions:
        above = path  # a child of a concurrence begins with it, and no transition leads to it
        while above and above not in begun:
            above = above.rpartition("/")[0]
        since = entered.pop((path, from_state), begun.get(above, trial.transitions[0][0]))
        intervals.setdefault(path, []).append((since, t, from_state))
        # a sibling, not the container's own outcome: it is left later, or (still active) not named like the outcome
        if (path, to_state) in left or to_state != outcome:
            entered[path, to_state] = t
            begun[f"{path}/{to_state}"] = t
    for (path, state), since in entered.items():
        intervals.setdefault(path, []).append((since, end, state))
    return intervals


def rows_without_overlap(intervals: list[tuple[float, float, str]]) -> list[list[tuple[float, float, str]]]:
    """Spreads intervals over as few rows as it takes that none overlaps another (children of a concurrence)."""
    rows: list[list[tuple[float, float, str]]] = []
    for interval in sorted(intervals):
        for row in rows:
            if row[-1][1] <= interval[0] + 1e-3:
                row.append(interval)
                break
        else:
            rows.append([interval])
    return rows


def _phases(axis: plt.Axes, trial: Trial, start: float, end: float) -> None:
    """A lane per container that was active, a bar per state; parallel children share the lane's height."""
    lanes = []
    for path, intervals in sorted(state_intervals(trial, end).items(), key=lambda item: (item[0].count("/"), item[0])):
        seen = [(max(since, start), min(until, end), name) for since, until, name in intervals]
        seen = [interval for interval in seen if interval[1] > interval[0]]
        if seen:
            lanes.append((path.rsplit("/", 1)[-1], rows_without_overlap(seen)))
    for lane, (_, rows) in enumerate(lanes):
        height = 0.84 / len(rows)
        for level, row in enumerate(rows):
            centre = lane - 0.42 + (level + 0.5) * height
            for k, (since, until, name) in enumerate(row):
                colour = COLOURS[(k + level) % 6]
                axis.barh(centre, until - since, left=since - start, height=height, color=colour, alpha=0.35,
                          edgecolor=COLOURS[6], lw=0.5)  # fmt: skip
                if until - since > 0.03 * (end - start):
                    axis.text(since - start + 0.02, centre, name, va="center", fontsize=6, clip_on=True)
    axis.set_yticks(range(len(lanes)), [name for name, _ in lanes], fontsize=6)
    axis.invert_yaxis()


def draw_trial(trial: Trial, title: str, start: float, end: float, path: Path) -> None:
    """Writes the picture of the trial between `start` and `end` (s of ROS time) as PNG."""
    figure, axes = plt.subplots(
        5, 1, figsize=(10, 11), sharex=True, height_ratios=[1.3, 1.5, 1, 1.2, 1], layout="constrained"
    )
    _phases(axes[0], trial, start, end)
    axes[0].set_title(title, fontsize=10, loc="left")
    truth = [row for row in trial.truth if start <= row[0] <= end]
    if len(truth) > 2:
        times, robot = _column(truth, 1, start)
        _, human = _column(truth, 2, start)
        _, force = _column(truth, 4, start)
        for k, name in enumerate("xyz"):
            axes[1].plot(times, robot[:, k], color=COLOURS[k], label=f"robot {name}")
            axes[1].plot(times, human[:, k], color=COLOURS[k], ls="--", label=f"person {name}")
        axes[2].plot(*_speed(times, robot), color=COLOURS[0], label="robot hand")
        axes[2].plot(*_speed(times, human), color=COLOURS[3], ls="--", label="person's hand")
        force_axis = axes[4].twinx()
        force_axis.plot(times, force, color=COLOURS[6], lw=0.8, label="force on the palm")
        force_axis.set_ylabel("N", fontsize=8)
        force_axis.legend(fontsize=6, loc="upper right")
    axes[1].set_ylabel("hand paths, m", fontsize=8)
    axes[2].set_ylabel("speed, m/s", fontsize=8)
    if trial.external_torques:
        times, torques = _column(trial.external_torques, 1, start)
        for k, name in enumerate(JOINTS):
            axes[3].plot(times, torques[:, k], color=COLOURS[k], lw=0.7, label=name)
    axes[3].set_ylabel("external torque, Nm", fontsize=8)
    if trial.fingers:
        times, positions = _column(trial.fingers, 1, start)
        for k, name in enumerate(FINGERS):
            axes[4].plot(times, positions[:, k], color=COLOURS[k], lw=0.9, label=name)
    axes[4].set_ylabel("finger position", fontsize=8)
    axes[4].set_xlabel("time, s", fontsize=8)
    for axis in axes:
        for t, found, _ in trial.contacts:  # dotted: contact or load; dashed: the load was taken over
            axis.axvline(t - start, color="#D55E00", lw=0.8, ls=":" if found else "--")
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.25)
        axis.set_xlim(0.0, end - start)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=6, ncols=4, loc="upper left")
    figure.savefig(path, dpi=110)
    plt.close(figure)
