"""Runs the trials of a simulated study: in this process, on all cores, or on the workers of a Dask scheduler.

Dask sends functions and results as pickles between its own processes. So a scheduler and its workers must trust each
other and everybody who can reach their ports: by default, all of them are on the loopback address.
"""

from __future__ import annotations

import logging
import os
import signal
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from coglab_tools.command import CheckFailed, NotThere, UsageError
from coglab_tools.study import simulate

Done = tuple[simulate.Job, list[dict[str, Any]], bytes]

PATIENCE = 30.0  # s without any worker, before the study is interrupted
LOOK = 2.0  # s between two looks at the workers, while no trial ends
AHEAD = 3  # trials that wait at each thread of a worker
MOST_WORKERS = 1024
LOCAL = "127.0.0.1:0"  # of Dask's web servers, which are on every network otherwise


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def results(jobs: Sequence[simulate.Job], workers: int = 0, scheduler: str = "") -> Iterator[Done]:
    """Yield each job with its rows and its recording, in the order in which they end.

    ``workers``: processes on this computer; 0: one per core; 1: in this process, without Dask. ``scheduler``: address
    of a Dask scheduler, such as tcp://127.0.0.1:8786, instead of them.
    CheckFailed: a trial raised an exception, or a worker has other code. NotThere: the scheduler or its workers are
    lost. Results that came before are valid.
    """
    if not 0 <= workers <= MOST_WORKERS or (scheduler and workers):
        raise UsageError(f"0 to {MOST_WORKERS} workers are expected, and none beside a scheduler; got {workers}")
    count = min(workers or cores(), max(1, len(jobs)))
    if not scheduler and count == 1:
        for job in jobs:
            yield (job, *_own(job))
        return
    import dask
    import distributed

    for name in ("asyncio", "distributed", "distributed.client"):  # each has its own level
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported here in one sentence
    dask.config.set({"distributed.comm.timeouts.connect": "10s", "distributed.scheduler.allowed-failures": 3})
    if scheduler:
        yield from _with_scheduler(jobs, distributed, scheduler)
        return
    with tempfile.TemporaryDirectory() as place, local_cluster(distributed, count, place) as cluster:
        yield from _with_scheduler(jobs, distributed, cluster)


def local_cluster(distributed: Any, count: int, place: str) -> Any:
    """A cluster on this computer's loopback. Ctrl-C reaches only this process, which ends the workers itself."""
    main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if main else None  # children inherit it
    try:
        return distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": LOCAL},
            worker_dashboard_address=LOCAL,
            memory_limit=0,
            local_directory=place,
            silence_logs=logging.CRITICAL,
        )
    finally:
        if main:
            signal.signal(signal.SIGINT, before)


def _own(job: simulate.Job) -> tuple[list[dict[str, Any]], bytes]:
    try:
        return simulate.run(job)
    except Exception as error:
        raise _failed(job, error) from error


def _failed(job: simulate.Job, error: BaseException) -> CheckFailed:
    what = f"{type(error).__name__}: {error}"
    return CheckFailed(f"trial {job.trial.number} ({job.trial.label}, seed {job.trial.seed}) raised {what}")


def _with_scheduler(jobs: Sequence[simulate.Job], distributed: Any, place: Any) -> Iterator[Done]:
    try:
        client = distributed.Client(place, timeout=10)
    except (OSError, ValueError, TimeoutError) as error:
        raise NotThere(
            f"no Dask scheduler answers at {place} ({error}); start one: ./coglab shell dask-scheduler --host 127.0.0.1"
        ) from None
    try:
        yield from _gathered(jobs, distributed, client)
    finally:
        with suppress(OSError, distributed.TimeoutError):  # a lost scheduler does not answer
            client.close(timeout=5)


def _gathered(jobs: Sequence[simulate.Job], distributed: Any, client: Any) -> Iterator[Done]:
    """Keep a few trials waiting at each worker, until all are done."""
    waiting = list(reversed(jobs))
    running: dict[Any, simulate.Job] = {}
    seen = time.monotonic()
    while waiting or running:
        threads = _threads(client)
        while waiting and len(running) < AHEAD * max(1, threads):
            job = waiting.pop()
            running[client.submit(simulate.run, job, pure=False)] = job
        try:
            ended = distributed.wait(list(running), timeout=LOOK, return_when="FIRST_COMPLETED").done
        except distributed.TimeoutError:
            ended = ()
        except distributed.CancelledError:
            ended = [future for future in running if future.cancelled()]
        now = time.monotonic()
        seen = now if threads else seen
        if now - seen > PATIENCE:
            raise NotThere(
                f"the scheduler has had no worker for {PATIENCE:g} s; start one in the workspace of each computer: "
                "./coglab shell dask-worker ADDRESS --nthreads 1 --nworkers auto"
            )
        for future in ended:
            yield (running[future], *_result(client, distributed, future, running.pop(future)))


def _threads(client: Any) -> int:
    """Threads of all workers now. NotThere if the scheduler is lost."""
    if client.status != "running":
        raise _lost()
    try:
        return sum(worker["nthreads"] for worker in client.scheduler_info()["workers"].values())
    except (OSError, KeyError, TimeoutError):
        raise _lost() from None


def _lost() -> NotThere:
    return NotThere("the Dask scheduler was lost; the trials that ended before are kept")


def _result(client: Any, distributed: Any, future: Any, job: simulate.Job) -> tuple[list[dict[str, Any]], bytes]:
    try:
        found: tuple[list[dict[str, Any]], bytes] = future.result(timeout=60)
        return found
    except simulate.OtherVersion as error:
        raise CheckFailed(
            f"a worker has another version: {error}; bring this version to all computers, build it there, and start "
            "the workers again"
        ) from None
    except distributed.CancelledError:
        raise _lost() from None
    except ModuleNotFoundError as error:
        raise CheckFailed(
            f"a worker has no {error.name}: start it in the workspace, ./coglab shell dask-worker ADDRESS"
        ) from None
    except distributed.KilledWorker:
        raise CheckFailed(
            f"trial {job.trial.number} ({job.trial.label}) has ended four workers one after the other: is their memory "
            "full? ./coglab study run --workers 1 shows what happens"
        ) from None
    except Exception as error:
        raise _failed(job, error) from None
