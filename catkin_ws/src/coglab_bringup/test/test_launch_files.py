"""Arguments of the launch files reach the nodes that they are for."""

import pytest
from coglab_py.packages import package_path
from roslaunch.config import load_config_default
from roslaunch.node_args import shlex

REAL = "fri_address:=127.0.0.1"


def load(package, file, *arguments):
    """The launch file as roslaunch reads it; nothing starts."""
    path = str(package_path(package, "launch", file))
    return load_config_default([(path, list(arguments))], None, verbose=False, assign_machines=False)


def parameters(package, file, *arguments):
    """Values by name."""
    return {name: each.value for name, each in load(package, file, *arguments).params.items()}


@pytest.mark.parametrize("profile", ["default", "t1"])
@pytest.mark.parametrize(
    "package, file",
    [("coglab_controllers", "robot.launch"), ("coglab_controllers", "robot_real.launch"),
     ("coglab_bringup", "coglab.launch"), ("coglab_bringup", "real.launch")],
)  # fmt: skip
def test_arm_and_controller_manager_read_the_same_limits(package, file, profile):
    found = parameters(package, file, f"limits_profile:={profile}", REAL)
    assert found["/lwr/limits_profile"] == found["/controller_manager/joint_limits_profile"] == profile


@pytest.mark.parametrize("file", ["coglab.launch", "real.launch"])
def test_learnt_contact_thresholds_reach_the_detector(file):
    found = parameters("coglab_bringup", file, "contact_learnt_file:=learnt.yaml", REAL)
    assert found["/contact_detector/learnt_file"] == "learnt.yaml"


@pytest.mark.parametrize("file", ["coglab.launch", "real.launch"])
def test_files_of_feedback_controllers_signals_and_managers_reach_the_manager(file):
    found = parameters("coglab_bringup", file, "feedback:=palm", "signals:=s.yaml", "managers:=m.yaml", REAL)
    names = ("feedback_file", "signals_file", "central_file")
    assert [found[f"/controller_manager/{name}"] for name in names] == ["palm", "s.yaml", "m.yaml"]
    assert not {f"/controller_manager/{name}" for name in names[1:]} & set(parameters("coglab_bringup", file, REAL))


def test_touch_sensors_are_read_where_their_driver_publishes():
    simulated = parameters("coglab_bringup", "coglab.launch", "tactile:=true")
    topics = [f"/{node}/tactile_topic" for node in ("controller_manager", "contact_detector")]
    assert simulated["/controller_manager/tactile"] is True and simulated["/coglab_sim/cell/tactile"] is True
    assert [simulated[name] for name in topics] == ["coglab_sim/fingertip_forces"] * 2
    real = parameters("coglab_bringup", "real.launch", "tactile:=true", REAL)
    assert real["/controller_manager/tactile"] is True and not set(topics) & set(real)
    assert parameters("coglab_bringup", "coglab.launch")["/controller_manager/tactile"] is False


def test_a_file_name_with_a_space_reaches_the_hand_emulator_whole():
    config = load("coglab_bringup", "coglab.launch", "hand_trace:=/a folder/t.txt", "console:=false")
    (emulator,) = (node for node in config.nodes if node.name == "hand_emulator")
    words = shlex.split(emulator.args)
    assert words[words.index("--trace") + 1] == "/a folder/t.txt"
