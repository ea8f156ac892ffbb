"""ctrl_more alone: configured, built and installed by plain CMake, and used from there by other projects.

No catkin and no workspace is in the environment of these tests.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
CATKIN_VARIABLES = (
    "CMAKE_PREFIX_PATH",
    "ROS_PACKAGE_PATH",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "PKG_CONFIG_PATH",
    "CTRL_MORE_PATH",
)

pytestmark = pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")


def clean_environment(**more: str) -> dict[str, str]:
    """The environment without a workspace."""
    kept = {k: v for k, v in os.environ.items() if k not in CATKIN_VARIABLES}
    return {**kept, "PATH": "/usr/local/bin:/usr/bin:/bin", **more}


def run(*command: str | Path, **more: str) -> str:
    """Output of a command that must succeed."""
    result = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        timeout=1200,
        env=clean_environment(**more),
    )
    said = result.stdout + result.stderr
    assert result.returncode == 0, f"{command[0]} said: {said[-3000:]}"
    return said


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package, installed to a prefix; not optimised, to keep the test short."""
    build = tmp_path_factory.mktemp("build")
    installed = tmp_path_factory.mktemp("prefix")
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    said = run(
        "cmake",
        "-S",
        PACKAGE,
        "-B",
        build,
        "-DCMAKE_BUILD_TYPE=Debug",  # without the link-time optimisation of pybind11
        "-DCMAKE_CXX_FLAGS_DEBUG=",
        "-DCMAKE_UNITY_BUILD=ON",
        f"-DCMAKE_INSTALL_PREFIX={installed}",
        *launcher,
    )
    assert "catkin" not in said
    run("cmake", "--build", build, "-j2")
    run("cmake", "--install", build)
    return installed


def test_consumer_finds_links_and_runs_an_installed_controller(prefix: Path, tmp_path: Path) -> None:
    run(
        "cmake",
        "-S",
        PACKAGE / "test" / "consumer",
        "-B",
        tmp_path,
        f"-DCMAKE_PREFIX_PATH={prefix}",
        "-DCMAKE_BUILD_TYPE=None",
    )
    run("cmake", "--build", tmp_path)
    # 0.05 rad from the end, bounded to xi (0.05 / 0.1); the other joint is free.
    assert run(tmp_path / "consumer").split()[:2] == ["0.2", "1"]


def test_wrong_version_is_refused(prefix: Path, tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.10)\nproject(other LANGUAGES CXX)\nfind_package(ctrl_more 7.0 REQUIRED)\n"
    )
    result = subprocess.run(
        ["cmake", "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={prefix}"],
        capture_output=True,
        text=True,
        timeout=600,
        env=clean_environment(),
    )
    (version,) = re.findall("<version>(.*)</version>", (PACKAGE / "package.xml").read_text())
    assert result.returncode != 0 and f"version: {version}" in result.stderr


def test_installed_tool_describes_an_installed_controller(prefix: Path) -> None:
    page = run(prefix / "bin" / "ctrl_more_describe", "page", prefix / "lib" / "libctrl_more_joint_limits.so")
    assert page.startswith("# JointLimits\n")


def test_template_builds_runs_and_is_documented_from_the_prefix(prefix: Path, tmp_path: Path) -> None:
    run(sys.executable, prefix / "lib" / "ctrl_more" / "new_controller.py", "WristDamper", "--into", tmp_path)
    folder, build = tmp_path / "wrist_damper", tmp_path / "wrist_damper" / "build"
    assert "ctrl_more was not found" in failed_configure(folder)
    run("cmake", "-S", folder, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=None")
    assert "warning" not in run("cmake", "--build", build)
    said = run("ctest", "--test-dir", build, "--output-on-failure")
    assert "wrist_damper_test_controller" in said and "100% tests passed" in said
    describe = prefix / "bin" / "ctrl_more_describe"
    run(describe, "check", build / "libwrist_damper.so")
    page = run(describe, "page", build / "libwrist_damper.so")
    assert page.startswith("# WristDamper\n") and "`k`" in page


def failed_configure(folder: Path) -> str:
    """Output of CMake without ctrl_more."""
    result = subprocess.run(
        ["cmake", "-S", folder, "-B", folder / "elsewhere"],
        capture_output=True,
        text=True,
        timeout=600,
        env=clean_environment(),
    )
    assert result.returncode != 0
    shutil.rmtree(folder / "elsewhere")
    return " ".join((result.stdout + result.stderr).split())
