"""The sample of random messages on the other two ways to start: bridge and controller manager as two nodes with the
goal helper, and the ideal arm (./coglab test --long; each starts a system of its own)."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from coglab_bringup.run_directory import free_port, run_environment

pytestmark = pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: ./coglab test --long")


@pytest.mark.parametrize("way, least", [("split", 60), ("ideal", 5)])
def test_random_messages(way, least, tmp_path):
    report = tmp_path / "report.json"
    environment = run_environment(free_port(), tmp_path)
    environment.update(COGLAB_LONG="0", COGLAB_FUZZ_LAUNCH=way, COGLAB_FUZZ_REPORT=str(report))
    run = subprocess.run(
        ["rostest", "-t", str(Path(__file__).with_name("fuzz.test"))],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        timeout=600,
        check=False,
    )
    assert run.returncode == 0 and " * RESULT: SUCCESS" in run.stdout, run.stdout[-6000:]
    found = json.loads(report.read_text())
    assert found["way"] == way and found["topics"] >= least
