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
# Debian keeps class_loader and what it includes in folders of their own.
FOLDERS = ["eigen3", "class_loader", "rcpputils", "rcutils", "ament_index_cpp"]


def sources() -> list[Path]:
    """The cores of manager and plug-ins with what they stand on; no ROS."""
    own = [p for p in sorted((PACKAGE / "src").rglob("*.cpp"))
           if p.parent.name not in ("ros", "python") and not p.stem.endswith("_ros")]
    bridge = [SOURCES / "lwr_fri_bridge" / "src" / name for name in ("joint_limits.cpp", "real_time.cpp",
                                                                     "events.cpp", "supervisor.cpp")]
    return own + sorted((SOURCES / "ctrl_more" / "src").glob("*.cpp")) + bridge


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
@pytest.mark.parametrize("sanitizer", ["thread", "address,undefined"])
def test_requests_against_the_control_thread(sanitizer: str, tmp_path: Path) -> None:
    seconds = os.environ.get("COGLAB_SANITIZER_SECONDS", "60")
    program = tmp_path / "thread_stress"
    objects = []
    includes = [f"-I{SOURCES / name / 'include'}" for name in ("coglab_controllers", "ctrl_more", "lwr_fri_bridge")]
    includes += [f"-I{SOURCES / 'ctrl_more' / 'src'}", *(f"-isystem/usr/include/{folder}" for folder in FOLDERS)]
    loaders = sorted(map(str, Path("/usr/lib").glob("*/libclass_loader.so*")))
    assert loaders, "libclass-loader-dev is not installed"
    flags = ["-std=c++17", "-O1", "-g1", f"-fsanitize={sanitizer}", "-fno-omit-frame-pointer"]
    for source in [*sources(), PACKAGE / "test" / "thread_stress.cpp"]:
        objects.append(tmp_path / f"{len(objects)}_{source.stem}.o")
        built = subprocess.run(["g++", *flags, "-c", str(source), "-o", str(objects[-1]), *includes],
                               capture_output=True, text=True, timeout=600)
        assert built.returncode == 0, built.stderr[-3000:]
    built = subprocess.run(["g++", *flags, "-o", str(program), *map(str, objects), loaders[-1], *LIBRARIES],
                           capture_output=True, text=True, timeout=600)
    assert built.returncode == 0, built.stderr[-3000:]
    result = subprocess.run(
        ["setarch", os.uname().machine, "-R", str(program), seconds, str(PACKAGE), str(SOURCES / "lwr_description")],
        env=dict(os.environ, TSAN_OPTIONS="halt_on_error=1 exitcode=66", UBSAN_OPTIONS="halt_on_error=1",
                 ASAN_OPTIONS="detect_leaks=1"),
        capture_output=True, text=True, timeout=float(seconds) * 5 + 120,
    )
    assert result.returncode == 0, (result.stdout + result.stderr)[-4000:]
