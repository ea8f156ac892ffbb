"""The brain uses only features that the ROS distributions' smach and smach_ros also have."""

import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent


def run_on(engine, *files):
    """Run other_engine.py in its own process. Returns its output."""
    ended = subprocess.run(
        [sys.executable, str(PACKAGE / "test" / "other_engine.py"), engine, *files],
        cwd=PACKAGE / "test",
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert ended.returncode == 0, (ended.stdout + ended.stderr)[-3000:]
    return ended.stdout.splitlines()


def handover_on(engine):
    """The report of a handover on this engine."""
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
def test_motion_ownership_on_the_engine_of_the_ros_distributions():
    lines = run_on(str(distribution()), "test_motion_ownership.py")
    assert Path(lines[0]).resolve().is_relative_to(distribution()) and " passed" in lines[-1]
