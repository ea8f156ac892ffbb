"""The table of figures must not lie: a bench that fails after its rows is red."""

import json

import pytest
from coglab_bringup.bench import COLUMNS, main, run_bench

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
