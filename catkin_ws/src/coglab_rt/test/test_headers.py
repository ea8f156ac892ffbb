"""The ground of the real-time side: it includes nothing of ours, and ROS only where the folder says so."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
HEADERS = sorted((PACKAGE / "include").rglob("*.hpp"))


def includes(path: Path) -> list[str]:
    return re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(encoding="utf-8"), re.MULTILINE)


def test_nothing_of_ours_is_included_and_ros_only_in_its_folder() -> None:
    assert len(HEADERS) >= 15
    for path in HEADERS:
        for name in includes(path):
            if "/" not in name or name.startswith(("sys/", "Eigen/")):
                continue
            in_ros = path.parent.name == "ros"
            allowed = ("coglab_rt/", "yaml-cpp/") + (("ros/", "roscpp/", "xmlrpcpp/") if in_ros else ())
            assert name.startswith(allowed), f"{path.name} includes {name}"
            assert in_ros or not name.startswith("coglab_rt/ros/"), f"{path.name} includes {name}"
