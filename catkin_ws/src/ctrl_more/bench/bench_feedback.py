#!/usr/bin/python3
"""Figures of the feedback framework as a JSON list: guard, real time, fuzzing, loading.

Definitions. Update of one of 100 controllers: time of a cycle over 100, median of 150 blocks of 400 cycles, which
alternate between all kinds; none left out. Each controller reads an IMU and changes a pose, with bounds on size and
rate, judged in each cycle, timed and recorded for attribution; beside it updates without bounds, timed and not. Their
ratios to a bare loop keep the goals that were asked, 3.5 and with the time 12. 100 ns is a told figure: of a public
implementation of 2017 without a guard, which is not measured here, and is no peer. Free-running cycles: those of the
real-time test, with plans, orders, gains and faults changed meanwhile; what could not be counted makes its row missed.
System calls are counted there by name; that there are no others the kernel says, in 20000 cycles of ten controllers
without times and records, in which any call would kill. Without its word the row is missed. Fuzzing: every file is
written, and loaded as list, as gains of a controller that runs, and as the configuration of a new one; a third of them
is meant for each way, which comes first. Half are a good one but for one word, the others are spoilt at random. Taken
or refused, it counts: what is refused, with a sentence, leaves names, order, profiles and gains as they were; of what
is taken, all that it lists is there, and gains and configuration have the same numbers of the same file. After each
load the controller that runs is stepped and looked at. Loading: 100 libraries, median of 7 runs of each kind in turn.
"""

from __future__ import annotations

import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PLUGINS = 100
FILES = 102000
"""for the fuzzing test, which takes fewer among the other tests"""
PLACEHOLDER = b"BenchPlug#000"


