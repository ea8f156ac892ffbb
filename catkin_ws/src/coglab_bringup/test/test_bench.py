"""The table of figures must not lie: a bench that fails after its rows is red."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest
from coglab_bringup.bench import COLUMNS, main, run_bench
from coglab_bringup.test_runner import Program, find_programs, wall_times

WALL = Path(__file__).resolve().parents[1] / "bench" / "bench_wall.py"
ROW = dict(zip(COLUMNS, ("x", "speed", 1.0, "m/s", "> 0", None, None, True), strict=True))
PRINT_ROW = f"print({json.dumps([ROW])!r}, flush=True)"


@pytest.mark.parametrize(
    "script, oks, words",
    [
        (PRINT_ROW, [True], ""),
        (f"{PRINT_ROW}; raise SystemExit('the peer died')", [True, False], "exit status 1: the peer died"),
        (f"{PRINT_ROW}; import os; os.kill(os.getpid(), 11)", [True, False], "exit status 139"),
        ("print('[]')", [False], "no row"),
        ("print('fine')", [False], "no list of rows"),
        ("import time; time.sleep(60)", [False], "no end within"),
    ],
)
def test_rows_and_status(tmp_path, script, oks, words):
    path = tmp_path / "bench_x.py"
    path.write_text(script)
    rows = run_bench("x", path, "/usr/bin/python3", 0.5 if "sleep" in script else 60.0)
    assert [row["ok"] for row in rows] == oks, rows
    assert words in rows[-1]["figure"]


def test_an_unknown_name(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("COGLAB_TOP", str(tmp_path))
    assert main(["nosuch"]) == 2
    assert "no bench named nosuch" in capsys.readouterr().err


@pytest.fixture
def bench_wall():
    """The bench as a module."""
    spec = importlib.util.spec_from_file_location("bench_wall", WALL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_wall_time_that_was_not_measured_is_missed_not_zero(bench_wall):
    demo = {"install_s": 70.0, "build_s": 300.0, "run_s": 30.0, "installed": "120 of 140"}
    figure, value = bench_wall.first_demo({"demo_from_nothing": demo})
    assert value == 400.0 and "installation 70 s, build 300 s, first demo 30 s; 120 of 140 packages" in figure
    for name in ("install_s", "build_s", "run_s"):
        for absent in (0.0, None):
            figure, value = bench_wall.first_demo({"demo_from_nothing": {**demo, name: absent}})
            assert value is None and "not measured here" in figure
            row = bench_wall.row(figure, value, 600)
            assert row["value"] is None and not row["ok"]
    apart = {"setup": {"install_s": 70.0, "build_s": 300.0}, "first_demo": {"run_s": 30.0}, "last_demo": demo}
    assert bench_wall.first_demo(apart)[1] is None, "parts of several commands are no sum"
    assert bench_wall.first_demo({})[1] is None
    said = "from `controller new --motion` to an arm that has moved: 21.4 s, of them to build 15.0 s\n"
    assert bench_wall.new_motion(said + "1 passed, 1 deselected in 25 s") == 21.4
    for output in ("", said + "1 failed in 25 s", "1 skipped"):
        assert bench_wall.new_motion(output) is None


@pytest.mark.parametrize("group", ["COMBINED", "WORLD"])
def test_what_named_programs_add_is_the_sum_of_all_of_them_or_missed(bench_wall, group):
    programs = getattr(bench_wall, group)
    names = [bench_wall.program_of(package, name) for package, all_of in programs.items() for name in all_of]
    times = {"last_test": {"programs": {**dict.fromkeys(names, 1.5), "coglab_sim/test_wire.py": 100.0}}}
    figure, value = bench_wall.added(times, programs, "it")
    assert value == 1.5 * len(names) and f"{len(names)} programs" in figure
    del times["last_test"]["programs"][names[3]]
    for known in (times, {"last_test": {}}, {}):
        figure, value = bench_wall.added(known, programs, "it")
        assert value is None and not bench_wall.row(figure, value, 45.0)["ok"]


@pytest.mark.parametrize("group", ["COMBINED", "WORLD"])
def test_every_program_that_is_named_is_one_that_the_test_run_finds(bench_wall, tmp_path, group):
    top = Path(__file__).resolve().parents[4]
    found = wall_times(find_programs(top, tmp_path, sys.executable, []))
    named = {
        bench_wall.program_of(package, name) for package, names in getattr(bench_wall, group).items() for name in names
    }
    assert named - set(found) == set()


def test_programs_that_run_beside_each_other_share_the_time():
    alone = Program("p", "rostest", "a.test", [], Path("x"), began=100.0, seconds=10.0)
    beside = [Program("p", "gtest", f"p_test_{name}", [], Path("x"), began=110.0, seconds=10.0) for name in "bc"]
    assert wall_times([alone, *beside]) == {"p/a.test": 10.0, "p/p_test_b": 5.0, "p/p_test_c": 5.0}
    # The first 6 s with two others, the next 3 s with one; what waits between runs adds nothing.
    overlapping = [
        Program("p", "rostest", name, [], Path("x"), began=200.0 + begin, seconds=seconds)
        for name, begin, seconds in (("d", 0.0, 6.0), ("e", 0.0, 9.0), ("f", 0.0, 9.0), ("g", 20.0, 1.0))
    ]
    assert wall_times(overlapping) == {"p/d": 2.0, "p/e": 3.5, "p/f": 3.5, "p/g": 1.0}


def test_the_final_error_of_the_demo_is_a_row_of_each_direction_and_missed_where_nobody_measured_it(bench_wall):
    truth, receive, give = "truth of the simulated cell", *bench_wall.KINDS
    one = {"kind": receive, "final_error_mm": 13.9, "final_error_by": truth}
    other = {"kind": give, "final_error_mm": None, "final_error_by": "nobody: no reach began"}
    rows = bench_wall.final_errors({"seed": 7, "handovers": [one, other]})
    assert [(row["value"], row["unit"], row["ok"]) for row in rows] == [(13.9, "mm", True), (None, "mm", False)]
    assert all("final_error_mm" in row["figure"] and "seed 7" in row["figure"] for row in rows)
    assert truth in rows[0]["figure"] and "no reach began" in rows[1]["figure"]
    assert [row["ok"] for row in bench_wall.final_errors({"seed": 7, "handovers": []})] == [False, False]


def test_a_time_of_other_sources_was_not_measured_on_these(bench_wall):
    demo = {"install_s": 70.0, "build_s": 300.0, "run_s": 30.0}
    names = [bench_wall.program_of(package, name) for package, all_of in bench_wall.WORLD.items() for name in all_of]
    test = {"total_s": 600.0, "programs": dict.fromkeys(names, 1.0)}
    for of, now, known in (("a", "a", True), ("b", "a", False), ("", "", False), ("", "a", False), (None, "a", False)):
        word = {} if of is None else {"sources": of}
        times = bench_wall.of_sources({"demo_from_nothing": demo | word, "last_test": test | word}, now)
        assert (bench_wall.first_demo(times)[1] == 400.0) is known
        assert (bench_wall.added(times, bench_wall.WORLD, "it")[1] is not None) is known
        value = bench_wall.whole_test(times)
        assert (value == 600.0) is known and bench_wall.row("tests", value, 900)["ok"] is known
    half = bench_wall.of_sources(
        {"demo_from_nothing": demo | {"sources": "b"}, "last_test": test | {"sources": "a"}}, "a"
    )
    assert bench_wall.first_demo(half)[1] is None and bench_wall.whole_test(half) == 600.0
