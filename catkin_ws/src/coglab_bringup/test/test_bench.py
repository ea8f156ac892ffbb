"""The table of figures must not lie: a bench that fails after its rows is red."""

import importlib.util
import json
from pathlib import Path

import pytest
from coglab_bringup.bench import COLUMNS, main, run_bench

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


def test_a_wall_time_that_was_not_measured_is_missed_not_zero():
    spec = importlib.util.spec_from_file_location("bench_wall", WALL)
    bench_wall = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(bench_wall)
    measured = {"setup": {"install_s": 70.0, "build_s": 300.0}, "first_demo": {"run_s": 30.0}}
    figure, value = bench_wall.first_demo(measured)
    assert value == 400.0 and "installation 70 s, build 300 s, first demo 30 s" in figure
    for part, name in (("setup", "install_s"), ("setup", "build_s"), ("first_demo", "run_s")):
        for absent in (0.0, None):
            times = {**measured, part: {**measured[part], name: absent}}
            figure, value = bench_wall.first_demo(times)
            assert value is None and "not measured here" in figure
            row = bench_wall.row(figure, value, 600)
            assert row["value"] is None and not row["ok"]
    assert bench_wall.first_demo({})[1] is None
    said = "from `controller new --motion` to an arm that has moved: 21.4 s, of them to build 15.0 s\n"
    assert bench_wall.new_motion(said + "1 passed, 1 deselected in 25 s") == 21.4
    for output in ("", said + "1 failed in 25 s", "1 skipped"):
        assert bench_wall.new_motion(output) is None
