#!/usr/bin/python3
"""Writes docs/benchmarks.md and its plots from results.csv: ./coglab bench --report."""

from __future__ import annotations

import textwrap
from pathlib import Path

import matplotlib
import numpy as np
from common import TOP, Row, read_results

matplotlib.use("svg")
from matplotlib import pyplot

PAGE = TOP / "docs" / "benchmarks.md"
GROUPS = {  # title: name of the plot, programs
    "Handovers": ("handovers", ("handovers",)),
    "Recognition and contact": ("recognition", ("recognition", "contact")),
    "Motion": ("motion", ("primitives", "kinematics")),
    "Wire, limits, dynamics": ("wire", ("wire", "limits", "dynamics")),
    "Hand, state machines, feedback, console": ("machines", ("hand", "machines", "feedback", "console")),
    "Python and the researcher's commands": ("python", ("remote", "tools")),
}
HEAD = """# Benchmarks

Measured in simulation, beside a goal that a user feels or another program. No number says anything
about real people or a real arm. "Drawn people" are simulated persons with delays, habits and senses drawn by a seed
([people.md](people.md)). Values are medians unless the row says otherwise; intervals are 95 %.

`./coglab bench NAME` measures one group again, `./coglab bench --report` writes this page. Each program of
`benchmarks/` says in its first lines what it measures.
"""
COLOURS = {"met": "tab:green", "better": "tab:green", "missed": "tab:red", "worse": "tab:red", "": "tab:gray"}
SIGNS = {"<=": "at most", ">=": "at least"}


def words(row: Row) -> str:
    """Goal or peer in words."""
    if not row.against:
        return ""
    sign, *name, limit = row.against.split()
    return f"{name[0]}: {limit} {row.unit}".rstrip() if name else f"{SIGNS[sign]} {limit} {row.unit}".rstrip()


def ratio(row: Row) -> float | None:
    """How many times better than goal or peer; None if one of both is 0 or only one is negative."""
    if not row.against:
        return None
    limit = float(row.against.split()[-1])
    if row.value * limit <= 0.0:
        return None
    larger = row.value / limit if limit > 0.0 else limit / row.value
    return larger if row.against[0] == ">" else 1.0 / larger


def plot(rows: list[Row], file: Path) -> None:
    """One dot per row on a logarithmic axis from 0.01 to 1000: right of 1 is better than goal or peer."""
    shown = [(row, value) for row in reversed(rows) if (value := ratio(row)) is not None]
    figure, axes = pyplot.subplots(figsize=(8.0, 0.6 + 0.28 * len(shown)))
    for y, (row, value) in enumerate(shown):
        value = min(max(value, 0.01), 1000.0)
        axes.plot([1.0, value], [y, y], color="0.8", zorder=1)
        axes.scatter([value], [y], color=COLOURS[row.verdict()], zorder=2)
    axes.axvline(1.0, color="0.4", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_yticks(
        np.arange(len(shown)), [textwrap.shorten(row.row, 60, placeholder=" ...") for row, _ in shown], fontsize=7
    )
    axes.set_xlabel("times better than goal or peer", fontsize=8)
    axes.tick_params(axis="x", labelsize=7)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    file.parent.mkdir(exist_ok=True)
    figure.savefig(file, bbox_inches="tight", metadata={"Date": None})
    pyplot.close(figure)


def main() -> None:
    """Writes the page."""
    pyplot.rcParams.update({"svg.hashsalt": "benchmarks", "svg.fonttype": "none"})
    lines = read_results()
    text = [HEAD]
    for title, (name, programs) in GROUPS.items():
        mine = [line for program in programs for line in lines if line["benchmark"] == program]
        rows = [Row(one["row"], float(one["value"]), one["unit"], one["against"], one["interval"]) for one in mine]
        if not rows:
            continue
        plot(rows, PAGE.parent / "benchmarks" / f"{name}.svg")
        text += [f"## {title}\n", f"![Times better than goal or peer](benchmarks/{name}.svg)\n"]
        text += ["| what | value | interval | goal or peer | |", "| --- | --- | --- | --- | --- |"]
        for row, line in zip(rows, mine, strict=True):
            value = f"{line['value']} {row.unit}".rstrip()
            text.append(f"| {row.row} | {value} | {row.interval} | {words(row)} | {row.verdict()} |")
        text.append("")
    machines, days = sorted({line["machine"] for line in lines}), sorted({line["date"] for line in lines})
    measured = f"Measured from {days[0]} to {days[-1]} on: {'; '.join(machines)}."
    PAGE.write_text("\n".join([*text, measured]) + "\n", encoding="utf-8")
    print(f"written: {PAGE.relative_to(TOP)} with {len(lines)} rows")


if __name__ == "__main__":
    main()
