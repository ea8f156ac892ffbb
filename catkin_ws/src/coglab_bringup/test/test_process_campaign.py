"""Campaign: every command that starts others, ended by every signal at seeded moments; nothing of it may be left.

Each run ends at its own moment between the first process and the time by which the command would have ended or all
nodes stand. Gone means: 3 s after the signal no process lives that inherited the mark of this run.
"""

import os
import random
import signal
import subprocess
import time
from pathlib import Path

import pytest
from coglab_bringup.run_directory import free_port
from tree_of_processes import Marked, wait_until

TOP = Path(__file__).resolve().parents[4]
GONE = 3.0  # s
RUNS = int(os.environ.get("COGLAB_CAMPAIGN_RUNS", "10"))
COMMANDS = {  # and the latest moment of the signal, s
    "demo": ("demo --headless --out {out}", 25.0),
    "launch": ("launch", 15.0),
    "test": ("test --out {out} ih2_hand", 15.0),
    "bench": ("bench fri", 15.0),
    "shell": ("shell roslaunch -p {port} coglab_bringup coglab.launch", 15.0),
}

pytestmark = pytest.mark.skipif(not os.environ.get("COGLAB_LONG"), reason="campaign: ./coglab test --long")


@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_left(name, sign, tmp_path):
    words, latest = COMMANDS[name]
    draw = random.Random(f"{name} {sign.name}")
    left, most = [], 0
    for run in range(RUNS):
        moment = draw.uniform(0.1, latest)
        marked = Marked()
        command = words.format(out=tmp_path / str(run), port=free_port()).split()
        with (tmp_path / f"{run}.log").open("w") as log:
            process = subprocess.Popen(
                [TOP / "coglab", *command], env=marked.environment(), stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
            time.sleep(moment)
            most = max(most, len(marked.alive()))
            process.send_signal(sign)
            if not wait_until(lambda m=marked: not m.alive(), GONE):
                left.append((run, round(moment, 1), list(marked.alive().values())))
            assert wait_until(lambda m=marked: not m.alive(), 60.0), marked.alive()
            process.wait(10)
    print(f"{name} {sign.name}: {RUNS} runs, up to {most} processes, left after {GONE} s in {len(left)} runs")
    assert most > 3, "the command never had children: nothing was tried"
    assert not left
