#!/usr/bin/python3
"""Figures of the feedback framework as a JSON list: guard, real time, loading.

Run with the workspace's environment. Ratios come from interleaved blocks or runs of one
invocation, minimum over blocks; nanoseconds are printed beside, for orientation.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

PLUGINS = 100
PLACEHOLDER = b"BenchPlug#000"


def workspace_lib() -> Path:
    """Folder with the built core library."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        if prefix and (Path(prefix) / "lib" / "libctrl_more.so").is_file():
            return Path(prefix) / "lib"
    sys.exit("ctrl_more is not built: source the workspace's setup file first")


def run(*command: str | Path) -> str:
    """Output of a program; ends the bench with its words if it fails."""
    result = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, timeout=600
    )
    if result.returncode != 0:
        sys.exit(f"{command[0]} failed ({result.returncode}): {result.stderr[-500:]}")
    return result.stdout


def row(figure: str, value: float, unit: str, goal: float, peer: str | None,
        peer_value: float | None) -> dict:
    """One figure; better is smaller."""
    return {
        "bench": "feedback", "figure": figure, "value": round(value, 4), "unit": unit,
        "goal": f"<= {goal:g}", "peer": peer,
        "peer_value": None if peer_value is None else round(peer_value, 4),
        "ok": value <= goal,
    }


def guard_rows(binaries: Path) -> list[dict]:
    """Guarded and guarded + timed against the same controllers without a guard."""
    data = json.loads(run(binaries / "ctrl_more_bench_controllers"))
    if data["faults"]:
        sys.exit("the bench's own controllers were faulted")
    floor = data["unguarded_ns"]
    rows = [
        row("guarded / unguarded update, N = 100", data["guarded_ns"] / floor, "1", 3.5,
            "the same controllers called without a guard [ns each]", floor),
        row("guarded and timed / unguarded update, N = 100", data["timed_ns"] / floor, "1", 12,
            "the same controllers called without a guard [ns each]", floor),
        row("guarded update, N = 100", data["guarded_ns"], "ns", 100,
            "published framework, measured elsewhere [ns each]", 100),
    ]
    return rows


def realtime_rows(binaries: Path) -> list[dict]:
    """The counters of the real-time test, with services working meanwhile."""
    text = run(binaries / "ctrl_more_test_realtime", "--gtest_filter=Realtime.nothing*")
    found = re.search(
        r"cycles (\d+), plans adopted (\d+), faults (\d+), allocations (\d+), locks (\d+), "
        r"syscalls (\d+), allocations of throws (\d+)", text)
    if not found:
        sys.exit("the real-time test printed no figures")
    cycles, plans, faults, allocations, locks, syscalls, throws = map(int, found.groups())
    what = f"in {cycles} free-running cycles with {plans} plans adopted"
    return [
        row(f"allocations {what}", allocations, "1", 0, None, None),
        row(f"locks {what}", locks, "1", 0, None, None),
        row(f"system calls {what}", syscalls, "1", 0, None, None),
        row(f"allocations of the C++ runtime per throw, {faults} faults seen by services",
            throws, "1", float("inf"), None, None) | {"goal": "reported"},
    ]


def copies(library: Path, folder: Path) -> None:
    """PLUGINS copies of a library, each with a type name of its own."""
    content = library.read_bytes()
    if content.count(PLACEHOLDER) < 1:
        sys.exit(f"{library} has no type name to change")
    for index in range(PLUGINS):
        name = b"BenchPlug#%03d" % index
        (folder / f"lib{index:03d}.so").write_bytes(content.replace(PLACEHOLDER, name))


def loading_rows(lib: Path, binaries: Path) -> list[dict]:
    """Loading PLUGINS libraries through a manager and through bare class_loader, in turn."""
    times: dict[str, list[float]] = {"ours": [], "bare": []}
    with tempfile.TemporaryDirectory() as folder:
        for kind in times:
            (Path(folder) / kind).mkdir()
            copies(lib / f"libctrl_more_bench_plugin_{kind}.so", Path(folder) / kind)
        for _ in range(7):
            for kind, values in times.items():
                values.append(float(run(binaries / "ctrl_more_bench_loading", kind,
                                        Path(folder) / kind)))
    ours, bare = min(times["ours"]), min(times["bare"])
    return [row(f"loading {PLUGINS} plug-ins / bare class_loader", ours / bare, "1", 2,
                "bare class_loader [ms]", bare)]


def main() -> None:
    """Prints the rows."""
    lib = workspace_lib()
    binaries = lib / "ctrl_more"
    rows = guard_rows(binaries) + realtime_rows(binaries) + loading_rows(lib, binaries)
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
