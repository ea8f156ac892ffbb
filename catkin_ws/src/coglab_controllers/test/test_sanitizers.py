"""Requests against the control thread under the sanitizers (a campaign: COGLAB_LONG=1)."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
SOURCES = PACKAGE.parent
LIBRARIES = ["-lorocos-kdl", "-lkdl_parser", "-ltinyxml2", "-lyaml-cpp", "-lpthread", "-ldl"]


def sources() -> list[Path]:
    """Sources of manager, plug-ins and their dependencies, without ROS."""
    own = [
        p
        for p in sorted((PACKAGE / "src").rglob("*.cpp"))
        if p.parent.name not in ("ros", "python") and not p.stem.endswith("_ros")
    ]
    return own + sorted((SOURCES / "ctrl_more" / "src").rglob("*.cpp"))


def compiled(command: list[str]) -> None:
    """Runs the compiler; fails with its output."""
    built = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert built.returncode == 0, built.stderr[-3000:]


def run(command: list[str], limit: float) -> None:
    """Runs an instrumented program; fails with the sanitizer's report."""
    result = subprocess.run(
        ["setarch", os.uname().machine, "-R", *command],
        env=dict(
            os.environ,
            TSAN_OPTIONS="halt_on_error=1 exitcode=66",
            UBSAN_OPTIONS="halt_on_error=1",
            ASAN_OPTIONS="detect_leaks=1",
        ),
        capture_output=True,
        text=True,
        timeout=limit,
    )
    assert result.returncode == 0, (result.stdout + result.stderr)[-4000:]


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
@pytest.mark.parametrize("sanitizer", ["thread", "address,undefined"])
def test_requests_against_the_control_thread_and_exceptions_of_plugins(sanitizer: str, tmp_path: Path) -> None:
    seconds = os.environ.get("COGLAB_SANITIZER_SECONDS", "60")
    objects = []
    includes = [f"-I{SOURCES / name / 'include'}" for name in ("coglab_controllers", "coglab_rt", "ctrl_more")]
    includes += [f"-I{SOURCES / 'ctrl_more' / 'src'}", "-isystem/usr/include/eigen3"]
    flags = ["-std=c++17", "-O1", "-g1", f"-fsanitize={sanitizer}", "-fno-omit-frame-pointer"]
    for source in sources():
        objects.append(tmp_path / f"{len(objects)}_{source.stem}.o")
        compiled(["g++", *flags, "-c", str(source), "-o", str(objects[-1]), *includes])
    for program in (
        PACKAGE / "test" / "thread_stress.cpp",
        PACKAGE / "test" / "plugin_exceptions.cpp",
        SOURCES / "ctrl_more" / "tools" / "probe.cpp",
    ):
        compiled(
            [
                "g++",
                *flags,
                "-rdynamic",
                str(program),
                "-o",
                str(tmp_path / ("ctrl_more_probe" if program.stem == "probe" else program.stem)),
                *map(str, objects),
                *includes,
                *LIBRARIES,
            ]
        )
    # Without unique symbols the library is really unmapped when it is unloaded.
    plugin = tmp_path / "libown_exception.so"
    compiled(
        [
            "g++",
            *flags,
            "-fPIC",
            "-shared",
            "-fno-gnu-unique",
            str(PACKAGE / "test/plugins/own_exception.cpp"),
            "-o",
            str(plugin),
            *includes,
        ]
    )
    description = str(SOURCES / "lwr_description")
    run([str(tmp_path / "plugin_exceptions"), str(plugin), description], 120.0)
    run([str(tmp_path / "thread_stress"), seconds, str(PACKAGE), description], float(seconds) * 5 + 120)