def workspace_lib() -> Path:
    """Folder with the built core library."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        if prefix and (Path(prefix) / "lib" / "libctrl_more.so").is_file():
            return Path(prefix) / "lib"
    sys.exit("ctrl_more is not built: source the workspace's setup file first")


def run(*command: str | Path, **more: str) -> str:
    """Output of a program, with more in its environment; ends the bench with its words if it fails."""
    result = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, timeout=600, env={**os.environ, **more}
    )
    if result.returncode != 0:
        sys.exit(f"{command[0]} failed ({result.returncode}): {result.stderr[-500:]}")
    return result.stdout


def row(
    figure: str,
    value: float,
    unit: str,
    goal: float | None,
    peer: str | None = None,
    peer_value: float | None = None,
    at_least: bool = False,
) -> dict:
    """One figure; better is smaller, unless it has to be at least the goal. No goal: reported."""
    met = goal is None or (value >= goal if at_least else value <= goal)
    return {
        "bench": "feedback",
        "figure": figure,
        "value": round(value, 4),
        "unit": unit,
        "goal": "reported" if goal is None else f"{'>=' if at_least else '<='} {goal:g}",
        "peer": peer,
        "peer_value": None if peer_value is None else round(peer_value, 4),
        "ok": met,
    }


def guard_rows(binaries: Path) -> list[dict]:
    """100 controllers that read an IMU and change a pose, as they run on a robot: bounds on size, rate, angle and its
    rate, judged in each cycle, timed, and recorded for attribution; without each of it beside. Median of the blocks.

    A cycle has 5 ms: 100 ns each is the goal, whatever the share of the guard in it; and the goals of that share stand.
    """
    data = json.loads(run(binaries / "ctrl_more_bench_controllers"))
    if data["faults"]:
        sys.exit("the bench's own controllers were faulted")
    if data["attributed"] != data["controllers"]:
        sys.exit(f"corrections of {data['attributed']} of {data['controllers']} controllers were recorded")
    floor = data["unguarded_ns"]
    bare = "the same controllers called in a bare loop [ns each]"
    whole = "bounded, judged, timed and attributed"
    kinds = (  # name, key, goal of the ratio
        (f"{whole} update", "bounded_ns", None),
        ("guarded and timed update without bounds", "timed_ns", 12),
        ("guarded update without bounds and time", "guarded_ns", 3.5),
    )
    return [row(f"{name} of one of 100; {TOLD}", data[key], "ns", 100) for name, key, _ in kinds] + [
        row(f"{name} / unguarded update of one of 100", data[key] / floor, "1", goal, bare, floor)
        for name, key, goal in kinds
    ]


TOLD = "the goal was told for a public implementation of 2017 without guard, not measured here"


def realtime_rows(binaries: Path) -> list[dict]:
    """The counters of the real-time test, with services working meanwhile, and the kernel's word on system calls.

    The test fails where a counter is not 0: that is a missed row, and no end of the bench.
    """
    result = subprocess.run(
        [str(binaries / "ctrl_more_test_realtime"), "--gtest_filter=Realtime.*"],
        capture_output=True,
        text=True,
        timeout=600,
    )
    rows = counted_rows(result.stdout)
    if result.returncode != 0 and all(each["ok"] for each in rows):
        sys.exit(f"the real-time test failed ({result.returncode}): {result.stdout[-500:]}")
    return rows


def without_kernel(text: str) -> str:
    """Why the run in which any system call kills proves nothing; empty where it does."""
    found = re.search(r"^\[ +(OK|SKIPPED|FAILED) +\] Realtime\.CyclesRunWhereSystemCallsKill", text, re.MULTILINE)
    reasons = {"OK": "", "SKIPPED": "was skipped: no seccomp here", "FAILED": "was killed by a call, or failed"}
    return reasons[found.group(1)] if found else "did not run"


def missed(figure: str) -> dict:
    """A row of something of which there should be none, and of which nothing is known."""
    return {**row(figure, 0.0, "1", 0.0), "value": None, "ok": False}


def counted_rows(text: str) -> list[dict]:
    """The rows of what the real-time test has printed."""
    names = (
        "cycles",
        "plans adopted",
        "reorders",
        "reloads",
        "faults",
        "allocations",
        "locks",
        "syscalls",
        "allocations of throws",
    )
    found = re.search(", ".join(rf"{name} (\d+)" for name in names), text)
    if not found:
        return [missed("allocations, locks and system calls in free-running cycles; could not be counted here")]
    count = dict(zip(names, map(int, found.groups()), strict=True))
    what = f"in {count['cycles']} free-running cycles"
    why = without_kernel(text)
    calls = missed(f"{SYSTEM_CALLS} {what}: {count['syscalls']} of those by name; the run under seccomp {why}")
    return [
        row("free-running cycles of the real-time test", count["cycles"], "1", 1e5, at_least=True),
        row(f"plan changes adopted {what}", count["plans adopted"], "1", 1e4, at_least=True),
        row(f"changes of the order among the plan changes adopted {what}", count["reorders"], "1", 1, at_least=True),
        row(f"reloads of gains among the plan changes adopted {what}", count["reloads"], "1", 1, at_least=True),
        row(f"faults {what}", count["faults"], "1", 1, at_least=True),
        row(f"allocations {what}", count["allocations"], "1", 0),
        row(f"locks {what}", count["locks"], "1", 0),
        calls if why else row(f"{SYSTEM_CALLS} {what}", count["syscalls"], "1", 0),
        row(f"allocations of the C++ runtime at throws {what}", count["allocations of throws"], "1", None),
    ]


SYSTEM_CALLS = "system calls (signals, reads, writes, sleeps, yields; any, by seccomp, in a run of its own)"


def fuzz_rows(binaries: Path) -> list[dict]:
    """Files that are written and loaded in each of three ways, half of them a good one but for one word, the rest
    spoilt at random. With fewer looks at what runs than loads the row is missed."""
    text = run(binaries / "ctrl_more_test_config_fuzz", CTRL_MORE_FUZZ_FILES=str(FILES))
    found = re.search(
        r"files written (\d+), near-valid (\d+), each loaded in (\d+) ways, looks at what runs (\d+), "
        r"taken as list (\d+), gains (\d+), configuration (\d+)",
        text,
    )
    if not found:
        sys.exit("the fuzzing test printed no figures")
    files, near, ways, looks, as_list, as_gains, as_configuration = map(int, found.groups())
    figure = (
        f"files written, {near} of them near-valid, each loaded as list, as gains and as configuration, of which none "
        f"was taken by half; what runs kept running after each of {looks} loads; taken as list {as_list}, "
        f"as gains {as_gains}, as configuration {as_configuration}"
    )
    fine = ways == 3 and looks == ways * files and 2 * near >= files
    fuzzed = row(figure, files, "1", 1e5, at_least=True)
    return [{**fuzzed, "ok": fuzzed["ok"] and fine}]


def thread_sanitizer_rows() -> list[dict]:
    """Services against the cycle for 60 s, built for ThreadSanitizer; a campaign (--long)."""
    test = Path(__file__).resolve().parent.parent / "test" / "test_thread_sanitizer.py"
    if not os.environ.get("COGLAB_LONG") or not test.is_file():
        return []
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(test)],
        capture_output=True,
        text=True,
        timeout=3600,
    )
    if "1 passed" not in result.stdout and "data race" not in result.stdout:
        sys.exit(f"the campaign did not run: {result.stdout[-500:]}")
    return [
        row(
            "ThreadSanitizer: services against the cycle for 60 s, first finding ends it",
            0 if "1 passed" in result.stdout else 1,
            "findings",
            0,
        )
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
                values.append(float(run(binaries / "ctrl_more_bench_loading", kind, Path(folder) / kind)))
    ours, bare = statistics.median(times["ours"]), statistics.median(times["bare"])
    figure = f"time of loading {PLUGINS} plug-ins / with bare class_loader, ratio of the medians of 7 runs each"
    return [row(figure, ours / bare, "1", 2, "bare class_loader [ms]", bare)]


def main() -> None:
    """Prints the rows."""
    lib = workspace_lib()
    binaries = lib / "ctrl_more"
    rows = guard_rows(binaries) + realtime_rows(binaries) + fuzz_rows(binaries) + loading_rows(lib, binaries)
    rows += thread_sanitizer_rows()
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
