"""./coglab where something is wrong: one clear sentence, what to do, and nothing left half-done."""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
ABSENT = "coglab-test-no-such-package"


def run(*command: object, **environment: str) -> subprocess.CompletedProcess:
    """Runs a command in this environment with some variables changed; output and errors as one text in `stdout`."""
    words = [str(word) for word in command]
    return subprocess.run(
        words, env={**os.environ, **environment}, text=True, timeout=120, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def needs(*command: str) -> pytest.MarkDecorator:
    """Skips where this command, which prepares the fault, does not run (no root, or a container that forbids it)."""
    works = shutil.which(command[0]) and subprocess.run(command, capture_output=True, check=False).returncode == 0
    return pytest.mark.skipif(
        not works, reason=f"`{' '.join(command)}` does not run here: not root, or a restricted container"
    )


@pytest.fixture
def checkout():
    """The command and a package list with a package that is not installed, in a folder that everybody can read."""
    folder = Path(tempfile.mkdtemp(prefix="coglab-command-"))
    folder.chmod(0o777)
    shutil.copy(TOP / "coglab", folder)
    (folder / "debian-packages.txt").write_text(f"run: {ABSENT}\nbuild: {ABSENT}\n")
    yield folder
    shutil.rmtree(folder)


def lines_of(text: str) -> list[str]:
    return [line for line in text.splitlines() if "error:" in line]


@needs("unshare", "--net", "true")
def test_no_network(checkout):
    lists_before = sorted(os.listdir("/var/lib/apt/lists"))
    ended = run("unshare", "--net", checkout / "coglab", "build")
    assert ended.returncode == 1
    (error,) = lines_of(ended.stdout)
    assert "no way to a Debian mirror" in error and "check the network" in error and "nothing was changed" in error
    assert sorted(os.listdir("/var/lib/apt/lists")) == lists_before
    assert not (checkout / "catkin_ws").exists()


@needs("setpriv", "--reuid=65534", "--clear-groups", "true")
def test_no_root(checkout):
    ended = run("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", checkout / "coglab", "demo")
    assert ended.returncode == 1
    (error,) = lines_of(ended.stdout)
    assert "neither root nor a sudo" in error and f"apt-get install --no-install-recommends {ABSENT}" in error
    assert sorted(path.name for path in checkout.iterdir()) == ["coglab", "debian-packages.txt"]


@needs("unshare", "--mount", "true")
def test_wrong_release(checkout):
    other = checkout / "os-release"
    other.write_text('PRETTY_NAME="Ubuntu 20.04"\nVERSION_CODENAME=focal\n')
    script = 'mount --bind "$1" "$(readlink -f /etc/os-release)" && exec "$2" test'
    ended = run("unshare", "--mount", "sh", "-c", script, "sh", other, checkout / "coglab")
    assert ended.returncode == 1
    (error,) = lines_of(ended.stdout)
    assert "Debian 12 (bookworm) is expected" in error and "Ubuntu 20.04" in error and "docker/run" in error
    assert not (checkout / ".coglab").exists()


def test_doctor_names_a_missing_package_and_the_way_to_it(checkout):
    doctor = TOP / "catkin_ws/src/coglab_bringup/src/coglab_bringup/doctor.py"
    ended = run("/usr/bin/python3", "-I", doctor, checkout)
    assert ended.returncode == 1
    assert f"packages to run: missing {ABSENT}; get them: ./coglab install run" in ended.stdout
    assert "not built yet; do it: ./coglab build" in ended.stdout


def test_doctor_names_a_second_smach(checkout):
    second = checkout / "catkin_ws/src/somewhere/smach_ros"
    second.mkdir(parents=True)
    (second / "package.xml").write_text("<package/>")
    doctor = TOP / "catkin_ws/src/coglab_bringup/src/coglab_bringup/doctor.py"
    ended = run("/usr/bin/python3", "-I", doctor, checkout)
    assert f"a second copy of smach_ros lies in {second}" in ended.stdout and "--upstream-smach" in ended.stdout


def test_a_foreign_ros_is_named_and_left_aside():
    ended = run(TOP / "coglab", "help", ROS_PACKAGE_PATH="/opt/ros/noetic/share")
    assert ended.returncode == 0 and "a ROS from /opt/ros is in your environment" in ended.stdout
    ended = run(TOP / "coglab", "doctor", ROS_PACKAGE_PATH="/opt/ros/noetic/share")
    assert "a ROS from /opt/ros is in ROS_PACKAGE_PATH; open a shell without it" in ended.stdout


def test_pyenv_first_in_path(tmp_path):
    shim = tmp_path / "python3"
    shim.write_text("#!/bin/sh\nexit 42\n")
    shim.chmod(0o755)
    path = f"{tmp_path}:{os.environ['PATH']}"
    ended = run(TOP / "coglab", "doctor", PATH=path)
    assert f"python3 in your PATH is {shim}; ./coglab uses /usr/bin/python3 anyway" in ended.stdout
    assert run(TOP / "coglab", "install", "run", PATH=path).returncode == 0


def test_an_unknown_command_is_named():
    ended = run(TOP / "coglab", "lunch")
    assert ended.returncode == 2 and "unknown command 'lunch'" in ended.stdout and "./coglab launch" in ended.stdout


def test_occupied_port():
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        ended = run(sys.executable, "-m", "coglab_bringup.launch", "-p", port)
    assert ended.returncode == 1
    assert f"port {port} is in use by another program; leave out -p for a free one" in ended.stdout


def test_a_port_that_is_no_number():
    ended = run(sys.executable, "-m", "coglab_bringup.launch", "-p", "high")
    assert ended.returncode == 2 and "-p expects a port number" in ended.stdout
