"""A cell that cannot start, or has ended, ends its launch with an error message and is not respawned."""

import os
import signal
import socket
import subprocess
from pathlib import Path

import pytest
import rospkg
from roslaunch.config import load_config_default
from roslaunch.core import RLException

PACKAGE = Path(rospkg.RosPack().get_path("coglab_sim"))


def launched(*arguments):
    """Output of a launch of the cell alone, until it ends by itself; a hang is a failure."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    command = ["roslaunch", "-p", port, "coglab_sim", "cell.launch", *arguments]
    with subprocess.Popen(command, stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True) as process:
        try:
            return process.communicate(timeout=60.0)[0]
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)  # it ends what it has started
            process.communicate()
            raise


def resolve():
    """The launch file as plain roslaunch reads it."""
    return load_config_default([(str(PACKAGE / "launch" / "cell.launch"), [])], None, verbose=False)


def test_cell_is_required_and_never_respawned():
    config = resolve()
    assert config.params["/coglab_sim/cell/physics"].value == "usable"
    (cell,) = (node for node in config.nodes if node.name == "cell")
    assert cell.required and not cell.respawn


@pytest.mark.parametrize(
    "yaml, argument, said",
    [
        ("", "object:=elephant", "object 'elephant': "),
        ("hand_model: /nowhere/hand.yaml\n", None, "/nowhere/hand.yaml"),
    ],
)
def test_unusable_setting_ends_the_launch_with_a_message(tmp_path, yaml, argument, said):
    config = tmp_path / "cell.yaml"
    config.write_text((PACKAGE / "config" / "cell.yaml").read_text() + yaml)
    output = launched(f"config:={config}", *([argument] if argument else []))
    assert said in output and output.count("REQUIRED process") == 1, output
    assert "exit code 1" in output


def test_a_library_that_cannot_be_loaded_ends_the_launch_before_anything_starts(tmp_path, monkeypatch, capfd):
    (tmp_path / "libcoglab_sim_plant.so").touch()
    monkeypatch.setenv("LD_LIBRARY_PATH", f"{tmp_path}:{os.environ['LD_LIBRARY_PATH']}")
    with pytest.raises(RLException):
        resolve()
    said = capfd.readouterr().err
    assert f"{tmp_path}/libcoglab_sim_plant.so: file too short" in said
    assert "./coglab build" in said and "libmujoco-dev" in said and "./coglab doctor" in said
