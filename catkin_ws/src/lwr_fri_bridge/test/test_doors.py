"""The folders of this package: includes run only downward, ROS stays in the uppermost, controllers are not known."""

from __future__ import annotations

import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent.parent
ROOMS = ["", "fri", "requests", "motion", "supervision", "bridge", "ros"]  # from the ground up; "" is names.hpp
ROS = re.compile(r"^(ros|std_msgs|sensor_msgs|geometry_msgs|coglab_msgs|diagnostic_updater|tf2)/|^coglab_rt/ros/")
ABOVE = ("coglab_controllers/", "coglab_sim/", "ctrl_more/")


def test_includes_run_only_downward() -> None:
    wrong, found = [], set()
    for root in (PACKAGE / "include" / "lwr_fri_bridge", PACKAGE / "src"):
        for path in (p for p in root.rglob("*") if p.suffix in (".cpp", ".hpp")):
            own = path.relative_to(root).parts[0] if path.parent != root else ""
            found.add(own)
            text = path.read_text(encoding="utf-8")
            for name in re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', text, re.MULTILINE):
                parts = name.split("/")[1:] if name.startswith("lwr_fri_bridge/") else [own, name]
                room = parts[0] if len(parts) > 1 else ""
                upward = ROOMS.index(room) > ROOMS.index(own)
                if upward or name.startswith(ABOVE) or (own != "ros" and ROS.match(name)):
                    wrong.append(f"{path.relative_to(PACKAGE)} includes {name}")
    assert found == set(ROOMS)
    assert not wrong, wrong
