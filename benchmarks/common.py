"""Common parts of the benchmark programs: rows and their file, intervals, files of the workspace, worker processes."""

from __future__ import annotations

import argparse
import csv
import datetime
import importlib
import math
import multiprocessing
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

FOLDER = Path(__file__).resolve().parent
TOP = FOLDER.parent
SOURCES = TOP / "catkin_ws" / "src"
DEVEL = TOP / "catkin_ws" / "devel"
HELPERS = TOP / ".coglab" / "benchmarks"  # where ./coglab bench builds src/*.cpp
RESULTS = FOLDER / "results.csv"
COLUMNS = ("benchmark", "row", "value", "unit", "interval", "against", "date", "machine")
URDF = SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf"
LIMITS = SOURCES / "lwr_description" / "config" / "joint_limits.yaml"

In = TypeVar("In")
Out = TypeVar("Out")


class Row(NamedTuple):
    """One result. `against`: a goal ("<= 0.35"), or a peer with its value ("< movement_primitives 0.25"), or empty."""

    row: str
    value: float
    unit: str
    against: str = ""
    interval: str = ""

    def verdict(self) -> str:
        """met or missed for a goal, better or worse than a peer."""
        if not self.against:
            return ""
        sign, *name, limit = self.against.split()
        good = {"<=": self.value <= float(limit), ">=": self.value >= float(limit), "<": self.value < float(limit),
                ">": self.value > float(limit)}[sign]  # fmt: skip
        return ("better" if good else "worse") if name else ("met" if good else "missed")


def number(value: float) -> str:
    """Four significant digits."""
    return f"{value:.4g}"


# --- statistics -----------------------------------------------------------------------------------------------------


def share(row: str, good: Sequence[bool], against: str = "") -> Row:
    """Percentage of true values, with Wilson's 95 % interval."""
    n, p, z = len(good), float(np.mean(good)) if len(good) else 0.0, 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n) if n else 0.5
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) if n else 0.5
    interval = f"{100 * max(0.0, middle - half):.1f} to {100 * min(1.0, middle + half):.1f}, n = {n}"
    return Row(row, 100.0 * p, "%", against, interval)


def quantile(row: str, values: Sequence[float | None], part: float, unit: str, against: str = "") -> Row:
    """Quantile `part` (0..1) with its 95 % interval by rank. None counts as infinite; no value is left out."""
    ordered = sorted(math.inf if value is None else value for value in values)
    n = len(ordered)
    at = min(n - 1, math.ceil(part * n) - 1 if part < 1.0 else n - 1)
    spread = 1.96 * math.sqrt(part * (1.0 - part) * n)
    low, high = ordered[max(0, math.floor(at - spread))], ordered[min(n - 1, math.ceil(at + spread))]
    interval = f"{number(low)} to {number(high)}, n = {n}" if 0.0 < part < 1.0 else f"n = {n}"
    return Row(row, ordered[max(0, at)], unit, against, interval)


def median(row: str, values: Sequence[float | None], unit: str, against: str = "") -> Row:
    """The median by rank."""
    return quantile(row, values, 0.5, unit, against)


def minimum_jerk(u: np.ndarray) -> np.ndarray:
    """Share of the path at share u of the time."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


# --- programs -------------------------------------------------------------------------------------------------------


def helper(name: str) -> str:
    """Path of a C++ helper of src/."""
    path = HELPERS / name
    if not path.is_file():
        raise FileNotFoundError(f"{name} is not built: run the benchmark by ./coglab bench")
    return str(path)


def shared_module(name: str) -> Any:
    """Imports a module from the tests or scripts of a package."""
    path = next(path for path in SOURCES.rglob(f"{name}.py") if {"test", "scripts"} & set(path.parts))
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    return importlib.import_module(name)


def in_parallel(work: Callable[[In], Out], items: Iterable[In]) -> list[Out]:
    """Returns work() of each item, computed in one process per core."""
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("fork")) as pool:
        return list(pool.map(work, items))


def machine() -> str:
    """Number of cores and processor of this machine."""
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return f"{os.cpu_count()} cores, {names[0] if names else 'unknown processor'}"


def read_results() -> list[dict[str, str]]:
    """The rows of results.csv."""
    with RESULTS.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_results(benchmark: str, rows: Sequence[Row]) -> None:
    """Writes rows to results.csv; they replace rows of the same names."""
    about = {"date": datetime.date.today().isoformat(), "machine": machine()}
    new = {row.row: {"benchmark": benchmark, **row._asdict(), "value": number(row.value), **about} for row in rows}
    for line in (lines := read_results()):
        if line["benchmark"] == benchmark and line["row"] in new:
            line.update(new.pop(line["row"]))
    with RESULTS.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows([*lines, *new.values()])


def main(benchmark: str, *parts: Callable[[bool], Iterable[Row]]) -> None:
    """Runs the parts of a benchmark, prints their rows and writes them to results.csv. `--quick`: few
    repetitions, nothing is written. A part that fails is reported, and the others still run."""
    parser = argparse.ArgumentParser(prog=f"./coglab bench {benchmark}")
    parser.add_argument("--quick", action="store_true", help="few repetitions; prints the rows and keeps none")
    quick = parser.parse_args().quick
    rows: list[Row] = []
    failed = 0
    for part in parts:
        try:
            found = list(part(quick))
        except Exception:
            traceback.print_exc()
            print(f"{benchmark}: {part.__name__} failed", file=sys.stderr)
            failed += 1
            continue
        for row in found:
            interval = f" ({row.interval})" if row.interval else ""
            print(f"{row.row:60} {number(row.value):>9} {row.unit:8} {row.against:32} {row.verdict():7}{interval}")
            sys.stdout.flush()
        rows += found
    if not quick:
        write_results(benchmark, rows)
    sys.exit(1 if failed else 0)


def end(process: Any, limit: float = 20.0) -> None:
    """Ends a process: SIGTERM, and SIGKILL after the limit (s)."""
    process.terminate()
    try:
        process.wait(limit)
    except Exception:
        process.kill()
        process.wait()
