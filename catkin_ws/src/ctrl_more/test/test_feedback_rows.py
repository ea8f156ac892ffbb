"""The rows of ./coglab bench feedback: ratios keep the goals that were asked, what was told elsewhere is no measured
peer, system calls are judged only where the kernel has watched, and fuzzing says in which ways it loads, and is missed
where what runs was not looked at after each load."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_feedback

TIMES = {"unguarded_ns": 4.0, "guarded_ns": 40.0, "timed_ns": 60.0, "bounded_ns": 90.0}
COUNTED = (
    "cycles 100000, plans adopted 10000, reorders 9, reloads 9, faults 2, allocations 0, locks 0, syscalls {}, "
    "allocations of throws 4\n"
)
PASSED = "[       OK ] Realtime.CyclesRunWhereSystemCallsKill (9 ms)\n"
SKIPPED = (
    "test_realtime.cpp:1: Skipped\nno seccomp here\n\n[  SKIPPED ] Realtime.CyclesRunWhereSystemCallsKill (1 ms)\n"
)
KILLED = "[  FAILED  ] Realtime.CyclesRunWhereSystemCallsKill (9 ms)\n"


def guard_rows(monkeypatch, **times: float) -> list[dict]:
    """The rows of these times."""
    data = {**TIMES, **times, "controllers": 100, "attributed": 100, "faults": 0}
    monkeypatch.setattr(bench_feedback, "run", lambda *_: json.dumps(data))
    return bench_feedback.guard_rows(Path())


def judged(rows: list[dict], goal: str) -> list[tuple[float, bool]]:
    """Value and verdict of the rows with that goal."""
    return [(row["value"], row["ok"]) for row in rows if row["goal"] == goal]


def test_ratios_are_judged_by_the_goals_that_were_asked(monkeypatch):
    rows = guard_rows(monkeypatch)
    assert judged(rows, "<= 3.5") == [(10.0, False)]
    assert judged(rows, "<= 12") == [(15.0, False)]
    assert judged(rows, "<= 100") == [(90.0, True), (60.0, True), (40.0, True)]
    assert [row["value"] for row in rows if row["goal"] == "reported"] == [22.5]
    rows = guard_rows(monkeypatch, guarded_ns=14.0, timed_ns=48.0, bounded_ns=100.1)
    assert judged(rows, "<= 3.5") == [(3.5, True)]
    assert judged(rows, "<= 12") == [(12.0, True)]
    assert judged(rows, "<= 100") == [(100.1, False), (48.0, True), (14.0, True)]


def test_a_told_figure_is_no_measured_peer(monkeypatch):
    rows = guard_rows(monkeypatch)
    assert all(row["peer_value"] in (None, TIMES["unguarded_ns"]) for row in rows)
    told = [row for row in rows if row["goal"] == "<= 100"]
    assert all(row["peer"] is None and "not measured here" in row["figure"] for row in told)


def system_calls(monkeypatch, text: str, status: int = 0) -> dict:
    """The row of system calls of a real-time test that printed this."""
    result = SimpleNamespace(stdout=text, stderr="", returncode=status)
    monkeypatch.setattr(bench_feedback.subprocess, "run", lambda *_, **__: result)
    (row,) = [row for row in bench_feedback.realtime_rows(Path()) if "system calls" in row["figure"]]
    return row


def test_system_calls_are_judged_where_the_kernel_has_watched(monkeypatch):
    row = system_calls(monkeypatch, COUNTED.format(0) + PASSED)
    assert row["ok"] and row["value"] == 0 and row["goal"] == "<= 0"
    row = system_calls(monkeypatch, COUNTED.format(3) + PASSED, status=1)
    assert not row["ok"] and row["value"] == 3


@pytest.mark.parametrize(
    "text, status, why",
    [(SKIPPED, 0, "no seccomp here"), ("", 0, "did not run"), (KILLED, 1, "killed")],
    ids=["skipped", "not run", "killed"],
)
def test_without_the_kernels_word_the_row_of_system_calls_is_missed_and_says_why(monkeypatch, text, status, why):
    row = system_calls(monkeypatch, COUNTED.format(0) + text, status)
    assert row["value"] is None and not row["ok"] and why in row["figure"]


def test_the_run_under_seccomp_is_among_what_is_run(monkeypatch):
    asked: list[str] = []

    def run(command, **_):
        asked.extend(map(str, command))
        return SimpleNamespace(stdout=COUNTED.format(0) + PASSED, stderr="", returncode=0)

    monkeypatch.setattr(bench_feedback.subprocess, "run", run)
    bench_feedback.realtime_rows(Path())
    filters = [word.partition("=")[2] for word in asked if word.startswith("--gtest_filter=")]
    assert filters == ["Realtime.*"]


def test_what_could_not_be_counted_makes_its_row_missed(monkeypatch):
    row = system_calls(monkeypatch, PASSED)
    assert row["value"] is None and not row["ok"]


def fuzz_row(monkeypatch, files: int, looks: int) -> tuple[dict, dict[str, str]]:
    """The row of a fuzzing test that printed this, and what it was given in its environment."""
    asked: dict[str, str] = {}
    text = (
        f"files written {files}, near-valid {files // 2}, each loaded in 3 ways, looks at what runs {looks}, "
        "taken as list 3, gains 4, configuration 5\n"
    )
    monkeypatch.setattr(bench_feedback, "run", lambda *_, **more: asked.update(more) or text)
    (row,) = bench_feedback.fuzz_rows(Path())
    return row, asked


def test_fuzzing_is_asked_for_as_many_files_as_its_row_needs_and_says_how_each_was_loaded(monkeypatch):
    row, asked = fuzz_row(monkeypatch, 102000, 306000)
    assert row["ok"] and row["value"] == 102000 and int(asked["CTRL_MORE_FUZZ_FILES"]) >= 1e5
    for words in ("51000 of them near-valid", "as list, as gains and as configuration", "each of 306000 loads",
                  "taken as list 3, as gains 4, as configuration 5"):  # fmt: skip
        assert words in row["figure"]


@pytest.mark.parametrize("files, looks", [(12000, 36000), (102000, 102000)], ids=["few files", "a look at each third"])
def test_fuzzing_of_fewer_files_or_with_fewer_looks_is_missed(monkeypatch, files, looks):
    assert not fuzz_row(monkeypatch, files, looks)[0]["ok"]
