"""Jobs in their own processes: results for a process that dies, hangs or has a stalled clock."""

import os
import signal
import subprocess
import sys
import time

import pytest
from coglab.workers import WorkerLost, run_each
from coglab_trials.virtual_clock import ClockStalled


class Odd(Exception):
    """pickle cannot load it: the arguments do not fit."""

    def __init__(self, one, two):
        super().__init__(one)


def job(what):
    name, marker = what
    first = marker is None or not marker.exists()
    if marker is not None:
        marker.touch()
    if name == "killed" and first:
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "stalled" and first:
        try:
            raise ClockStalled("for 60 s")
        except ClockStalled as error:
            raise RuntimeError("a state raised") from error
    if name == "hangs":
        time.sleep(600.0)
    if name == "wrong":
        raise ArithmeticError("1 + 1")
    if name == "odd":
        raise Odd(1, 2)
    return None if name == "nothing" else f"{name} done"


@pytest.mark.parametrize("workers", [1, 3])
def test_each_job_has_a_result_even_if_its_process_dies(tmp_path, workers):
    once = ("killed", tmp_path / "killed"), ("stalled", tmp_path / "stalled")
    jobs = [
        ("plain", None),
        *once,
        ("killed", None),
        ("stalled", None),
        ("wrong", None),
        ("odd", None),
        ("plain", None),
        ("nothing", None),
        (lambda: "cannot be pickled", None),
    ]
    found = dict(run_each(job, jobs, workers))
    assert sorted(found) == list(range(len(jobs)))
    assert [found[i] for i in (0, 1, 2, 7)] == ["plain done", "killed done", "stalled done", "plain done"]
    assert found[8] is None and isinstance(found[9], TypeError)
    assert isinstance(found[3], WorkerLost) and "signal 9" in str(found[3])
    assert isinstance(found[4], ClockStalled) and isinstance(found[6], RuntimeError)
    assert isinstance(found[5], ArithmeticError) and "test_workers.py" in found[5].__notes__[0]  # with its line


CALLER = """
import os, signal
from coglab.workers import run_each

def job(_):
    os.kill(os.getppid(), signal.SIGSTOP)
    os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    print(*(type(result).__name__ for _, result in run_each(job, range(2), 1)))
"""


def test_a_death_while_the_caller_is_stopped_is_not_missed(tmp_path):
    """A busy computer may not run the caller while a job begins and dies."""
    program = tmp_path / "caller.py"
    program.write_text(CALLER)
    with subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True) as caller:
        end = time.monotonic() + 120.0
        while caller.poll() is None:
            caller.send_signal(signal.SIGCONT if time.monotonic() < end else signal.SIGKILL)
            time.sleep(0.1)
        assert caller.stdout.read().split() == ["WorkerLost"] * 2


def test_a_job_that_hangs_ends_at_its_limit():
    begun = time.monotonic()
    ((_, result),) = run_each(job, [("hangs", None)], 2, limit=1.0)
    assert isinstance(result, WorkerLost) and "1 s" in str(result)
    assert time.monotonic() - begun < 300.0
