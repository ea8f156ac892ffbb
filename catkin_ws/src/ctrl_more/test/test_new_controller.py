"""The template compiles, passes its test and has documentation."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
SCRIPT = PACKAGE / "scripts" / "new_controller.py"


def run(*command: str | Path, **options) -> subprocess.CompletedProcess:
    """Runs a command with a time limit and returns its output."""
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=300, **options)


def need_workspace() -> None:
    """Fails unless a workspace with ctrl_more is sourced."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        if prefix and (Path(prefix) / "lib" / "libctrl_more.so").is_file():
            return
    pytest.fail("ctrl_more is not built, or its workspace not sourced: ./coglab build, then ./coglab test")


def test_new_controller_compiles_is_tested_and_documented(tmp_path: Path) -> None:
    need_workspace()
    made = run(sys.executable, SCRIPT, "WristDamper", "--into", tmp_path)
    assert made.returncode == 0, made.stderr
    folder = tmp_path / "wrist_damper"
    left = [
        p
        for p in folder.rglob("*")
        if p.is_file() and "@" in p.name + p.read_text() and "example.org" not in p.read_text()
    ]
    assert not left, left
    build = folder / "build"
    configured = run("cmake", "-S", folder, "-B", build)
    assert configured.returncode == 0, configured.stdout + configured.stderr
    built = run("cmake", "--build", build)
    assert built.returncode == 0, built.stdout + built.stderr
    assert "warning" not in built.stdout + built.stderr
    tested = run("ctest", "--test-dir", build, "--output-on-failure")
    assert tested.returncode == 0, tested.stdout
    assert "wrist_damper_test_controller" in tested.stdout
    # In the PATH of a sourced workspace.
    plugin = build / "libwrist_damper.so"
    assert run("ctrl_more_describe", "check", plugin).returncode == 0
    page = run("ctrl_more_describe", "page", plugin)
    assert page.stdout.startswith("# WristDamper\n")
    assert all(
        f"## {part}" in page.stdout
        for part in ("Use", "When to apply it", "Limitations", "Robot signals", "Control signals")
    )
    config = run("ctrl_more_describe", "config", plugin)
    assert "k: 0.5" in config.stdout
    # Outside of the folder it was made in: found by its name in CTRL_MORE_PATH.
    elsewhere = tmp_path / "list.yaml"
    elsewhere.write_text("loadControllers: [mine]\nmine: {type: WristDamper}\n")
    checked = run("ctrl_more_describe", "list", elsewhere, env=dict(os.environ, CTRL_MORE_PATH=str(build)))
    assert checked.returncode == 0, checked.stderr
    assert "mine (WristDamper" in checked.stdout
    lost = run("ctrl_more_describe", "list", elsewhere)
    assert lost.returncode == 1 and "'WristDamper'" in lost.stderr


@pytest.mark.parametrize("name", ["wristDamper", "Wrist-Damper", "", "9Lives", "../Up", "X"])
def test_wrong_names_are_refused(tmp_path: Path, name: str) -> None:
    result = run(sys.executable, SCRIPT, name, "--into", tmp_path)
    assert result.returncode == 1
    assert "CamelCase" in result.stderr
    assert not list(tmp_path.iterdir())


def test_existing_folder_and_missing_target_are_refused(tmp_path: Path) -> None:
    (tmp_path / "wrist_damper").mkdir()
    again = run(sys.executable, SCRIPT, "WristDamper", "--into", tmp_path)
    assert again.returncode == 1 and "exists already" in again.stderr
    missing = run(sys.executable, SCRIPT, "WristDamper", "--into", tmp_path / "nowhere")
    assert missing.returncode == 1 and "no folder" in missing.stderr
