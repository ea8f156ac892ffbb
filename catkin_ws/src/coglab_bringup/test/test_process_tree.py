"""No process of a command outlives it, not even one that forks twice, opens its own session and ignores signals."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from tree_of_processes import Marked, wait_until

TOP = Path(__file__).resolve().parents[4]
TREE = Path(__file__).resolve().parents[1] / "src" / "coglab_bringup" / "process_tree.py"
GONE_LIMIT = 120.0  # s

# The worst possible node of roslaunch: daemon by double fork, own session, only SIGKILL ends it.
STUBBORN = """
import os, signal, sys, time
for sign in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(sign, signal.SIG_IGN)
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        os.setsid()
        time.sleep(300)
    os._exit(0)
os.wait()
print("ready", flush=True)
{end}
"""
STAYS = STUBBORN.format(end="time.sleep(300)")
ENDS = STUBBORN.format(end="sys.exit(3)")
ENTRY_POINTS = {
    "module": [sys.executable, "-I", str(TREE), sys.executable, "-c"],
    "coglab": [str(TOP / "coglab"), "shell", "/usr/bin/python3", "-c"],
}


# Tests in the background or under nohup inherit ignored signals.
HEARS = ["env", "--default-signal=INT,HUP"]


def start(script: str, entry: str = "module") -> tuple[Marked, subprocess.Popen]:
    """Start the script and wait until its tree is complete."""
    marked = Marked()
    process = subprocess.Popen(
        [*HEARS, *ENTRY_POINTS[entry], script],
        env=marked.environment(),
        text=True,
        stdout=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
    )
    assert process.stdout.readline() == "ready\n"
    return marked, process


def keeper_of(front: int) -> int:
    """The only child of the front."""
    return int(Path(f"/proc/{front}/task/{front}/children").read_text().split()[0])


def test_signals_to_the_command_and_sigkill_of_front_and_keeper():
    bystander = subprocess.Popen(["sleep", "300"])  # with the same parent and process group
    runs = {}
    for how in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL, "keeper"):
        marked, process = runs[how] = start(STAYS)
        assert len(marked.alive()) == 4  # two of ours, the command, its daemon
        if how == "keeper":
            os.kill(keeper_of(process.pid), signal.SIGKILL)
        else:
            process.send_signal(how)
    for how, (marked, process) in runs.items():
        assert wait_until(lambda m=marked: not m.alive(), GONE_LIMIT), (how, marked.alive())
        assert process.wait(60.0) != 0
    assert bystander.poll() is None
    bystander.kill()
    bystander.wait()


def test_the_entry_point_killed():
    marked, process = start(STAYS, "coglab")
    process.kill()
    process.wait(60.0)
    assert wait_until(lambda: not marked.alive(), GONE_LIMIT), marked.alive()


def test_a_command_that_leaves_a_daemon_and_ends():
    marked, process = start(ENDS)
    assert process.wait(GONE_LIMIT) == 3
    assert not marked.alive()


def test_a_command_may_print_and_exit_with_its_own_status_on_ctrl_c():
    script = "import signal, sys, time\ntry:\n    print('ready', flush=True); time.sleep(300)\n"
    script += "except KeyboardInterrupt:\n    print('bye', flush=True); sys.exit(9)\n"
    marked, process = start(script)
    process.send_signal(signal.SIGINT)
    assert process.wait(GONE_LIMIT) == 9 and process.stdout.read() == "bye\n"
    assert not marked.alive()


@pytest.mark.parametrize(
    "command, status", [(["sh", "-c", "exit 7"], 7), (["/no/such/file"], 127), (["sh", "-c", "kill -9 $$"], 137)]
)
def test_the_status_of_the_command(command, status):
    assert subprocess.run([*ENTRY_POINTS["module"][:3], *command], check=False).returncode == status
