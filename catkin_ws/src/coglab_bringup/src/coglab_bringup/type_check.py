"""mypy on the Python that ships: strict on modules and scripts that import no ROS, plain on the others.

`python3 -m coglab_bringup.type_check`, with the folder of this package in PYTHONPATH; pre-commit and the tests run it.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

TOP = Path(__file__).resolve().parents[5]
SOURCES = TOP / "catkin_ws" / "src"
PACKAGES = ("coglab_py", "coglab_objects", "coglab_perception", "coglab_contact", "coglab_sim", "coglab_smach",
            "coglab_trials", "coglab_bringup", "coglab_console", "coglab_controllers", "ctrl_more", "ih2_hand",
            "executive_smach/smach", "executive_smach/smach_ros")  # fmt: skip
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
    """Whether all that a module imports has types."""
    return not any(name in UNTYPED or name.endswith("_msgs") or name == "std_srvs" for name in imported(path))


def shipped_files() -> tuple[list[Path], list[str]]:
    """All files to check, and the names of those modules and scripts that are checked strictly."""
    files: list[Path] = []
    strict: list[str] = []
    for package in PACKAGES:
        source = SOURCES / package / "src"
        for path in sorted(source.rglob("*.py")):
            files.append(path)
            if typed_all_through(path):
                strict.append(".".join(path.relative_to(source).with_suffix("").parts).removesuffix(".__init__"))
        for path in sorted((SOURCES / package / "scripts").glob("*.py")):
            files.append(path)
            if typed_all_through(path):
                strict.append(path.stem)
    return files, strict


def main() -> int:
    """Exit status and output of mypy."""
    files, strict = shipped_files()
    section = f"\n[mypy-{','.join(strict)}]\n" + "".join(f"{name} = true\n" for name in STRICT)
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "mypy.ini"
        config.write_text((TOP / "mypy.ini").read_text(encoding="utf-8") + section)
        command = ["mypy", "--config-file", str(config), "--cache-dir", f"{folder}/cache", *map(str, files)]
        try:
            return subprocess.run(command, cwd=TOP, timeout=600, check=False).returncode
        except FileNotFoundError:
            print("mypy is not installed: ./coglab install test", file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main())
