"""Runs a simulated study, from its first trial or after an interruption."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from coglab_tools.command import CheckFailed, CommandError, plural, progress
from coglab_tools.study import cluster, simulate
from coglab_tools.study.plan import Study
from coglab_tools.study.recordings import RECORDINGS
from coglab_tools.study.rows import open_rows, undone, write_table


def run_simulated(study: Study, workers: int = 0, scheduler: str = "") -> dict[str, Any]:
    """Run all trials that are not done yet, and write trials.csv. Returns numbers of trials and handovers.

    ``workers``, ``scheduler``: see cluster.results. After any interruption, the finished trials are kept.
    """
    with open_rows(study, write=True) as rows:
        left = list(undone(study, rows))
        if left:
            rows.begin(simulate.identity(), simulated=True)
        jobs = [simulate.job_of(study, trial) for trial in left]
        done = cluster.results(jobs, workers, scheduler) if jobs else iter(())
        try:
            for job, found, recording in progress(done, len(jobs), f"trials of {study.name}"):
                if recording:
                    _keep(recording, study.folder / RECORDINGS / job.trial.label)
                rows.add(job.trial.number, found)
        except CommandError as error:
            kind = type(error)
            state = f"{len(rows.trials)} of {plural(len(study.trials()), 'trial')} done and kept"
            verb = "resume" if rows.trials else "run"
            raise kind(f"{error}. {state}; to go on: ./coglab study {verb} {study.folder}") from error
        everything = rows.table()
        table = write_table(study, everything)
        return {
            "study": study.name,
            "trials": len(rows.trials),
            "trials_now": len(jobs),
            "handovers": len(everything),
            "succeeded": sum(int(row["success"]) for row in everything),
            "table": str(table),
        }


def _keep(recording: bytes, folder: Path) -> None:
    try:
        simulate.unpack(recording, folder)
    except OSError as error:
        raise CheckFailed(f"{folder} cannot be written: {error.strerror}; free the disk") from None
