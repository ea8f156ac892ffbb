"""Many jobs in new processes. A process that dies or hangs costs one job, never the whole run."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

from coglab_trials.virtual_clock import ClockStalled

TRIES = 2  # a job with a lost process, or a stalled clock on a busy machine, runs again


class WorkerLost(RuntimeError):
    """The process of a job died or took too long."""


def search_workspace_first() -> None:
    """Moves the folders of PYTHONPATH to the front of ``sys.path``. A new process takes over this path. The packages of
    catkin's devel space put their source folders before it, in which there are no compiled modules."""
    first = [one for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one in sys.path]
    sys.path[:] = first + [one for one in sys.path if one not in first]


def run_each(
    function: Callable[[Any], Any], jobs: Sequence[Any], workers: int, limit: float | None = None
) -> Iterator[tuple[int, Any]]:
    """Calls ``function(job)`` for each job in ``workers`` new processes. Yields (index of the job, result) as they end.

    A result that is an exception was raised by the function. WorkerLost: the process died, or took more than ``limit``
    s of wall time, twice. Such a job, and one with ClockStalled, runs again once. All processes end with the iterator.
    The main script needs ``if __name__ == "__main__":``, because each process imports it."""
    from pebble import ProcessPool

    search_workspace_first()
    context = multiprocessing.get_context("spawn")
    # Ctrl-C is for the caller, which ends the processes.
    ignore = {"initializer": signal.signal, "initargs": (signal.SIGINT, signal.SIG_IGN)}
    pool = ProcessPool(max(1, min(workers, len(jobs))), context=context, **ignore)
    ended: SimpleQueue[tuple[int, int, Future[bytes]]] = SimpleQueue()

    def ask(index: int, tries: int) -> None:
        asked = pool.schedule(_call, (function, jobs[index]), timeout=limit)
        asked.add_done_callback(lambda future: ended.put((index, tries, future)))

    try:
        for index in range(len(jobs)):
            ask(index, TRIES)
        left = len(jobs)
        while left:
            index, tries, future = ended.get()
            result = _answer(future, limit)
            if isinstance(result, (WorkerLost, ClockStalled)) and tries > 1:
                ask(index, tries - 1)
            else:
                left -= 1
                yield index, result
    finally:
        pool.stop()
        pool.join()


def _call(function: Callable[[Any], Any], job: Any) -> bytes:
    """Runs one job in its process. Returns its result or its exception, pickled as multiprocessing does it. A
    failed pickling is thus an error of the job, and does not end the pool."""
    try:
        result = function(job)
    except Exception as error:
        error.add_note(f"In the process of the job:\n{traceback.format_exc()}")
        result = _stalled(error) or error
    try:
        return pickle.dumps(result)
    except Exception as error:
        words = f"the result {result!r:.200} cannot be sent to another process: {error}"
        return pickle.dumps(RuntimeError(words))


def _answer(future: Future[bytes], limit: float | None) -> Any:
    """Result of a job, the exception that it raised, or WorkerLost."""
    from pebble import ProcessExpired

    try:
        answer = future.result()
    except TimeoutError:
        return WorkerLost(f"it took more than {limit:g} s")
    except ProcessExpired as error:
        code = error.exitcode
        how = f"was ended by signal {-code}" if code < 0 else f"ended with status {code}"
        return WorkerLost(f"its process {how} before it answered")
    try:
        return pickle.loads(answer)  # from a process that run_each() itself has started
    except Exception as error:
        return RuntimeError(f"its result cannot be read: {error}")


def _stalled(error: BaseException | None) -> ClockStalled | None:
    """ClockStalled among the causes of an error: state machines raise their own errors from it."""
    while error is not None and not isinstance(error, ClockStalled):
        error = error.__cause__ or error.__context__
    return error
