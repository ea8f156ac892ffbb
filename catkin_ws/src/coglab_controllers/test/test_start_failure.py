"""A start of /robot that fails after its FRI thread runs, under the address sanitizer (a campaign: COGLAB_LONG=1)."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "lwr_fri_bridge" / "test"))
sys.path.insert(0, str(Path(__file__).resolve().parent))
from own_master import own_master

PACKAGE = Path(__file__).resolve().parent.parent
SOURCES = PACKAGE.parent
# Where the FRI thread and what it wakes are written and freed; the rest is linked as built.
WATCHED = [
    PACKAGE / "src" / "ros" / "robot_node.cpp",
    PACKAGE / "src" / "ros" / "manager_ros.cpp",
    PACKAGE / "src" / "manager" / "control_thread.cpp",
    *(
        SOURCES / "lwr_fri_bridge" / "src" / name
        for name in (
            "ros/bridge_ros.cpp",
            "ros/bridge_diagnostics.cpp",
            "ros/bridge_parameters.cpp",
            "bridge/fri_thread.cpp",
        )
    ),
]


@pytest.fixture(scope="module")
def robot_node(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sanitized")
    devel = Path(os.environ["CMAKE_PREFIX_PATH"].split(":")[0])
    flags = ["-std=c++17", "-O1", "-g1", "-fsanitize=address", "-fno-omit-frame-pointer"]
    packages = ("coglab_controllers", "coglab_rt", "ctrl_more", "lwr_fri_bridge")
    includes = [f"-I{SOURCES / name / 'include'}" for name in packages]
    includes += [f"-I{SOURCES / name / 'src' / 'ros'}" for name in ("lwr_fri_bridge", "coglab_controllers")]
    includes += [f"-isystem{devel / 'include'}", "-isystem/usr/include/eigen3"]
    objects = []
    for source in WATCHED:
        objects.append(folder / f"{source.stem}.o")
        built = subprocess.run(
            ["g++", *flags, "-c", str(source), "-o", str(objects[-1]), *includes],
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert built.returncode == 0, built.stderr[-3000:]
    libraries = [
        f"-L{devel / 'lib'}",
        f"-Wl,-rpath,{devel / 'lib'}",
        "-lcoglab_controllers_ros",
        "-lcoglab_ideal_arm",
        "-lcoglab_controllers_plugins",
        "-lcoglab_controllers_manager",
        "-lcoglab_controllers_core",
        "-lctrl_more",
        "-llwr_fri_bridge_ros",
        "-llwr_fri_bridge",
    ]
    system = subprocess.run(
        ["pkg-config", "--libs", "roscpp", "tf2_ros", "diagnostic_updater", "roslib"],
        capture_output=True,
        text=True,
        timeout=600,
    ).stdout.split()
    built = subprocess.run(
        [
            "g++",
            *flags,
            "-o",
            str(folder / "robot_node"),
            *map(str, objects),
            *libraries,
            *system,
            "-lyaml-cpp",
            "-lpthread",
        ],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert built.returncode == 0, built.stderr[-3000:]
    return folder / "robot_node"


@pytest.fixture
def master() -> Iterator[None]:
    with own_master():
        yield


@pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: set COGLAB_LONG=1")
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
@pytest.mark.parametrize(
    "space, name, value", [("lwr", "hot_drive", -300.0), ("controller_manager", "cycle_time", 7.0)]
)
def test_nothing_runs_on_over_what_is_freed(
    robot_node: Path, master: None, space: str, name: str, value: float
) -> None:
    """A parameter that is checked late is out of range while a controller sends at 1 kHz."""
    import rosgraph
    from udp_controller import UdpController

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = rosgraph.Master("/test")
    server.setParam("/lwr", {"fri_port": port, "rt_priority": 0, "lock_memory": False})
    server.setParam(f"/{space}/{name}", value)
    server.setParam("/robot_description", (SOURCES / "lwr_description" / "urdf" / "lwr_ih2.urdf").read_text())
    controller = UdpController(port, period=0.001).start()
    try:
        run = subprocess.run(
            [str(robot_node)],
            capture_output=True,
            text=True,
            timeout=600,
            env=dict(os.environ, ASAN_OPTIONS="detect_leaks=0"),
        )
    finally:
        controller.close()
    told = run.stdout + run.stderr
    assert "AddressSanitizer" not in told, told[-4000:]
    assert run.returncode == 1 and name in told, told[-2000:]
