"""Joins the rows of a live study with the recordings of its handovers, for measures that need a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from coglab_tools.command import CheckFailed, CommandError, progress
from coglab_tools.study.plan import Study

RECORDINGS = "recordings"
NEAR = 10.0  # s between the request of a handover and the start of its recording


def joined(study: Study, table: Sequence[Mapping[str, Any]]) -> tuple[list[dict[str, Any]], list[str]]:
    """Returns the rows with the measures of their recordings, and a sentence for each unreadable recording.

    A recording belongs to the row of its session and action that was requested last before it. A row that has no
    recording stays as it is.
    """
    from coglab.results import ACTIONS

    from coglab_tools.report.metrics import metrics_of
    from coglab_tools.trial.read import read_trial
    from coglab_tools.trial.record import TrialRecord

    rows = [dict(row) for row in table]
    problems: list[str] = []
    folders = [file.parent for file in sorted((study.folder / RECORDINGS).glob("*/trial.yaml"))]
    live = [row for row in rows if row.get("session")]
    for folder in progress(folders if live else [], len(folders), "recordings"):
        try:
            record = TrialRecord.load(folder)
            mine = [
                row
                for row in live
                if row["session"] == record.session and ACTIONS.get(row["action"]) == record.action
                if 0.0 <= _seconds(record.started) - _seconds(row["started_utc"]) <= NEAR
            ]
            if not mine:
                continue
            row = max(mine, key=lambda row: str(row["started_utc"]))
            found = metrics_of(read_trial(folder))
        except (CommandError, ValueError) as error:
            problems.append(str(error) if isinstance(error, CheckFailed) else f"{folder}: {error}")
            continue
        row["recording"] = folder.name
        for name, value in found.items():
            if value is not None:
                row.setdefault(name, value)
    return rows, problems


def _seconds(utc: str) -> float:
    """Time (s) of a UTC stamp in ISO 8601. ValueError: it is invalid."""
    return datetime.fromisoformat(utc.replace("Z", "+00:00")).timestamp()
