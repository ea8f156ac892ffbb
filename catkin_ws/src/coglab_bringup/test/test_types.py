"""mypy on the Python that ships: strict on modules that import no ROS, plain on the others and on the nodes."""

import ast
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[4]
SOURCES = TOP / "catkin_ws" / "src"
PACKAGES = ("coglab_py", "coglab_objects", "coglab_perception", "coglab_sim", "coglab_smach", "coglab_bringup",
            "coglab_console", "ih2_hand", "executive_smach/smach", "executive_smach/smach_ros")  # fmt: skip
# Packages without types of their own, or whose calls are not typed.
UNTYPED = {
    "selenium",
    "rospy",
    "actionlib",
    "tf2_ros",
    "smach_ros",
    "rosbag",
    "rosgraph",
    "rospkg",
    "genpy",
    "diagnostic_updater",
}
# What --strict sets for a module, but for numpy's generics, which say nothing here, and for Any from untyped packages.
STRICT = ("disallow_untyped_defs", "disallow_incomplete_defs", "disallow_untyped_calls", "disallow_untyped_decorators",
          "check_untyped_defs", "strict_equality", "strict_concatenate", "warn_unused_ignores")  # fmt: skip


def imported(path: Path) -> Iterator[str]:
    """Top-level names of what a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield node.module.split(".")[0]


def typed_all_through(path: Path) -> bool:
    return not any(name in UNTYPED or name.endswith("_msgs") or name == "std_srvs" for name in imported(path))


@pytest.mark.skipif(shutil.which("mypy") is None, reason="mypy is not installed: ./coglab install test")
def test_the_python_that_ships_is_typed(tmp_path):
    files, strict = [], []
    for package in PACKAGES:
        source = SOURCES / package / "src"
        for path in sorted(source.rglob("*.py")):
            files.append(path)
            if typed_all_through(path):
                strict.append(".".join(path.relative_to(source).with_suffix("").parts).removesuffix(".__init__"))
        files += sorted((SOURCES / package / "scripts").glob("*.py"))
    assert len(files) > 100 and len(strict) > 70
    config = tmp_path / "mypy.ini"
    section = f"\n[mypy-{','.join(strict)}]\n" + "".join(f"{name} = true\n" for name in STRICT)
    config.write_text((TOP / "mypy.ini").read_text(encoding="utf-8") + section)
    command = ["mypy", "--config-file", str(config), "--cache-dir", str(tmp_path / "cache"), *map(str, files)]
    ended = subprocess.run(command, cwd=TOP, capture_output=True, text=True, timeout=600, check=False)
    assert ended.returncode == 0, ended.stdout[-6000:] + ended.stderr
