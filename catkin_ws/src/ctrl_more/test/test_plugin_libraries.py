"""The shipped controller libraries export no symbols of their own, and unload completely."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

CONTROLLERS = ["attitude", "ee_admittance", "joint_limits"]


def workspace_lib() -> Path:
    """Folder of the built libraries in the workspace that was sourced."""
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        if prefix and (Path(prefix) / "lib" / "libctrl_more.so").is_file():
            return Path(prefix) / "lib"
    pytest.fail("ctrl_more is not built, or its workspace not sourced: ./coglab build, then ./coglab test")


@pytest.mark.skipif(shutil.which("nm") is None, reason="nm (binutils) is not installed")
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_symbols_are_hidden(controller: str) -> None:
    # A plug-in registers itself by a static object when it is loaded, so no symbol is looked up.
    library = workspace_lib() / f"libctrl_more_{controller}.so"
    listed = subprocess.run(
        ["nm", "-DC", "--defined-only", str(library)],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    ).stdout
    foreign = [line for line in listed.splitlines() if not re.search(r" [VWu] .*(std::|__gnu_cxx::)", line)]
    assert not foreign, "\n".join(foreign[:10])
    # Unique symbols would keep the library in the process for good.
    assert not [line for line in listed.splitlines() if " u " in line]


@pytest.mark.skipif(shutil.which("readelf") is None, reason="readelf (binutils) is not installed")
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_plugins_are_thin(controller: str, tmp_path: Path) -> None:
    # The core is linked, not contained; nor is class_loader or another controller.
    library = workspace_lib() / f"libctrl_more_{controller}.so"
    needed = subprocess.run(
        ["readelf", "-d", str(library)],
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    ).stdout
    assert "[libctrl_more.so]" in needed
    assert "libclass_loader" not in needed and "libyaml" not in needed
    if shutil.which("strip"):
        thin = tmp_path / "thin.so"
        subprocess.run(["strip", "-o", str(thin), str(library)], check=True, timeout=600)
        assert thin.stat().st_size < 200_000


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_loading_running_and_unloading_is_clean() -> None:
    lib = workspace_lib()
    program = lib / "ctrl_more" / "ctrl_more_test_loading"
    if not program.is_file():
        pytest.fail("ctrl_more_test_loading is not built: ./coglab build tests")
    result = subprocess.run(
        [
            "valgrind",
            "--error-exitcode=9",
            "--leak-check=full",
            "--errors-for-leak-kinds=definite",
            "--num-callers=20",
            str(program),
            "--gtest_filter=Plugins.LoadsRunsAndUnloads:Plugins.KnownTypeName*:Plugins.What*:TwoBuilds.*",
        ],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stderr[-4000:]
    assert "[  PASSED  ]" in result.stdout
