"""Many jobs in new processes. A process that dies or hangs costs one job, never the whole run."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import Any

from coglab_trials.virtual_clock import ClockStalled

TRIES = 2  # a job whose process was lost, or whose clock stalled on a busy machine, runs once more


class WorkerLost(RuntimeError):
    """The process of a job died or took too long."""


def search_workspace_first() -> None:
    """Moves the folders of PYTHONPATH to the front of ``sys.path``. A new process takes over this path. The packages of
    catkin's devel space put their source folders before it, in which there are no compiled modules."""
    first = [one for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one in sys.path]
    sys.path[:] = first + [one for one in sys.path if one not in first]


def run_each(
    function: Callable[[Any], Any], jobs: Sequence[Any], workers: int, limit: float = math.inf
) -> Iterator[tuple[int, Any]]:
    """Calls ``function(job)`` for each job in ``workers`` new processes. Yields (index of the job, result) as they end.

    A result that is an exception was raised by the function. WorkerLost: the process died, or took more than ``limit``
    s of wall time, twice. Such a job, and one with ClockStalled, runs again once, in another process. All processes
    end with the iterator. The main script needs ``if __name__ == "__main__":``, because each process imports it."""
    search_workspace_first()
    left = deque((index, TRIES) for index in range(len(jobs)))
    idle: list[_Worker] = []
    busy: dict[Connection, _Worker] = {}
    try:
        while left or busy:
            while left and len(busy) < workers:
                worker = idle.pop() if idle else _Worker(function)
                index, tries = left.popleft()
                worker.begin(jobs[index], index, tries, limit)
                busy[worker.pipe] = worker
            now = time.monotonic()
            first = min(worker.end for worker in busy.values())
            answered = wait(list(busy), None if math.isinf(first) else max(0.0, first - now))
            ready = [pipe for pipe in busy if pipe in answered]
            late = [pipe for pipe, worker in busy.items() if worker.end <= now and pipe not in ready]
            for pipe in [*ready, *late]:
                worker = busy.pop(pipe)
                result = worker.result() if pipe in ready else WorkerLost(f"it took more than {limit:g} s")
                if isinstance(result, Exception):
                    worker.kill()  # threads of a stalled clock may still run there
                else:
                    idle.append(worker)
                if isinstance(result, (WorkerLost, ClockStalled)) and worker.tries > 1:
                    left.append((worker.index, worker.tries - 1))
                else:
                    yield worker.index, result
    finally:
        for worker in [*idle, *busy.values()]:
            worker.kill()


class _Worker:
    """A new process that runs one job after the other."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, function), daemon=True)
        self._process.start()
        theirs.close()  # so that the pipe ends with the process
        self.index, self.tries, self.end = 0, 0, math.inf

    def begin(self, job: Any, index: int, tries: int, limit: float) -> None:
        """Starts a job. ``limit``: s of wall time until ``end``, on time.monotonic()."""
        self.index, self.tries, self.end = index, tries, time.monotonic() + limit
        try:
            self.pipe.send(job)
        except OSError:
            pass  # it has died: result() says so

    def result(self) -> Any:
        """Result of the job, an exception that it raised, or WorkerLost."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            self._process.join(5.0)
            code = self._process.exitcode
            how = f"was ended by signal {-code}" if code is not None and code < 0 else f"ended with status {code}"
            return WorkerLost(f"its process {how} before it answered")
        except Exception as error:
            return WorkerLost(f"its result cannot be read: {error}")

    def kill(self) -> None:
        """Ends the process."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _serve(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """Runs jobs until the other end of the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the caller, which ends this process
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        try:
            result = function(job)
        except Exception as error:
            error.add_note(f"In the process of the job:\n{traceback.format_exc()}")
            result = _stalled(error) or error
        try:
            pipe.send(result)
        except OSError:
            return
        except Exception as error:  # cannot be sent to another process
            pipe.send(RuntimeError(f"the result {result!r:.200} cannot be sent to another process: {error}"))


def _stalled(error: BaseException | None) -> ClockStalled | None:
    """ClockStalled among the causes of an error: state machines raise errors of their own from it."""
    while error is not None and not isinstance(error, ClockStalled):
        error = error.__cause__ or error.__context__
    return error
