"""The core of coglab_smach runs without ROS: only ``ros`` imports client libraries."""

import ast
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src" / "coglab_smach"
CLIENTS = ("rospy", "actionlib", "tf2_ros", "smach_ros", "roslib", "rosbag", "coglab_smach.ros", "coglab_sim")


def test_the_core_imports_no_client_library():
    for path in SOURCE.rglob("*.py"):
        if path.parent.name == "ros":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            bad = [name for name in names if name.startswith(CLIENTS)]
            assert not bad, f"{path.name} imports {bad}"
