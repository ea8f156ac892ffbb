"""A launch with an unusable person ends with an error message; nothing is respawned."""

import re
import signal
import socket
import subprocess

import pytest
from coglab_sim.person.participant import BEHAVIOURS
from roslaunch.config import load_config_default
from roslaunch.core import RLException

LAUNCH = ("coglab_bringup", "coglab.launch")


def resolve(*arguments):
    """The launch file as plain roslaunch reads it."""
    import rospkg

    file = rospkg.RosPack().get_path(LAUNCH[0]) + "/launch/" + LAUNCH[1]
    return load_config_default([(file, list(arguments))], None, verbose=False)


@pytest.mark.parametrize(
    "argument, said",
    [
        ("behaviour:=silly", "'silly'; there are: normal"),
        ("profile:=angel", "'angel'; there are: drawn, patient, accustomed"),
        ("recorded_person:=stay", "'stay'; there are: wait, no_wait, leave"),
        ("recording:=/nope.bag", "/nope.bag: no such file"),
        ("recording:=/etc/passwd", ".csv, .npz or .bag"),
    ],
)
def test_refused_before_anything_starts(argument, said, capfd):
    with pytest.raises(RLException):
        resolve(argument)
    assert said in capfd.readouterr().err


def test_a_recording_that_cannot_be_read(tmp_path, capfd):
    (tmp_path / "a b.csv").write_text("t,x,y\n0,1,2\n")
    with pytest.raises(RLException):
        resolve(f"recording:={tmp_path}/a b.csv")
    assert "t,x,y,z" in capfd.readouterr().err


def write_reach(path):
    """A recording of a hand alone, 0.4 m far."""
    path.write_text("t,x,y,z\n" + "".join(f"{0.1 * i},{min(0.04 * i, 0.4)},0,0.4\n" for i in range(21)))


def test_a_recording_without_the_object_is_refused_before_anything_starts(tmp_path, capfd):
    write_reach(tmp_path / "hand.csv")
    with pytest.raises(RLException):
        resolve(f"recording:={tmp_path}/hand.csv")
    assert re.search("'object_mug'.* human_hand", capfd.readouterr().err)


@pytest.mark.parametrize("behaviour", [BEHAVIOURS[0], BEHAVIOURS[-1]])
def test_usable_settings_are_accepted(behaviour, tmp_path):
    write_reach(tmp_path / "a b.csv")
    config = resolve(f"behaviour:={behaviour}", f"recording:={tmp_path}/a b.csv", "recorded_object:=in_hand")
    assert config.params["/coglab_sim/virtual_human/behaviour"].value == behaviour
    assert config.params["/coglab_sim/virtual_human/settings"].value == "usable"


def test_plain_roslaunch_ends():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    command = ["roslaunch", "-p", port, *LAUNCH, "behaviour:=silly"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        try:
            _, said = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)  # it ends what it has started
            process.communicate()
            raise
    assert process.returncode == 1 and "'silly'" in said
