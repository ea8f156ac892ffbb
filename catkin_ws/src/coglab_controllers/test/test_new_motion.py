"""A motion from the template: made, built in a separate workspace, tested, and executed by the simulated arm."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
TOOL = PACKAGE.parent / "ctrl_more" / "scripts" / "new_controller.py"


def run(*command: str | Path) -> str:
    """Runs a command with a time limit. Returns its output, which is shown if it fails."""
    done = subprocess.run(
        [str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=400
    )
    assert done.returncode == 0, done.stdout[-6000:]
    return done.stdout


def in_workspace(workspace: Path, *command: str | Path) -> str:
    """The same with the environment of that workspace on top of the sourced one."""
    words = " ".join(str(part) for part in command)
    return run("bash", "-c", f". {workspace}/devel/setup.bash && exec {words}")


def built_prefix() -> bool:
    """Whether a workspace with this package is sourced."""
    prefixes = os.environ.get("CMAKE_PREFIX_PATH", "").split(":")
    return any(p and (Path(p) / "lib" / "libcoglab_controllers_plugins.so").is_file() for p in prefixes)


def test_a_new_motion_is_built_tested_and_moves_the_simulated_arm(tmp_path: Path) -> None:
    if not built_prefix():
        pytest.fail("coglab_controllers is not built, or its workspace not sourced: ./coglab build, then ./coglab test")
    if not shutil.which("catkin_make") or not shutil.which("rostest"):
        pytest.skip("catkin_make or rostest is not installed: ./coglab install build test")
    sources = tmp_path / "src"
    sources.mkdir()
    begin = time.monotonic()
    made = run(sys.executable, TOOL, "--motion", "SideSway", "--into", sources)
    assert "catkin_make" in made
    folder = sources / "side_sway"
    left = [p for p in folder.rglob("*") if p.is_file() and ("@name@" in p.read_text() or "@TYPE@" in p.read_text())]
    assert not left, left
    built = run(
        "catkin_make", "-C", tmp_path, "-DPYTHON_EXECUTABLE=/usr/bin/python3", "-DCMAKE_BUILD_TYPE=RelWithDebInfo"
    )
    assert "warning:" not in built
    ready = time.monotonic()
    moved = in_workspace(tmp_path, "rostest", "side_sway", "side_sway.test")
    assert "RESULT: SUCCESS" in moved, moved[-6000:]
    end = time.monotonic()
    print(
        f"\nfrom `controller new --motion` to an arm that has moved: {end - begin:.1f} s, "
        f"of them to build {ready - begin:.1f} s"
    )
    ideal = in_workspace(tmp_path, "rostest", "side_sway", "side_sway.test", "arm:=ideal")
    assert "RESULT: SUCCESS" in ideal, ideal[-6000:]
    started = in_workspace(tmp_path, "roslaunch", "--nodes", "side_sway", "side_sway.launch", "arm:=ideal")
    assert started.split() == ["/robot"], "the simulated cell belongs to the arm behind FRI"
    run("catkin_make", "-C", tmp_path, "side_sway_test_motion")
    tested = in_workspace(tmp_path, tmp_path / "devel" / "lib" / "side_sway" / "side_sway_test_motion")
    assert "PASSED" in tested and "FAILED" not in tested


def test_wrong_names_and_places_are_refused(tmp_path: Path) -> None:
    for name in ("sideSway", "../Up"):
        done = subprocess.run(
            [sys.executable, TOOL, "--motion", name, "--into", tmp_path], capture_output=True, text=True
        )
        assert done.returncode == 1 and "CamelCase" in done.stderr
    assert not list(tmp_path.iterdir())
