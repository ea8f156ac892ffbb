"""The gtests of the bridge, and of coglab_rt on which it stands, under the sanitizers (a campaign: COGLAB_LONG=1).

Left out are the rooms that need ROS, `real_time`, which would count the system calls of a sanitizer too, and LEFT_OUT:
a sanitizer grants mlockall itself, and takes part of each thread's stack.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
GROUND = PACKAGE.parent / "coglab_rt"
LIMITS = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"
WITHOUT = {"ros", "with_master", "without_master", "real_time"}
LEFT_OUT = "FriThreadRights.*:BoundedThread.TheStackBelowTheBodyIsTouchedBeforeItRuns"
THREADS = ("std::thread", "BoundedThread", "FriThread", "shortest_arm.hpp")


def compiled(*arguments: object) -> None:
    """Runs the compiler, which must succeed."""
    built = subprocess.run(["g++", *map(str, arguments)], capture_output=True, text=True, timeout=900)
    assert built.returncode == 0, built.stderr[-3000:]


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
@pytest.mark.parametrize("sanitizer", ["thread", "address,undefined"])
def test_the_gtests_under_a_sanitizer(sanitizer: str, tmp_path: Path) -> None:
    flags = ["-std=c++17", "-O1", "-g1", f"-fsanitize={sanitizer}", "-fno-omit-frame-pointer"]
    flags += [f"-I{PACKAGE / 'include'}", f"-I{GROUND / 'include'}", f"-I{GROUND}", f"-I{PACKAGE / 'test'}"]
    flags += ["-isystem/usr/include/eigen3", f'-DLIMITS_FILE="{LIMITS}"']
    sources = [path for path in sorted((PACKAGE / "src").rglob("*.cpp")) if path.parent.name != "ros"]
    tests = [path for package in (GROUND, PACKAGE) for path in sorted((package / "test").glob("*/test_*.cpp"))]
    tests = [path for path in tests if path.parent.name not in WITHOUT]
    assert len(sources) > 10 and len(tests) > 15
    if sanitizer == "thread":  # the others have none
        tests = [path for path in tests if any(word in path.read_text(encoding="utf-8") for word in THREADS)]
        assert len(tests) >= 4
    library = tmp_path / "libbridge.a"
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda path: compiled(*flags, "-c", path, "-o", tmp_path / f"{path.stem}.o"), sources))
        subprocess.run(["ar", "cr", library, *(tmp_path / f"{path.stem}.o" for path in sources)], check=True)
        libraries = [library, "-lyaml-cpp", "-lgtest_main", "-lgtest", "-lpthread", "-ldl"]
        list(pool.map(lambda path: compiled(*flags, path, "-o", tmp_path / path.stem, *libraries), tests))
    found = []
    options = {"TSAN_OPTIONS": "halt_on_error=1 exitcode=66", "UBSAN_OPTIONS": "halt_on_error=1"}
    for path in tests:
        result = subprocess.run(
            ["setarch", os.uname().machine, "-R", tmp_path / path.stem, f"--gtest_filter=-{LEFT_OUT}"],
            env=os.environ | options,
            capture_output=True,
            text=True,
            timeout=1800,
        )
        if result.returncode != 0:
            found.append(f"{path.stem}: {(result.stdout + result.stderr)[-4000:]}")
    assert not found, "\n".join(found)
