"""Services against the control cycle under ThreadSanitizer (a campaign: COGLAB_LONG=1)."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_services_against_the_cycle(tmp_path: Path) -> None:
    seconds = os.environ.get("CTRL_MORE_TSAN_SECONDS", "60")
    sources = [*sorted((PACKAGE / "src").rglob("*.cpp")), PACKAGE / "test" / "thread_stress.cpp"]
    program = tmp_path / "thread_stress"
    built = subprocess.run(
        [
            "g++",
            "-std=c++17",
            "-O1",
            "-g",
            "-fsanitize=thread",
            "-o",
            str(program),
            *map(str, sources),
            f"-I{PACKAGE / 'include'}",
            f"-I{PACKAGE / 'src'}",
            f"-I{PACKAGE.parent / 'coglab_rt' / 'include'}",
            "-I/usr/include/eigen3",
            "-lyaml-cpp",
            "-lpthread",
            "-ldl",
        ],
        capture_output=True,
        text=True,
        timeout=1800,
    )
    assert built.returncode == 0, built.stderr[-3000:]
    result = subprocess.run(
        ["setarch", os.uname().machine, "-R", str(program), seconds],
        env=dict(os.environ, TSAN_OPTIONS="halt_on_error=1 exitcode=66"),
        capture_output=True,
        text=True,
        timeout=float(seconds) * 5 + 120,
    )
    assert result.returncode == 0, (result.stdout + result.stderr)[-4000:]
