"""The code blocks of the package's README run unchanged."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from own_master import own_master

README = (Path(__file__).resolve().parents[1] / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_python_blocks_run() -> None:
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), {})


def test_try_it_block_runs_with_the_ideal_arm() -> None:
    lines = [line for line in blocks("")[0].splitlines() if line]
    stays = [line for line in lines if line.startswith(("roslaunch", "rosrun"))]
    with own_master():
        running = [subprocess.Popen(line, shell=True, start_new_session=True, executable="/bin/bash") for line in stays]
        try:
            for line in lines[len(stays) :]:
                command = line.replace("rosservice call", "rosservice call --wait")
                done = subprocess.run(
                    command, shell=True, executable="/bin/bash", timeout=600, capture_output=True, text=True
                )
                assert done.returncode == 0 and "success: False" not in done.stdout, (line, done.stdout, done.stderr)
            assert "reached" in done.stdout or "running" in done.stdout
        finally:
            for process in running:
                os.killpg(process.pid, signal.SIGINT)
            for process in running:
                process.wait(timeout=60)
