"""The cell's thread against requests that time out, under the address sanitizer (a campaign: COGLAB_LONG=1)."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent
SOURCES = PACKAGE.parent
BRIDGE = ["fri/datagram.cpp"]  # what the cell uses of it


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_requests_against_the_cells_thread(tmp_path):
    own = [p for p in sorted((PACKAGE / "src").rglob("*.cpp")) if p.stem != "virtual_robot"]
    hand = tmp_path / "built_in_hand.cpp"  # as CMake makes it
    template = (PACKAGE / "src" / "plant" / "built_in_hand.cpp.in").read_text()
    hand.write_text(template.replace("@COGLAB_SIM_HAND_MODEL@", (PACKAGE / "config" / "hand_model.yaml").read_text()))
    sources = [
        *own,
        hand,
        *(SOURCES / "lwr_fri_bridge" / "src" / name for name in BRIDGE),
        PACKAGE / "test" / "cell" / "test_real_time_cell.cpp",
    ]
    flags = [
        "-std=c++17",
        "-O1",
        "-g1",
        "-fsanitize=address,undefined",
        "-fno-omit-frame-pointer",
        f'-DURDF="{SOURCES}/lwr_description/urdf/lwr_ih2.urdf"',
    ]
    includes = [
        f"-I{PACKAGE}/include",
        f"-I{PACKAGE}/src/plant",
        f"-I{SOURCES}/lwr_fri_bridge/include",
        f"-I{SOURCES}/coglab_rt/include",
        "-isystem/usr/include/eigen3",
    ]
    objects = []
    for source in sources:
        objects.append(tmp_path / f"{len(objects)}_{source.stem}.o")
        built = subprocess.run(
            ["g++", *flags, "-c", str(source), "-o", str(objects[-1]), *includes],
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert built.returncode == 0, built.stderr[-3000:]
    program = tmp_path / "cell_core"
    built = subprocess.run(
        [
            "g++",
            *flags,
            "-o",
            str(program),
            *map(str, objects),
            "-lorocos-kdl",
            "-lkdl_parser",
            "-ltinyxml2",
            "-lyaml-cpp",
            "-lmujoco",
            "-lgtest_main",
            "-lgtest",
            "-lpthread",
        ],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert built.returncode == 0, built.stderr[-3000:]
    run = subprocess.run([str(program), "--gtest_filter=RealTimeCell.*"], capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, (run.stdout + run.stderr)[-4000:]
