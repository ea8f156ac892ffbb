"""The numbered examples run and draw their plots; the stubs are typed; both against the built module."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((PACKAGE / "examples").glob("[0-9][0-9]_*.py"))


def test_examples_are_numbered_and_have_their_plot() -> None:
    assert [int(e.name[:2]) for e in EXAMPLES] == list(range(1, len(EXAMPLES) + 1)) and len(EXAMPLES) >= 6
    for example in EXAMPLES:
        assert example.with_suffix(".png").stat().st_size > 5000


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda e: e.stem)
def test_example_runs_and_plots(example: Path, tmp_path: Path) -> None:
    result = subprocess.run([sys.executable, str(example), str(tmp_path)], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr[-2000:]
    assert (tmp_path / (example.stem + ".png")).stat().st_size > 5000


@pytest.mark.skipif(shutil.which("mypy") is None, reason="mypy is not installed")
def test_stubs_satisfy_mypy() -> None:
    stub = PACKAGE / "src" / "coglab_controllers" / "_core.pyi"
    result = subprocess.run(
        ["mypy", "--strict", "--no-error-summary", "--follow-imports=skip", str(stub)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stdout
