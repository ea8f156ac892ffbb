"""Arguments of the launch files reach their nodes."""

import _ctypes
from pathlib import Path

import pytest
from coglab_bringup.launch_arguments import whole_path
from coglab_bringup.launch_files import check
from coglab_py.packages import package_path
from roslaunch.config import load_config_default
from roslaunch.core import RLException
from roslaunch.node_args import shlex

REAL = "fri_address:=127.0.0.1"
OTHERS = ("signals:=signals", "managers:=safe_distance")  # shipped files, by name


def load(package, file, *arguments):
    """Load the launch file with roslaunch, without a start."""
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
def test_learnt_contact_thresholds_reach_the_detector(file, tmp_path):
    learnt = str(tmp_path / "learnt.yaml")  # does not exist before the first learning
    found = parameters("coglab_bringup", file, f"contact_learnt_file:={learnt}", REAL)
    assert found["/contact_detector/learnt_file"] == learnt


@pytest.mark.parametrize("file", ["coglab.launch", "real.launch"])
def test_files_of_feedback_controllers_signals_and_managers_reach_the_manager(file):
    found = parameters("coglab_bringup", file, "feedback:=palm", *OTHERS, REAL)
    names = ("feedback_file", "signals_file", "central_file")
    assert [found[f"/controller_manager/{name}"] for name in names] == ["palm", "signals", "safe_distance"]
    assert not {f"/controller_manager/{name}" for name in names[1:]} & set(parameters("coglab_bringup", file, REAL))


def test_touch_sensors_are_read_where_their_driver_publishes():
    simulated = parameters("coglab_bringup", "coglab.launch", "tactile:=true")
    topics = [f"/{node}/tactile_topic" for node in ("controller_manager", "contact_detector")]
    assert simulated["/controller_manager/tactile"] is True and simulated["/coglab_sim/cell/tactile"] is True
    assert [simulated[name] for name in topics] == ["coglab_sim/fingertip_forces"] * 2
    real = parameters("coglab_bringup", "real.launch", "tactile:=true", REAL)
    assert real["/controller_manager/tactile"] is True and not set(topics) & set(real)
    assert parameters("coglab_bringup", "coglab.launch")["/controller_manager/tactile"] is False


def test_a_file_name_with_a_space_reaches_the_hand_emulator_whole(tmp_path):
    (tmp_path / "a folder").mkdir()
    trace = f"{tmp_path}/a folder/t.txt"
    config = load("coglab_bringup", "coglab.launch", f"hand_trace:={trace}", "console:=false")
    (emulator,) = (node for node in config.nodes if node.name == "hand_emulator")
    words = shlex.split(emulator.args)
    assert words[words.index("--trace") + 1] == trace


FILES = ["controllers", "feedback", "managers", "signals", "primitives", "objects", "machines", "tracker", "patterns"]


@pytest.mark.parametrize("name", FILES)
def test_a_missing_empty_or_broken_file_or_a_folder_is_refused_by_the_argument(tmp_path, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty").touch()
    (tmp_path / "broken").write_text("a: [1, 2\nb: {\n")
    (tmp_path / "binary").write_bytes(bytes(range(128, 256)))
    for file in ("absent", "empty", "folder", "broken", "binary"):
        value = str(tmp_path / file)
        with pytest.raises(ValueError, match=f"^{name}:={value}: ") as refusal:
            check({name: value})
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", ["results", "contact_learnt_file", "log_file", "hand_trace"])
def test_a_file_that_cannot_be_written_is_refused(tmp_path, name):
    for value, named in ((tmp_path, "a folder"), (tmp_path / "no" / "file", "make it first")):
        with pytest.raises(ValueError, match=named):
            check({name: str(value)})
    check({name: str(tmp_path / "file")})


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"perception": "bridge", "tracker": ""}, "tracker:=FILE"),
        ({"perception": "stand_in", "sim": "false"}, "bridge or none"),
        ({"feedback": "hand"}, "config/hand.yaml"),
        ({"signals": "package://no_such_package/s.yaml"}, "no_such_package"),
        ({"machines": "machines.yaml"}, "whole path"),
        ({"arm": "libnot_there.so"}, "libnot_there.so"),
        ({"arm": "libc.so.6"}, "COGLAB_ARM"),
        ({"arm": "ideal", "split": "true"}, "arm:=fri"),
    ],
)
def test_arguments_with_unknown_values_are_refused(arguments, named):
    with pytest.raises(ValueError, match=named):
        check(arguments)


def test_a_library_that_is_cut_short_is_refused_as_arm(tmp_path):
    """Loading it would end the process."""
    whole = Path(_ctypes.__file__).read_bytes()
    cut = tmp_path / "libcut.so"
    cut.write_bytes(whole[: len(whole) // 8])
    with pytest.raises(ValueError, match="cut short"):
        check({"arm": str(cut)})


@pytest.mark.parametrize(
    ("name", "content", "named"),
    [
        ("machines", "timimg: calm\n", "timimg"),
        ("machines", "actions: {wipe: 'nowhere_at_all:build'}\n", "'nowhere_at_all'"),
        ("tracker", "frames: {human_hand: {tf: hand, offst: {}}}\n", "offst"),
        ("tracker", "frames: {hand: {tf: human_hand}}\n", "perception contract"),
    ],
)
def test_an_invalid_file_is_refused_before_the_start(tmp_path, name, content, named):
    file = tmp_path / "file.yaml"
    file.write_text(content)
    with pytest.raises(ValueError, match=named):
        check({name: str(file)})


def test_an_arm_from_a_library_that_fails_ends_the_launch():
    (robot,) = (node for node in load("coglab_controllers", "robot.launch", "arm:=libmy_arm.so", "respawn:=true").nodes)
    assert (robot.respawn, robot.required) == (False, True)


def test_a_launch_with_a_missing_file_starts_nothing():
    with pytest.raises(RLException, match="coglab_files"):
        load("coglab_bringup", "real.launch", "machines:=/nowhere/machines.yaml")


def test_a_file_of_the_present_folder_reaches_the_nodes_with_its_absolute_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.yaml").touch()
    assert whole_path("tracker:=t.yaml") == f"tracker:={tmp_path}/t.yaml"
    assert whole_path("results:=r.json") == f"results:={tmp_path}/r.json"
    for word in ("feedback:=palm", "record:=none", "signals:=package://a/b.yaml", "object:=t.yaml", "--screen"):
        assert whole_path(word) == word
