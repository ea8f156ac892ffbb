"""The brain needs nothing of smach and smach_ros but what the ROS distributions' packages have too."""

import ast
import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path

import pytest

MODULES = {
    "smach": "State CBState Container StateMachine Sequence Concurrence Iterator UserData Remapper CBInterface "
    "cb_interface has_smach_interface InvalidTransitionError InvalidStateError InvalidConstructionError "
    "InvalidUserCodeError set_loggers loginfo logwarn logerr logdebug set_shutdown_check is_shutdown",
    "smach.state": "State CBState",
    "smach.user_data": "UserData Remapper",
    "smach.container": "Container",
    "smach.state_machine": "StateMachine",
    "smach.sequence": "Sequence",
    "smach.concurrence": "Concurrence",
    "smach.iterator": "Iterator",
    "smach.util": "CBInterface cb_interface has_smach_interface",
    "smach.log": "set_loggers loginfo logwarn logerr logdebug",
    "smach.exceptions": "SmachError InvalidTransitionError InvalidStateError InvalidConstructionError "
    "InvalidUserCodeError",
}
"""Public names of each module of smach 2.5."""

ROS_NAMES = (
    "IntrospectionServer IntrospectionClient SimpleActionState ServiceState MonitorState ConditionState "
    "ActionServerWrapper set_preempt_handler"
)
"""Public names of smach_ros 2.5 that are not those of its modules."""
PACKAGE = Path(__file__).resolve().parent.parent
ALLOWED = {f"{module}.{name}" for module, names in MODULES.items() for name in names.split()}
ALLOWED |= {f"smach_ros.{name}" for name in ROS_NAMES.split()} | set(MODULES) | {"smach_ros"}


def dotted(node):
    """'smach.concurrence.threading' of such an expression, '' of another one."""
    if isinstance(node, ast.Name):
        return node.id
    before = dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{before}.{node.attr}" if before else ""


def names_used(path):
    """Names of the engine in a file: what it imports and what it takes from the modules."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Attribute):
            yield dotted(node)


def test_only_names_that_every_engine_has():
    for folder in ("src", "scripts"):
        for path in sorted((PACKAGE / folder).rglob("*.py")):
            used = {name for name in names_used(path) if name.split(".")[0] in ("smach", "smach_ros")}
            # One level below a class or function (StateMachine.add) is judged by running it.
            used = {name for name in used if name.rpartition(".")[0] not in ALLOWED - set(MODULES)}
            assert used - {"smach.concurrence.threading"} <= ALLOWED, path


def run_on(engine, *files):
    """What other_engine.py prints, in a process of its own."""
    ended = subprocess.run(
        [sys.executable, str(PACKAGE / "test" / "other_engine.py"), engine, *files],
        cwd=PACKAGE / "test",
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 0, (ended.stdout + ended.stderr)[-3000:]
    return ended.stdout.splitlines()


def handover_on(engine):
    """The report of a handover there."""
    report = json.loads(run_on(engine)[-1])
    assert [outcome for _, outcome, _ in report["outcomes"]] == ["succeeded", "succeeded"], report
    assert report["held_by"] == "human" and not report["dropped"] and report["limit_violations"] == 0
    assert report["last_hub"] == "wait_without_object" and report["pickled"] > 20
    return report


def distribution():
    """Folder of a copy of the ROS distributions' engine; None where the oracles are not installed."""
    try:
        return Path(importlib.metadata.distribution("standalone-smach").locate_file("")).resolve()
    except importlib.metadata.PackageNotFoundError:
        return None


@pytest.mark.skipif(distribution() is None, reason="standalone-smach is not installed (test-oracles.txt)")
def test_a_handover_on_the_engine_of_the_ros_distributions():
    assert Path(handover_on(str(distribution()))["engine"]).resolve().is_relative_to(distribution())


@pytest.mark.skipif(distribution() is None, reason="standalone-smach is not installed (test-oracles.txt)")
def test_who_starts_a_motion_ends_it_on_the_engine_of_the_ros_distributions():
    lines = run_on(str(distribution()), "test_motion_ownership.py")
    assert Path(lines[0]).resolve().is_relative_to(distribution()) and " passed" in lines[-1]
