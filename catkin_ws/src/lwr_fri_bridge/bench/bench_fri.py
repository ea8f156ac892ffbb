#!/usr/bin/python3
"""Limits, times and braking while datagrams are lost (docs/limits_under_loss.md), in lockstep and without ROS.

Losses: 0, 1, 5 and 10 % of the cycles, half of them lose the measurement and half the answer, one at a time and in
bursts of 1 to 5, from the first cycle on or after 1200 that lost nothing, against a controller that goes on with its
last step and one that stands. Nothing is left out: a run that did not start, or in which command mode ended, makes its
row missed. 100 seeds of each, a sample, and with --long the 1000 that were asked for. Prints JSON. The latency rows of
the same bench are in coglab_bringup/bench/bench_fri.py.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

ASKED = 1000  # seeds, which take about an hour
SEEDS = ASKED if os.environ.get("COGLAB_LONG") else 100
PERIODS = (0.001, 0.002, 0.005, 0.01, 0.02)  # s
# s by FRI period: A2 from the middle of its range to 0.05 rad before its limit, measured at commit 5828bb3, which did
# not reckon with losses.
MOTION_TIMES = {0.001: 1.270, 0.002: 1.274, 0.005: 1.285, 0.02: 1.360}
MOTION_LIMIT = 1.1
STOP_LIMIT = 1.5


def find_binary(name: str) -> str:
    """Path of a helper binary in the sourced workspace."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        path = Path(prefix) / "lib" / "lwr_fri_bridge" / name
        if path.is_file():
            return str(path)
    sys.exit(f"{name} not found: build the workspace and source its setup.bash")


def row(
    figure: str, value: float, unit: str, goal: str, ok: bool, peer: str | None = None, peer_value: float | None = None
) -> dict:
    """A row as `./coglab bench` prints it."""
    return dict(
        bench="fri",
        figure=figure,
        value=round(value, 4),
        unit=unit,
        goal=goal,
        peer=peer,
        peer_value=peer_value,
        ok=ok,
    )


def of_seeds(each: dict) -> dict:
    """A row that fewer seeds than asked cannot meet."""
    return each | {"done": SEEDS, "asked": ASKED}


def approach_rows(period: float, lines: list[list[float]], when: str) -> list[dict]:
    """Every joint to the ends of its range at full speed: what a set-point did at worst."""
    beyond, crossed, failed = max(v[2] for v in lines), sum(v[5] for v in lines), sum(v[6] for v in lines)
    above = max(max(v[3], v[4]) for v in lines)
    at = f"at {1e3 * period:g} ms, {SEEDS} seeds x 4 shares x single, bursts x both kinds of controller, {when}"
    inside, slow = beyond == 0.0 and crossed + failed == 0, above <= 1e-6 and failed == 0
    faster = f"largest speed or acceleration beyond its limit {at}"
    return [
        of_seeds(row(f"largest set-point beyond its bound {at}", beyond, "mrad", "0", inside)),
        of_seeds(row(faster, above, "rad/s, rad/s^2", "<= 1e-6", slow)),
    ]


def stop_rows(period: float, kind: str, mean: float, worst: float, slow: float) -> list[dict]:
    """Angle of stopping from full speed at 10 % loss over that without: each single stop is judged, and missed is the
    row with a stop that was not from full speed."""
    what = f"angle of stopping at 10 % loss ({kind}) over that without, {1e3 * period:g} ms, {SEEDS} seeds"
    if slow:
        what += f" ({slow:g} not from full speed)"
    fine = worst <= STOP_LIMIT and slow == 0
    return [
        of_seeds(row(f"{what}: largest", worst, "ratio", f"<= {STOP_LIMIT:g}", fine)),
        row(f"{what}: mean", mean, "ratio", "reported", True),
    ]


def main() -> None:
    """Prints the rows."""
    binary = find_binary("lwr_fri_bridge_loss_campaign")
    run = subprocess.run([binary, str(SEEDS)], stdout=subprocess.PIPE, text=True, check=True, timeout=12000)
    lines = [(words[0], list(map(float, words[1:]))) for words in map(str.split, run.stdout.splitlines())]
    rows = []
    for period in PERIODS:
        for way, when in (("approach", "losses from the first cycle on"), ("later", "losses after 1200 clean cycles")):
            rows += approach_rows(period, [v for kind, v in lines if kind == way and v[0] == period], when)
    for period, before in MOTION_TIMES.items():
        now = next(v[1] for kind, v in lines if kind == "motion" and v[0] == period)
        figure = f"full-speed motion of A2 to 0.05 rad before its limit at {1e3 * period:g} ms"
        rows.append(
            row(figure, now, "s", f"<= {MOTION_LIMIT:g} x before", now <= MOTION_LIMIT * before, "5828bb3", before)
        )
    for period, bursts, _, mean, worst, slow in (v for kind, v in lines if kind == "stop"):
        rows += stop_rows(period, "bursts of 1..5" if bursts else "single", mean, worst, slow)
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
