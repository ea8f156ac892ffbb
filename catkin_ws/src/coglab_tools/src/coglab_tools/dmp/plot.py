"""The picture of a primitive: its reproduction of the demonstrations, and its courses on the arm."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import coglab_controllers as cc
import numpy as np

from coglab_tools.command import UsageError
from coglab_tools.dmp import check
from coglab_tools.dmp.demonstration import Array, Demonstration
from coglab_tools.dmp.train import SHARES, course
from coglab_tools.files import write_whole

KINDS = (".png", ".pdf", ".svg")
RATIOS = (1.0, 1.5, 2.0)
"""dmp_ratio of the three speeds"""
SHIFT = 0.1
"""m, shift of the goal to each side"""
VERDICTS = {"reached": ("tab:green", "o"), "slowed": ("tab:orange", "s"), "not reached": ("tab:red", "x")}


def picture(
    primitive: cc.Primitive,
    demonstrations: Sequence[Demonstration] = (),
    rmse: Array | None = None,
    turn: Array | None = None,
    closing: Array | None = None,
    goal: Array | None = None,
) -> Any:
    """A matplotlib Figure. `goal`: (3,) m in the base frame, for the courses on the arm; None: middle of the region."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16, 8.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 4)
    courses = [check.run(primitive, check.region_middle() if goal is None else goal, ratio) for ratio in RATIOS]
    _over_time(axes[0, 0], primitive, demonstrations, rmse)
    _path(axes[0, 1], primitive, demonstrations, (0, 1), "from above")
    _path(axes[0, 2], primitive, demonstrations, (0, 2), "from the side")
    _turn_and_fingers(axes[0, 3], turn, closing)
    _three_speeds(axes[1, 0], courses)
    _joint_speeds(axes[1, 1], courses[0])
    _reachable(axes[1, 2], axes[1, 3], check.over_region(primitive))
    figure.suptitle(f"{primitive.id}: {primitive.description}" if primitive.description else primitive.id)
    return figure


def draw(path: Path, *args: Any, **named: Any) -> Path:
    """Write `picture(...)` as a PNG, PDF or SVG, by the name's ending, and return its path."""
    if path.suffix.lower() not in KINDS:
        raise UsageError(f"{path}: expected a picture of the kind {', '.join(KINDS)}")
    content = io.BytesIO()
    picture(*args, **named).savefig(content, format=path.suffix[1:].lower(), dpi=90)
    return write_whole(path, content.getvalue())


def _over_time(axis: Any, primitive: cc.Primitive, demonstrations: Sequence[Demonstration], rmse: Array | None) -> None:
    for d in demonstrations:
        for k, color in enumerate(("tab:red", "tab:green", "tab:blue")):
            share = d.times / d.duration
            axis.plot(share, d.positions[:, k] - d.positions[0, k], color=color, alpha=0.25, lw=1)
    start, goal = np.asarray(primitive.start), np.asarray(primitive.goal)
    times = np.linspace(0.0, primitive.duration, 201)
    path = course(primitive, start, goal, 1.0, times) - start
    for k, (name, color) in enumerate(zip("xyz", ("tab:red", "tab:green", "tab:blue"), strict=True)):
        axis.plot(times / primitive.duration, path[:, k], color=color, ls="--", label=name)
    error = "" if rmse is None or len(rmse) == 0 else f": RMSE {1000 * float(np.median(rmse)):.2f} mm (median)"
    axis.set_title(f"reproduction (dashed) of {len(demonstrations)} demonstrations{error}", fontsize=9)
    axis.set_xlabel(f"share of the duration ({primitive.duration:.2f} s)")
    axis.set_ylabel("way from the start [m]")
    axis.legend(fontsize=8)


def _path(
    axis: Any, primitive: cc.Primitive, demonstrations: Sequence[Demonstration], which: tuple[int, int], title: str
) -> None:
    start, goal = np.asarray(primitive.start), np.asarray(primitive.goal)
    a, b = which
    for d in demonstrations:
        axis.plot(d.positions[:, a] - d.positions[0, a], d.positions[:, b] - d.positions[0, b], "k", alpha=0.25, lw=1)
    times = np.linspace(0.0, 1.2 * primitive.duration, 161)
    for side, shift in _shifts():
        path = course(primitive, start, goal + shift, 1.0, times) - start
        axis.plot(path[:, a], path[:, b], lw=1.2, label=side)
        axis.plot(*(goal + shift - start)[[a, b]], "k.", ms=4)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_title(f"path {title}, goal shifted by {100 * SHIFT:.0f} cm", fontsize=9)
    axis.set_xlabel(f"{'xyz'[a]} [m]")
    axis.set_ylabel(f"{'xyz'[b]} [m]")
    axis.legend(fontsize=7)


