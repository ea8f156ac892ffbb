"""One figure of a trial: phases, paths, speeds, torques and fingers on one time axis."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Bbox

from coglab.series import Series, state_intervals

# Colours of Okabe and Ito, which colour-blind readers can distinguish
COLOURS = ["#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#1B1F24"]
CONTACT = COLOURS[3]
JOINTS = ["A1", "A2", "E1", "A3", "A4", "A5", "A6"]
FINGERS = ["thumb abduction", "thumb", "index", "middle", "ring+little"]
MOST_ENTRIES = 12  # of the legend beside the phases
MARGINS = (0.19, 0.05, 0.765, 0.975)  # left, bottom, right, top, share of the figure
TEXT = 7  # pt, smallest text of the figure, which has the width of a page (7.2 inch)
STYLE = {
    "font.size": 8,
    "axes.labelsize": 8,
    "legend.fontsize": TEXT,
    "xtick.labelsize": TEXT,
    "ytick.labelsize": TEXT,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
    "pdf.fonttype": 42,
}


def _column(rows: list[tuple], index: int, origin: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) relative to `origin` and one column of the rows."""
    return np.array([row[0] for row in rows]) - origin, np.array([row[index] for row in rows])


def _speed(times: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed along a path on a uniform 50 Hz grid, smoothed over 60 ms. Returns times (s) and speeds (m/s)."""
    grid = np.arange(times[0], times[-1], 0.02)
    even = np.column_stack([np.interp(grid, times, axis) for axis in points.T])
    speed = np.linalg.norm(np.gradient(even, 0.02, axis=0), axis=1)
    return grid, np.convolve(speed, np.ones(3) / 3, mode="same")


def rows_without_overlap(intervals: list[tuple[float, float, str]]) -> list[list[tuple[float, float, str]]]:
    """Distribute intervals over the smallest number of rows without overlaps (children of a concurrence overlap)."""
    rows: list[list[tuple[float, float, str]]] = []
    for interval in sorted(intervals):
        for row in rows:
            if row[-1][1] <= interval[0] + 1e-3:
                row.append(interval)
                break
        else:
            rows.append([interval])
    return rows


def lanes_of(trial: Series, start: float, end: float) -> list[tuple[str, list[list[tuple[float, float, str]]]]]:
    """Rows of the phases, from the outermost container inwards: label and intervals between `start` and `end` (s).

    Containers with the same name and depth share a lane, for example the approach of each action.
    """
    lanes: dict[tuple[int, str], list[tuple[float, float, str]]] = {}
    for path, intervals in state_intervals(trial.transitions, end).items():
        seen = [(max(since, start), min(until, end), name) for since, until, name in intervals]
        seen = [interval for interval in seen if interval[1] > interval[0]]
        if seen:
            lanes.setdefault((path.count("/"), path.rsplit("/", 1)[-1]), []).extend(seen)
    order = sorted(lanes, key=lambda lane: (lane[0], min(lanes[lane])))
    return [(name, rows_without_overlap(lanes[depth, name])) for depth, name in order]


def colours_of(names: list[str]) -> dict[str, tuple]:
    """One colour for each name."""
    palette = matplotlib.colormaps["tab20"].colors
    return {name: palette[k % len(palette)] for k, name in enumerate(dict.fromkeys(names))}


def _label(axis: Axes, x: float, y: float, name: str, space: Bbox) -> bool:
    """Write a name into its bar: in one line, one word per line, or upwards and small. False: nothing fits."""
    renderer = axis.figure.canvas.get_renderer()
    for words, turn, size in ((name, 0, TEXT), (name.replace(" ", "\n"), 0, TEXT), (name, 90, TEXT - 2)):
        label = axis.text(
            x, y, words, ha="center", va="center", fontsize=size, rotation=turn, linespacing=0.9, clip_on=True
        )
        needed = label.get_window_extent(renderer)
        if needed.width <= space.width - 2 and needed.height <= space.height + 2:
            return True
        label.remove()
    return False


def _phases(axis: Axes, trial: Series, start: float, end: float, others: list[Any]) -> None:
    """One lane per active container, one bar per state. Parallel children share the height of the lane. A name is
    written if it fits into its bar; the legend has the names that do not, after the entries of `others`."""
    lanes = lanes_of(trial, start, end)
    colours = colours_of([name for _, rows in lanes for row in rows for _, _, name in row])
    unnamed = dict(colours)
    axis.set_xlim(0.0, end - start)
    axis.set_ylim(len(lanes) - 0.5, -0.5)
    axis.set_yticks(range(len(lanes)), [_wrapped(name) for name, _ in lanes])
    axis.tick_params(axis="y", length=0)
    renderer = axis.figure.canvas.get_renderer()
    for lane, (_, rows) in enumerate(lanes):
        height = 0.84 / len(rows)
        for level, row in enumerate(rows):
            centre = lane - 0.42 + (level + 0.5) * height
            for since, until, name in row:
                (bar,) = axis.barh(
                    centre,
                    until - since,
                    left=since - start,
                    height=height,
                    color=colours[name],
                    alpha=0.6,
                    edgecolor=COLOURS[6],
                    lw=0.4,
                )
                words, middle = name.replace("_", " "), (since + until) / 2 - start
                if _label(axis, middle, centre, words, bar.get_window_extent(renderer)):
                    unnamed.pop(name, None)
    others += [
        Patch(facecolor=colour, alpha=0.6, edgecolor=COLOURS[6], label=_wrapped(name))
        for name, colour in unnamed.items()
    ]
    if others:
        axis.legend(handles=others[:MOST_ENTRIES], loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _wrapped(name: str) -> str:
    """A name for the margins, which have room for 24 letters."""
    return textwrap.fill(name.replace("_", " "), 24)


def _hands(path_axis: Axes, speed_axis: Axes, truth: list[tuple], start: float) -> None:
    """True paths and speeds of the robot's and the person's hand."""
    times, robot = _column(truth, 1, start)
    _, human = _column(truth, 2, start)
    for k, name in enumerate("xyz"):
        path_axis.plot(times, robot[:, k], color=COLOURS[k], label=f"robot {name}")
        path_axis.plot(times, human[:, k], color=COLOURS[k], ls="--", label=f"person {name}")
    speed_axis.plot(*_speed(times, robot), color=COLOURS[0], label="robot's hand")
    speed_axis.plot(*_speed(times, human), color=COLOURS[3], ls="--", label="person's hand")


def _torques(axis: Axes, rows: list[tuple], start: float) -> None:
    """External torques: one trace per joint, one above the other, on one scale that the bar at the right shows."""
    times, torques = _column(rows, 1, start)
    low, high = np.percentile(torques, [0.5, 99.5], axis=0)  # one peak must not flatten the other traces
    step = 1.2 * float(np.max(high - low)) or 1.0
    for k in range(len(JOINTS)):
        axis.axhline(-k * step, color="0.85", lw=0.5)
        axis.plot(times, torques[:, k] - k * step, color=COLOURS[k], lw=0.7)
    axis.set_yticks([-k * step for k in range(len(JOINTS))], JOINTS)
    size = float(f"{step:.0g}")
    x = 1.02 * axis.get_xlim()[1]
    axis.plot([x, x], [-3 * step - size / 2, -3 * step + size / 2], color=COLOURS[6], lw=2, clip_on=False)
    axis.text(x * 1.008, -3 * step, f"{size:g} Nm", va="center", fontsize=TEXT, clip_on=False)


def _fingers(axis: Axes, rows: list[tuple], start: float) -> None:
    """Positions of the five finger motors."""
    times, positions = _column(rows, 1, start)
    for k, name in enumerate(FINGERS):
        axis.plot(times, positions[:, k], color=COLOURS[k], label=name)


def _contact_lines(axes: list[Axes], contacts: list[tuple], start: float) -> list[Any]:
    """Vertical lines at the events of the contact detector. Returns entries of a legend."""
    kinds = {True: ("contact or load felt", ":"), False: ("load taken over", "--")}
    for axis in axes:
        for t, found, *_ in contacts:
            axis.axvline(t - start, color=CONTACT, lw=0.9, ls=kinds[bool(found)][1])
    shown = [kinds[found] for found in (True, False) if any(bool(c[1]) is found for c in contacts)]
    return [Line2D([], [], color=CONTACT, lw=0.9, ls=style, label=label) for label, style in shown]


def figure_of(trial: Series, title: str, start: float, end: float) -> Figure:
    """The figure of the trial between `start` and `end` (s). It belongs to no window."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 9.0))
        figure.subplots_adjust(*MARGINS, hspace=0.13)  # a layout engine takes longer than all the rest
        FigureCanvasAgg(figure)
        axes = figure.subplots(6, 1, sharex=True, height_ratios=[2.2, 1.6, 0.9, 1.7, 1.0, 0.7])
        labels = (
            "",
            "position, m",
            "speed, m/s",
            "external torque",
            "finger position\n(0..254)",
            "force on\nthe palm, N",
        )
        for axis, label in zip(axes, labels, strict=True):
            axis.set_ylabel(label)
            axis.grid(alpha=0.25, lw=0.5)
            axis.set_xlim(0.0, end - start)
        axes[0].set_title(title, fontsize=8, loc="left")
        truth = [row for row in trial.truth if start <= row[0] <= end]
        if len(truth) > 2:
            _hands(axes[1], axes[2], truth, start)
            axes[5].plot(*_column(truth, 4, start), color=COLOURS[6], lw=0.8)
        torques = [row for row in trial.external_torques if start <= row[0] <= end]
        if torques:
            _torques(axes[3], torques, start)
        fingers = [row for row in trial.fingers if start <= row[0] <= end]
        if fingers:
            _fingers(axes[4], fingers, start)
        for axis in axes[1:]:
            if axis.get_legend_handles_labels()[0]:
                axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        axes[-1].set_xlabel("time, s")
        entries = _contact_lines(list(axes), [row for row in trial.contacts if start <= row[0] <= end], start)
        _phases(axes[0], trial, start, end, entries)
    return figure


def draw_trial(trial: Series, title: str, start: float, end: float, path: Path) -> None:
    """Write the figure of the trial between `start` and `end` (s of ROS time): `path` as PNG, a PDF beside it."""
    figure = figure_of(trial, title, start, end)
    with matplotlib.rc_context(STYLE):
        figure.savefig(path, dpi=160)
        figure.savefig(path.with_suffix(".pdf"))
