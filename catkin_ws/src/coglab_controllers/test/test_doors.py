"""Allowed includes between the parts of this package, and equal fields of a request in all its forms."""

from __future__ import annotations

import ast
import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
SOURCES = PACKAGE.parent
ROBOT_NODE = Path("src/ros/robot_node.cpp")
ROS = re.compile(r"^(ros|std_msgs|sensor_msgs|geometry_msgs|coglab_msgs|diagnostic_updater|tf2\w*)/|^coglab_rt/ros/")
INCLUDE = re.compile(r'#include "coglab_controllers/(\w+)/')


def includes() -> dict[str, set[str]]:
    """Parts that each part includes, from headers and sources."""
    found: dict[str, set[str]] = {}
    for root in (PACKAGE / "include" / "coglab_controllers", PACKAGE / "src"):
        for path in sorted(root.rglob("*.[hc]pp")):
            door = path.relative_to(root).parts[0]
            found.setdefault(door, set()).update(INCLUDE.findall(path.read_text(encoding="utf-8")))
    return found


def test_plugins_know_no_ros_and_goals_know_no_plugin() -> None:
    found = includes()
    assert "plugins" in found["ros"]  # the test reads something
    for door in ("kinematics", "limits", "ik", "ptp", "dmp", "manager", "goal", "motion", "plugins", "testing"):
        assert "ros" not in found[door], door
    for door in ("kinematics", "limits", "ik", "ptp", "dmp", "manager", "goal", "motion"):
        assert "plugins" not in found[door], door


def test_no_two_doors_include_each_other() -> None:
    found = includes()
    pairs = {tuple(sorted((a, b))) for a in found for b in found[a] if a != b and a in found.get(b, set())}
    assert not pairs, pairs


def ros_request(name: str) -> list[str]:
    """Field names of the request of a service, in order."""
    text = (SOURCES / "coglab_msgs" / "srv" / f"{name}.srv").read_text(encoding="utf-8").split("---")[0]
    fields = [line.split("#")[0].split() for line in text.splitlines()]
    return [words[1] for words in fields if len(words) == 2 and "=" not in words[1]]


def struct(path: str, name: str) -> list[str]:
    """Names of the members of a C++ struct, in order, without constants."""
    text = (PACKAGE / "include" / "coglab_controllers" / path).read_text(encoding="utf-8")
    body = re.search(rf"struct {name} {{(.*?)\n}};", text, re.S).group(1)
    body = re.sub(r"//.*", "", body)
    statements = [" ".join(s.split()) for s in body.split(";")]
    return [re.sub(r"\s*(=|\{).*", "", s).split()[-1] for s in statements if s and not s.startswith("static")]


def dataclass_fields(path: Path, name: str) -> list[str]:
    """Names of the annotated fields of a Python class, in order."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    node = next(n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name == name)
    return [n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)]


def test_a_dmp_request_has_one_shape_from_the_brain_to_the_plugin() -> None:
    execute, switch = ros_request("ExecuteDmp"), ros_request("SwitchDmp")
    limits = ["goal_region_low", "goal_region_high", "goal_retreat", "goal_drop"]
    request = [limits if name == "goal_limits" else [name] for name in struct("dmp/dmp_request.hpp", "DmpRequest")]
    assert sum(request, []) == execute
    arrival = ["goal_approach", "arrival_speed"]
    own_of_execute = {"initial_state", "initial_position", "initial_velocity", "goal_frame", *arrival, *limits}
    assert [f for f in execute if f not in own_of_execute] == switch
    brain = dataclass_fields(
        SOURCES / "coglab_smach" / "src" / "coglab_smach" / "ports" / "interfaces.py", "DmpRequest"
    )
    initial = {"initial_state", "initial_position", "initial_velocity"}  # the brain starts from the current state
    assert sorted(brain) == sorted(set(execute) - initial)


def test_a_ptp_request_has_one_shape() -> None:
    assert struct("plugins/ptp_controller.hpp", "PtpRequest") == ros_request("AddPtp")


def test_a_request_for_a_motion_of_ones_own_has_one_shape() -> None:
    assert struct("motion/custom_motion_controller.hpp", "MotionRequestByName") == ros_request("StartMotion")


def files_and_includes(folder: str) -> dict[Path, list[str]]:
    """Includes of each C++ file below a folder, by its path in the package."""
    found = {
        path.relative_to(PACKAGE): re.findall(
            r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(encoding="utf-8"), re.MULTILINE
        )
        for path in (PACKAGE / folder).rglob("*")
        if path.suffix in (".cpp", ".hpp")
    }
    assert found, folder
    return found


def in_room(room: str) -> dict[Path, list[str]]:
    return files_and_includes(f"include/coglab_controllers/{room}") | files_and_includes(f"src/{room}")


def test_robot_node_alone_knows_the_back_end_by_fri() -> None:
    knows = {
        path
        for folder in ("include", "src")
        for path, names in files_and_includes(folder).items()
        if any(name.startswith("lwr_fri_bridge/") for name in names)
    }
    assert knows == {ROBOT_NODE}


def test_the_ideal_arm_stands_on_coglab_rt_alone() -> None:
    for path, names in in_room("ideal").items():
        for name in names:
            assert not name.startswith(("ctrl_more/", "lwr_fri_bridge/")), f"{path}: {name}"
            if name.startswith("coglab_controllers/"):
                assert name.startswith("coglab_controllers/ideal/"), f"{path}: {name}"
            if "_ros" not in path.stem:
                assert not ROS.match(name), f"{path}: {name}"


def test_the_manager_knows_no_ros_and_no_arm() -> None:
    for path, names in in_room("manager").items():
        for name in names:
            assert not ROS.match(name), f"{path}: {name}"
            assert not name.startswith(("lwr_fri_bridge/", "coglab_controllers/ideal/")), f"{path}: {name}"