def _shifts() -> list[tuple[str, Array]]:
    names = ("x", "y", "z")
    shifts = [(f"{sign}{name}", value * np.eye(3)[k]) for k, name in enumerate(names)
              for sign, value in (("+", SHIFT), ("-", -SHIFT))]  # fmt: skip
    return [("as taught", np.zeros(3)), *shifts]


def _turn_and_fingers(axis: Any, turn: Array | None, closing: Array | None) -> None:
    axis.set_title("turn (dashed: as the robot turns) and fingers", fontsize=9)
    axis.set_xlabel("share of the duration")
    if turn is not None:
        end = np.linalg.norm(turn[-1])
        curve = cc.OrientationCurve([0.0, 0.0, 0.0, 1.0], cc.exp_rotation(turn[-1]))
        robot = [2.0 * np.arccos(min(1.0, abs(float(curve.at(float(s))[3])))) for s in SHARES]
        axis.plot(SHARES, np.degrees(np.linalg.norm(turn, axis=1)), "tab:purple", label="turn from the start")
        axis.plot(SHARES, np.degrees(robot), color="tab:purple", ls="--")
        axis.set_ylabel(f"turn [deg], {np.degrees(end):.0f} at the end")
        axis.legend(fontsize=8, loc="upper left")
    if closing is not None:
        right = axis.twinx()
        right.plot(SHARES, closing, "tab:brown", label="closing of the fingers")
        right.set_ylim(-0.05, 1.05)
        right.legend(fontsize=8, loc="lower right")
    if turn is None and closing is None:
        axis.text(0.5, 0.5, "not recorded", ha="center", transform=axis.transAxes)


def _three_speeds(axis: Any, courses: Sequence[check.Course]) -> None:
    for ratio, c in zip(RATIOS, courses, strict=True):
        speed = np.linalg.norm(np.gradient(c.path, check.CYCLE, axis=0), axis=1)
        axis.plot(c.times, speed, label=f"dmp_ratio {ratio:g}: joints at {100 * c.peak:.0f} % ({c.fastest})")
    axis.set_title(f"speed of the palm, from home to {np.round(courses[0].goal, 2).tolist()} m", fontsize=9)
    axis.set_xlabel("time [s]")
    axis.set_ylabel("speed [m/s]")
    axis.legend(fontsize=8)


def _joint_speeds(axis: Any, c: check.Course) -> None:
    for k, name in enumerate(check.NAMES):
        axis.plot(c.times, 100 * c.shares[:, k], label=name, lw=1)
    axis.axhspan(100, 110, color="tab:red", alpha=0.2)
    axis.axhspan(-110, -100, color="tab:red", alpha=0.2)
    axis.set_ylim(-110, 110)
    axis.set_title("joint speeds at dmp_ratio 1", fontsize=9)
    axis.set_xlabel("time [s]")
    axis.set_ylabel("share of the limit [%]")
    axis.legend(fontsize=7, ncol=4, loc="lower center")


def _reachable(above: Any, side: Any, courses: Sequence[check.Course]) -> None:
    """All goals, slightly spread so that none hides another."""
    reached = sum(c.reached for c in courses)
    for axis, (a, b), third in ((above, (0, 1), 2), (side, (1, 2), 0)):
        low = min(c.goal[third] for c in courses)
        high = max(c.goal[third] for c in courses)
        for name, (color, marker) in VERDICTS.items():
            here = [c for c in courses if (c.verdict if c.reached else "not reached") == name]
            if here:
                spread = [0.05 * (c.goal[third] - low) / max(1e-6, high - low) for c in here]
                axis.plot([c.goal[a] + s for c, s in zip(here, spread, strict=True)],
                          [c.goal[b] + s for c, s in zip(here, spread, strict=True)],
                          marker, color=color, ls="", ms=5, alpha=0.8, label=name)  # fmt: skip
        axis.set_xlabel(f"{'xyz'[a]} [m]")
        axis.set_ylabel(f"{'xyz'[b]} [m]")
        axis.set_title(f"goals of the handover region: {reached} of {len(courses)} reached", fontsize=9)
    above.legend(fontsize=7)
