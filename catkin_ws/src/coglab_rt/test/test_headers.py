"""The ground of the real-time side: it includes nothing of ours, and ROS only where the folder says so; the example of
docs/arm_back_end.md is the file that is compiled."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
HEADERS = sorted((PACKAGE / "include").rglob("*.hpp"))
PAGE = PACKAGE.parents[2] / "docs" / "arm_back_end.md"


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


def test_the_page_shows_the_example_that_is_compiled() -> None:
    blocks = re.findall(r"^```cpp\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    example = (PACKAGE / "example" / "shortest_arm.hpp").read_text(encoding="utf-8")
    assert example in blocks


def test_every_name_of_the_port_is_on_the_page() -> None:
    header = (PACKAGE / "include" / "coglab_rt" / "arm_port.hpp").read_text(encoding="utf-8")
    names = set(re.findall(r"(\w+)\([^;{)]*\)(?: =|;| \{)", header)) - {"ArmPort", "read", "write"}
    assert {"start", "shutdown", "mailboxes", "setControllerActive", "publishSample"} <= names
    page = PAGE.read_text(encoding="utf-8")
    assert not [name for name in names if f"`{name}" not in page and f"::{name}" not in page]
