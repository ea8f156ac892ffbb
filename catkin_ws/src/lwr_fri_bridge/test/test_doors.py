"""The rooms of this package: arrows run only downward, ROS stays in the uppermost, controllers are not known."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
# From the ground up. What lies in none of them (names.hpp) is the ground itself.
ROOMS = ["", "fri", "requests", "motion", "supervision", "bridge", "ros"]
ROS = re.compile(r"^(ros|std_msgs|sensor_msgs|geometry_msgs|coglab_msgs|diagnostic_updater|tf2)/|^coglab_rt/ros/")


def room_of(path: Path) -> str:
    for root in (PACKAGE / "include" / "lwr_fri_bridge", PACKAGE / "src"):
        if root in path.parents:
            parts = path.relative_to(root).parts
            return parts[0] if len(parts) > 1 else ""
    raise AssertionError(f"{path} lies outside of include and src")


def includes(path: Path) -> list[str]:
    return re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(encoding="utf-8"), re.MULTILINE)


def sources() -> list[Path]:
    found = [p for folder in ("include", "src") for p in (PACKAGE / folder).rglob("*") if p.suffix in (".cpp", ".hpp")]
    assert len(found) > 30
    return found


def test_every_file_lies_in_a_room() -> None:
    assert {room_of(path) for path in sources()} == set(ROOMS)
    assert [p.name for p in sources() if room_of(p) == ""] == ["names.hpp"]


def test_arrows_run_only_downward() -> None:
    wrong = []
    for path in sources():
        own = room_of(path)
        for name in includes(path):
            if name.startswith("lwr_fri_bridge/"):
                parts = name.split("/")[1:]
                room = parts[0] if len(parts) > 1 else ""
            elif "/" not in name and (path.parent / name).is_file():
                room = own
            else:
                continue
            assert room in ROOMS, f"{path}: {name} is in no room"
            if ROOMS.index(room) > ROOMS.index(own):
                wrong.append(f"{path.relative_to(PACKAGE)} ({own}) includes {name} ({room})")
    assert not wrong, wrong


def test_ros_stays_in_its_room() -> None:
    wrong = [
        f"{path.relative_to(PACKAGE)}: {name}"
        for path in sources()
        if room_of(path) != "ros"
        for name in includes(path)
        if ROS.match(name)
    ]
    assert not wrong, wrong


def test_nothing_above_is_known() -> None:
    wrong = [
        f"{path.relative_to(PACKAGE)}: {name}"
        for path in sources()
        for name in includes(path)
        if name.split("/")[0] in ("coglab_controllers", "coglab_sim", "ctrl_more")
    ]
    assert not wrong, wrong
