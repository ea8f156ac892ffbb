"""Arrows between the packages of coglab_smach run downward only; ROS client libraries stay behind the last door."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src" / "coglab_smach"
DOORS = ("clocks", "kinematics", "ports", "contact", "context", "states", "machines", "ros")
"""from the bottom up"""
CLIENT_LIBRARIES = {"rospy", "actionlib", "tf2_ros", "smach_ros", "roslib", "rosbag"}
MODULES = sorted(path for path in SOURCE.rglob("*.py") if path.parent != SOURCE)


def imports(path: Path) -> list[str]:
    """Full names of the modules that a file imports, wherever in it."""
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute, so that their door can be read"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return found


def test_every_module_is_behind_a_door():
    assert {path.name for path in SOURCE.glob("*.py")} == {"__init__.py"}
    assert {path.name for path in SOURCE.iterdir() if (path / "__init__.py").exists()} == set(DOORS)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_a_module_imports_nothing_above_its_door(path):
    here = path.relative_to(SOURCE).parts[0]
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "coglab_smach" and len(parts) > 1:
            assert DOORS.index(parts[1]) <= DOORS.index(here), f"{here} imports {name}"
        assert here == "ros" or parts[0] not in CLIENT_LIBRARIES, f"{here} imports {name}: that belongs to ros"
        assert parts[0] not in ("coglab_sim", "coglab_trials", "coglab_bringup"), f"{name} is above this package"


def test_modules_import_each_other_in_no_circle():
    """Of modules of one door, too: each can be imported alone."""
    graph = {}
    for path in MODULES:
        name = "coglab_smach." + ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        graph[name.removesuffix(".__init__")] = imports(path)
    state: dict[str, str] = {}

    def visit(name: str, way: tuple[str, ...]) -> None:
        assert state.get(name) != "open", f"circle: {' -> '.join((*way, name))}"
        if name in state:
            return
        state[name] = "open"
        for imported in graph[name]:
            target = imported if imported in graph else imported.rpartition(".")[0]
            if target in graph and target != name:
                visit(target, (*way, name))
        state[name] = "done"

    for module in graph:
        visit(module, ())
