"""Includes of the headers; reason codes equal those of the message."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
HEADERS = PACKAGE / "include" / "coglab_rt"


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def test_headers_include_nothing_of_ours_and_ros_only_in_its_folder() -> None:
    for path in HEADERS.rglob("*.hpp"):
        for name in re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', read(path), re.MULTILINE):
            if "/" not in name or name.startswith(("sys/", "Eigen/")):
                continue
            in_ros = path.parent.name == "ros"
            allowed = ("coglab_rt/", "yaml-cpp/") + (("ros/", "roscpp/", "xmlrpcpp/") if in_ros else ())
            assert name.startswith(allowed), f"{path.name} includes {name}"
            assert in_ros or not name.startswith("coglab_rt/ros/"), f"{path.name} includes {name}"


def test_reason_codes_are_the_numbers_of_the_message() -> None:
    message = dict(re.findall(r"^uint16 (\w+)=(\d+)", read(PACKAGE.parent / "coglab_msgs/msg/ReasonCode.msg"), re.M))
    body = re.search(r"enum class ReasonCode[^{]*\{(.*?)\};", read(HEADERS / "reason.hpp"), re.DOTALL)
    assert body is not None
    codes = dict(re.findall(r"^\s*(\w+) = (\d+)", body[1], re.M))
    assert len(codes) > 40
    for name, number in codes.items():
        assert message[re.sub(r"(?<!^)(?=[A-Z])", "_", name).upper()] == number, name
