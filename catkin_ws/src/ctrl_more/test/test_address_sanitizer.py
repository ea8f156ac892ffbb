"""Loads, exceptions of library classes, and unloads under AddressSanitizer (a campaign: COGLAB_LONG=1)."""

from __future__ import annotations

import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
FLAGS = [
    "-std=c++17",
    "-O1",
    "-g1",
    "-fPIC",
    "-fsanitize=address",
    "-fno-omit-frame-pointer",
    "-fno-gnu-unique",
    f"-I{PACKAGE / 'include'}",
    f"-I{PACKAGE / 'src'}",
    f"-I{PACKAGE / 'test'}",
    f"-I{PACKAGE.parent / 'coglab_rt' / 'include'}",
    "-isystem/usr/include/eigen3",
]
PLUGINS = ["good", "none", "two", "again", "paper_maker", "throwing", "wrong_type", "other_abi", "strangers", "rebuilt"]


def compiled(*arguments: object) -> None:
    """Runs the compiler, which must succeed."""
    result = subprocess.run(["g++", *FLAGS, *map(str, arguments)], capture_output=True, text=True, timeout=900)
    assert result.returncode == 0, result.stderr[-3000:]


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_libraries_come_throw_and_go(tmp_path: Path) -> None:
    core, plugins, program = tmp_path / "libctrl_more.so", tmp_path / "plugins", tmp_path / "test_plugins"
    plugins.mkdir()
    sources = sorted((PACKAGE / "src").rglob("*.cpp"))
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda s: compiled("-c", s, "-o", tmp_path / f"{s.stem}.o"), sources))
    compiled("-shared", *(tmp_path / f"{s.stem}.o" for s in sources), "-o", core, "-lyaml-cpp", "-ldl")
    link = [core, f"-Wl,-rpath,{tmp_path}"]
    compiled(PACKAGE / "tools" / "probe.cpp", "-o", tmp_path / "ctrl_more_probe", *link, "-ldl")
    for name in PLUGINS:
        compiled("-shared", PACKAGE / "test" / "plugins" / f"{name}.cpp", "-o", plugins / f"lib{name}.so", *link)
    compiled(
        "-shared", PACKAGE / "test" / "plugins" / "good.cpp", "-Wl,-z,nodelete", "-o", plugins / "libresident.so", *link
    )
    compiled(
        f'-DCTRL_MORE_TEST_PLUGIN_DIR="{plugins}"',
        f'-DCTRL_MORE_SOURCE_DIR="{PACKAGE}"',
        f'-DCTRL_MORE_PLUGIN_DIR="{plugins}"',
        PACKAGE / "test" / "loading" / "test_plugins.cpp",
        PACKAGE / "test" / "run_tests.cpp",
        "-o",
        program,
        *link,
        "-lgtest",
        "-lpthread",
    )
    result = subprocess.run(
        [str(program), "--gtest_filter=Plugins.LoadsRuns*:Plugins.What*:Plugins.Two*:Plugins.Known*:TwoBuilds.*"],
        env=dict(os.environ, ASAN_OPTIONS="detect_leaks=1", TMPDIR=str(tmp_path)),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, (result.stdout + result.stderr)[-4000:]
    assert "[  PASSED  ] 8 tests" in result.stdout, result.stdout[-500:]
