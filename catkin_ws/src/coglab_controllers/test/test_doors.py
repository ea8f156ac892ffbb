"""Who knows the arm: manager and control thread know coglab_rt alone, robot_node alone knows the back end by FRI,
the ideal arm knows nothing of the controllers."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
ROBOT_NODE = Path("src/ros/robot_node.cpp")
ROS = re.compile(r"^(ros|std_msgs|sensor_msgs|geometry_msgs|coglab_msgs|diagnostic_updater|tf2\w*)/|^coglab_rt/ros/")


def includes(folder: str) -> dict[Path, list[str]]:
    """What each C++ file below a folder includes, by its path in the package."""
    found = {path.relative_to(PACKAGE): re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]',
                                                   path.read_text(encoding="utf-8"), re.MULTILINE)
             for path in (PACKAGE / folder).rglob("*") if path.suffix in (".cpp", ".hpp")}
    assert found, folder
    return found


def in_room(room: str) -> dict[Path, list[str]]:
    return includes(f"include/coglab_controllers/{room}") | includes(f"src/{room}")


def test_robot_node_alone_knows_the_back_end_by_fri() -> None:
    knows = {path for folder in ("include", "src") for path, names in includes(folder).items()
             if any(name.startswith("lwr_fri_bridge/") for name in names)}
    assert knows == {ROBOT_NODE}


def test_robot_node_alone_knows_the_ideal_arm() -> None:
    knows = {path for folder in ("include", "src") for path, names in includes(folder).items()
             if any(name.startswith("coglab_controllers/ideal/") for name in names) and "ideal" not in path.parts}
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
