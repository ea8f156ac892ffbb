"""Many jobs in new processes. A process that dies or hangs costs one job, never the whole run."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing import connection
from typing import Any

from coglab_trials.virtual_clock import ClockStalled

BEGUN = b"begun"  # what a process sends when it begins a job
STOP_LIMIT = 3.0  # s that a process has to end by itself
TRIES = 2  # a job with a lost process, or a stalled clock on a busy machine, runs again


class WorkerLost(RuntimeError):
    """The process of a job died or took too long."""


def search_workspace_first() -> None:
    """Moves the folders of PYTHONPATH to the front of ``sys.path``. A new process takes over this path. The packages of
    catkin's devel space put their source folders before it, in which there are no compiled modules."""
    first = [one for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one in sys.path]
    sys.path[:] = first + [one for one in sys.path if one not in first]


class _Worker:
    """One new process that answers job after job. It sends BEGUN when it begins a job, and then the answer.

    A pool of a library lost jobs here: a process that died before its parent had read that it had begun was not missed.
    Each process has a pipe of its own, so its end is seen as the end of the pipe."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, function), name="job")
        self._process.start()
        theirs.close()
        self.death = self._process.sentinel
        """ready to be read when the process is dead, also if a child of it keeps the pipe open"""
        self.index = self.tries = 0
        self.end: float | None = None
        """s, steady clock: end of the job's time"""

    def ask(self, index: int, tries: int, job: bytes) -> None:
        """Sends a pickled job."""
        self.index, self.tries, self.end = index, tries, None
        with suppress(ConnectionError):  # it died while it was idle or started: its pipe is at its end
            self.pipe.send_bytes(job)

    def is_late(self) -> bool:
        """True if the job has taken too long."""
        return self.end is not None and time.monotonic() > self.end

    def answer(self, limit: float | None) -> Any:
        """The next message: BEGUN, or the result of the job, or WorkerLost."""
        try:
            message = self.pipe.recv_bytes()
        except (EOFError, OSError):
            return self.lost()
        if message == BEGUN:
            self.end = None if limit is None else time.monotonic() + limit
            return BEGUN
        try:
            return pickle.loads(message)  # from a process that run_each() itself has started
        except Exception as error:
            return RuntimeError(f"its result cannot be read: {error}")

    def lost(self) -> WorkerLost:
        """How the process has ended."""
        self._process.join(STOP_LIMIT)
        code = self._process.exitcode or 0
        how = f"was ended by signal {-code}" if code < 0 else f"ended with status {code}"
        return WorkerLost(f"its process {how} before it answered")

    def stop(self) -> None:
        """Ends the process, whatever it does."""
        self._process.terminate()
        self._process.join(STOP_LIMIT)
        self._process.kill()
        self._process.join()
        self.pipe.close()


def run_each(
    function: Callable[[Any], Any], jobs: Sequence[Any], workers: int, limit: float | None = None
) -> Iterator[tuple[int, Any]]:
    """Calls ``function(job)`` for each job in ``workers`` new processes. Yields (index of the job, result) as they end.

    A result that is an exception was raised by the function. WorkerLost: the process died, or took more than ``limit``
    s of wall time, twice. Such a job, and one with ClockStalled, runs again once. All processes end with the iterator.
    The main script needs ``if __name__ == "__main__":``, because each process imports it."""
    search_workspace_first()
    left = deque((index, TRIES) for index in range(len(jobs)))
    idle: list[_Worker] = []
    busy: list[_Worker] = []
    try:
        while left or busy:
            while left and len(busy) < max(1, workers):
                index, tries = left.popleft()
                try:
                    job = pickle.dumps(jobs[index])
                except Exception as error:
                    words = f"job {index} cannot be sent to another process ({error}); it must be made of a module's"
                    yield index, TypeError(f"{words} functions and classes, not of lambdas or local ones")
                    continue
                busy.append(idle.pop() if idle else _Worker(function))
                busy[-1].ask(index, tries, job)
            for worker, result in _ended(busy, limit):
                busy.remove(worker)
                if isinstance(result, WorkerLost):
                    worker.stop()
                else:
                    idle.append(worker)
                if isinstance(result, (WorkerLost, ClockStalled)) and worker.tries > 1:
                    left.append((worker.index, worker.tries - 1))
                else:
                    yield worker.index, result
    finally:
        for worker in idle + busy:
            worker.stop()


def _ended(busy: Sequence[_Worker], limit: float | None) -> list[tuple[_Worker, Any]]:
    """Waits for messages or the end of a job's time. Returns the workers whose job has ended, and its result."""
    if not busy:
        return []
    ends = [worker.end for worker in busy if worker.end is not None]
    rest = max(0.0, min(ends) - time.monotonic()) if ends else None
    ready = connection.wait([*(worker.pipe for worker in busy), *(worker.death for worker in busy)], rest)
    found: list[tuple[_Worker, Any]] = []
    for worker in busy:
        if worker.pipe in ready:
            result = worker.answer(limit)
            if result is not BEGUN:
                found.append((worker, result))
        elif worker.death in ready:
            found.append((worker, worker.lost()))
        elif worker.is_late():
            found.append((worker, WorkerLost(f"it took more than {limit:g} s")))
    return found


def _serve(pipe: connection.Connection, function: Callable[[Any], Any]) -> None:
    """The process of a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the caller, which ends the processes
    while True:
        try:
            job = pipe.recv_bytes()
        except EOFError:
            return
        pipe.send_bytes(BEGUN)
        pipe.send_bytes(_call(function, job))


def _call(function: Callable[[Any], Any], job: bytes) -> bytes:
    """Runs one pickled job in its process. Returns its result or its exception, pickled as multiprocessing does it. A
    failed pickling is thus an error of the job, and does not end the process."""
    try:
        result = function(pickle.loads(job))  # from the process that has started this one
    except Exception as error:
        error.add_note(f"In the process of the job:\n{traceback.format_exc()}")
        result = _stalled(error) or error
    try:
        return pickle.dumps(result)
    except Exception as error:
        words = f"the result {result!r:.200} cannot be sent to another process: {error}"
        return pickle.dumps(RuntimeError(words))


def _stalled(error: BaseException | None) -> ClockStalled | None:
    """ClockStalled among the causes of an error: state machines raise their own errors from it."""
    while error is not None and not isinstance(error, ClockStalled):
        error = error.__cause__ or error.__context__
    return error
