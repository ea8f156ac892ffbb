"""Each example below 20 runs with small arguments and draws its picture into the given folder. Those from 20 on need
more time or other packages: they have their own tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted(path for path in (Path(__file__).resolve().parents[1] / "examples").glob("[01][0-9]_*.py"))
SMALL = {
    "09_many_people": ["--people", "2"],
    "10_own_person": ["--seeds", "1"],
    "13_timings": ["--people", "1"],
}
"""arguments that make an example quick"""


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_draws_its_picture(example: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(example), "--out", str(tmp_path), *SMALL.get(example.stem, [])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]
    picture = tmp_path / f"{example.stem}.png"
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n" and picture.stat().st_size > 5000, done.stdout
