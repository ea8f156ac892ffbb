"""The results of a study while it runs: ``rows.jsonl``, one line per finished trial, and ``trials.csv`` at the end.

A line is written and synced before the next trial counts, so a crash loses at most the trials that ran. The first line
holds the plan and the version: results of different plans or versions are never mixed. One process writes at a time.
"""

from __future__ import annotations

import csv
import errno
import fcntl
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from coglab_py.yaml_file import read

from coglab_tools.command import CheckFailed, UsageError
from coglab_tools.files import write_whole
from coglab_tools.study.plan import FILE, OWN_FILES, Study
from coglab_tools.study.questionnaires import answers_of, scores_of

ROWS, TABLE = "rows.jsonl", "trials.csv"
LEADING = (
    "trial", "participant", "block", "condition", "repetition", "handover", "action", "object", "success", "outcome",
    "reason_code", "reason", "duration_s",
)  # fmt: skip
"""first columns of trials.csv; the measures follow"""


class Rows:
    """The finished trials of a study: rows of handovers by number of the trial."""

    def __init__(self, study: Study, stream: IO[bytes] | None, header: dict[str, Any] | None) -> None:
        self.study, self.header = study, header
        self.trials: dict[int, list[dict[str, Any]]] = {}
        self.dropped = 0
        """bytes at the end that a crash left unfinished"""
        self._stream = stream

    @property
    def simulated(self) -> bool:
        """True if virtual people take part; False in a live study."""
        return bool((self.header or {}).get("simulated", True))

    def begin(self, identity: Mapping[str, Any], simulated: bool) -> None:
        """Write the head of a new file, or check that these results may be added to it: CheckFailed with a reason."""
        kind = {True: "simulated", False: "live"}
        if self.header is None:
            self.header = {
                "study": self.study.name,
                "simulated": simulated,
                "plan": self.study.plan,
                "identity": dict(identity),
            }
            self._write(self.header)
            return
        if self.header["simulated"] != simulated:
            raise CheckFailed(
                f"{self.study.folder / ROWS} has {kind[not simulated]} trials, and {kind[simulated]} ones cannot be "
                "mixed with them: make another study for them"
            )
        if simulated and (change := difference(self.header["identity"], identity)):
            raise CheckFailed(
                f"the trials so far were made with {change}: go on with that, or start a new study, because the same "
                "seeds need not give the same rows"
            )

    def add(self, number: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write the rows of a finished trial."""
        self._write({"trial": number, "rows": [dict(row) for row in rows]})
        self.trials[number] = [dict(row) for row in rows]

    def table(self) -> list[dict[str, Any]]:
        """All rows in the order of the plan."""
        return [row for number in sorted(self.trials) for row in self.trials[number]]

    def _write(self, line: Mapping[str, Any]) -> None:
        assert self._stream is not None  # opened only for reading
        try:
            content = json.dumps(line).encode() + b"\n"
            if self._stream.write(content) < len(content):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise CheckFailed(
                f"{self.study.folder / ROWS} cannot be written: {error.strerror}; free the disk"
            ) from None


@contextmanager
def open_rows(study: Study, write: bool = False) -> Iterator[Rows]:
    """The results of a study; to write: for one process at a time. CheckFailed if they belong to another plan."""
    path = study.folder / ROWS
    if not write:
        yield _read(study, path.read_bytes() if path.exists() else b"", None)
        return
    try:
        stream = path.open("a+b", buffering=0)
    except OSError as error:
        raise CheckFailed(f"{path} cannot be written: {error.strerror}") from None
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UsageError(f"another process runs the study in {study.folder}: wait for its end, or end it") from None
        stream.seek(0)
        content = stream.read()
        rows = _read(study, content, stream)
        if rows.dropped:
            stream.truncate(len(content) - rows.dropped)
        yield rows


def _read(study: Study, content: bytes, stream: IO[bytes] | None) -> Rows:
    path = study.folder / ROWS
    whole = content[: content.rfind(b"\n") + 1]
    rows = Rows(study, stream, None)
    rows.dropped = len(content) - len(whole)
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            value = json.loads(line)
            if number == 1:
                rows.header = {name: value[name] for name in ("study", "simulated", "plan", "identity")}
            else:
                rows.trials[int(value["trial"])] = [_row(row) for row in value["rows"]]
        except (ValueError, KeyError, TypeError):
            then = "remove this line, and its trial runs again"
            if number == 1:
                then = (
                    "the first line has plan and version, and without it the others mean nothing: put it back from a "
                    "copy, or move the file away and run the study again"
                )
            got = line[:60].decode("utf-8", "replace")
            raise CheckFailed(
                f"{path}:{number}: a line of a study's results is expected, got '{got}'; {then}"
            ) from None
    if rows.trials and rows.header is not None:
        _check_plan(study, rows.header)
        for number, found in rows.trials.items():
            if strange := next((row for row in found if row["condition"] not in study.conditions), None):
                raise CheckFailed(
                    f"{path}: trial {number} has the condition '{strange['condition']}', which {study.folder / FILE} "
                    "does not have; remove its line, and it runs again"
                )
    else:  # no finished trial: the plan may still change
        rows.header, rows.dropped = None, len(content)
    return rows


def _row(value: Mapping[str, Any]) -> dict[str, Any]:
    """One row of a handover. KeyError, TypeError or ValueError: it is invalid."""
    row = dict(value)
    for name in ("participant", "condition", "action", "outcome", "reason_code"):
        row[name] = str(row[name])
    int(row["block"]), int(row["success"])
    return row


def _check_plan(study: Study, header: Mapping[str, Any]) -> None:
    plan, path = header["plan"], study.folder / FILE
    if header["study"] != study.name:
        raise CheckFailed(
            f"{_line(path, 'name')}: {study.folder} has the results of study '{header['study']}', and this file "
            f"describes '{study.name}': a folder holds one study; ./coglab study init makes another"
        )
    for name in sorted(plan.keys() | study.plan.keys()):
        if plan.get(name) != study.plan.get(name):
            before, now = json.dumps(plan.get(name))[:100], json.dumps(study.plan.get(name))[:100]
            where = str(study.folder) if name == OWN_FILES else _line(path, name)
            raise CheckFailed(
                f"{where}: '{name}' was changed after the first trial, from {before} to {now}: put it back, or start a "
                "new study with ./coglab study init"
            )


def _line(path: Path, name: str) -> str:
    """File and line of a key of study.yaml; only the file if the key is missing."""
    line = read(path).lines.get((name,))
    return f"{path}:{line}" if line else str(path)


def difference(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    """The first difference of two identities as text; empty if they are the same."""
    for name in sorted(a.keys() | b.keys()):
        if a.get(name) != b.get(name):
            return f"{name} {a.get(name)}, and here it is {b.get(name)}"
    return ""


def write_table(study: Study, table: Sequence[Mapping[str, Any]]) -> Path:
    """Write trials.csv, one row per handover. Returns the file. After the measures come the settings of the condition
    (set_timing, ...) and the participant's scores under it (nasa_tlx_workload, ...)."""
    changed = dict.fromkeys(name for settings in study.conditions.values() for name in settings)
    scores: dict[tuple[str, int, str], dict[str, float]] = {}
    for score in scores_of(answers_of(study), study.questionnaires):
        own = scores.setdefault((score["participant"], score["block"], score["condition"]), {})
        own[f"{score['questionnaire']}_{score['scale']}"] = round(score["value"], 6)
    measures = sorted({name for row in table for name in row} - set(LEADING))
    asked = sorted({name for own in scores.values() for name in own})
    text = io.StringIO()
    columns = [*LEADING, *measures, *(f"set_{name}" for name in changed), *asked]
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    for row in table:
        settings = {
            f"set_{name}": json.dumps(value) if isinstance(value, dict | list) else value
            for name, value in study.conditions[row["condition"]].items()
        }
        own = scores.get((row["participant"], row["block"], row["condition"])) or {}
        writer.writerow({**row, **settings, **own})
    path = study.folder / TABLE
    write_whole(path, text.getvalue().encode())
    return path


def undone(study: Study, rows: Rows) -> Iterable[Any]:
    """Trials of the plan that are not finished."""
    return [trial for trial in study.trials() if trial.number not in rows.trials]
