"""Reads a session file: the order of trials, what the experimenter did and noted, and the brain's results.

    session = read_session(newest(Path.home() / ".ros" / "console_sessions"))
    for attempt in session.attempts:
        print(attempt.trial, attempt.condition, attempt.outcome, [row["outcome"] for row in attempt.results])

Half a line (the console was killed) or an unknown line is left out and named in `problems`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

MAX_BYTES = 50_000_000
NAME = re.compile(r"[A-Za-z0-9_-]{1,32}_(\d{1,12})\.jsonl")
OPEN, NOT_BEGUN = "open", "not begun"
"""Outcomes beside those of the page: the trial was not ended; the trial was not begun."""
COLUMNS = {
    "trials": (
        "session", "participant", "number", "order", "trial", "attempt", "condition", "outcome", "began", "duration_s",
        "actions", "action", "object_id", "result", "reason", "reason_code", "action_s", "stops", "notes",
    ),
    "actions": (
        "session", "participant", "trial", "attempt", "condition", "outcome", "began", "action", "object_id", "result",
        "reason", "reason_code", "causes", "action_s", "marks",
    ),
    "events": ("session", "participant", "trial", "attempt", "condition", "stamp", "kind", "who", "phase", "text"),
}  # fmt: skip
"""Columns of each table, in their order."""


class SessionFileError(Exception):
    """This is no session file. The message gives what was expected and what was read."""


@dataclass
class Attempt:
    """One attempt at a trial. Times in s since 1970; `results` as on coglab/results, with the `stamp` of their end."""

    trial: int = 0
    attempt: int = 0
    condition: str = ""
    began: float = -math.inf
    ended: float | None = None
    outcome: str = OPEN
    results: list[dict] = field(default_factory=list)
    notes: list[dict] = field(default_factory=list)
    stops: list[dict] = field(default_factory=list)

    @property
    def duration(self) -> float | None:
        """Duration in s; None if the attempt was not ended."""
        return None if self.ended is None else round(self.ended - self.began, 3)

    def covers(self, stamp: float) -> bool:
        """True if this time lies in the attempt."""
        return self.began <= stamp <= (math.inf if self.ended is None else self.ended)


@dataclass
class Session:
    """One session file. `outside` holds the rows between the trials, `problems` the lines left out, with the reason."""

    path: Path
    participant: str
    number: int
    order: str
    conditions: list[str]
    trials: list[str]
    began: float
    ended: float | None = None
    newest: float = 0.0
    attempts: list[Attempt] = field(default_factory=list)
    outside: Attempt = field(default_factory=Attempt)
    problems: list[str] = field(default_factory=list)

    def running(self) -> Attempt | None:
        """The attempt that was begun and not ended, or None."""
        last = self.attempts[-1] if self.attempts else None
        return last if last is not None and last.ended is None else None

    def passed(self) -> int:
        """Number of trials of the order that are over."""
        return sum(attempt.outcome in ("done", "failed", "skipped") for attempt in self.attempts)


# --- files ----------------------------------------------------------------------------------------------------


def session_files(folder: Path) -> list[Path]:
    """The session files of a folder, sorted by their start, which is in their names."""
    found = [(NAME.fullmatch(path.name), path) for path in folder.glob("*.jsonl")] if folder.is_dir() else []
    return [path for _, path in sorted((int(match[1]), path) for match, path in found if match)]


def newest(folder: Path) -> Path | None:
    """The session file of this folder that began last, or None."""
    found = session_files(folder)
    return found[-1] if found else None


def read_session(path: Path) -> Session:
    """Reads one session file. Raises SessionFileError if it is none."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SessionFileError(f"{path}: expected at most {MAX_BYTES} bytes, got {path.stat().st_size}")
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError as error:
        raise SessionFileError(f"{path} cannot be read: {error.strerror}; name a file of console_sessions") from None
    session: Session | None = None
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            row = _parsed(line)
            if session is None:
                session = _begun(path, row)
                continue
            _READERS[row["type"]](session, row)
            session.newest = max(session.newest, row["stamp"])
        except ValueError as error:
            if session is None:
                raise SessionFileError(f"{path}: expected a line of type session at its head; {error}") from None
            session.problems.append(f"line {number}: {error}; left out")
    if session is None:
        raise SessionFileError(f"{path}: expected a line of type session at its head, got an empty file")
    for row in _take_results(session):
        _place(session, row).results.append(row)
    return session


# --- lines ----------------------------------------------------------------------------------------------------


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _parsed(line: str) -> dict:
    """One line; ValueError for what is no object with a type and a time."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        raise ValueError(f"expected JSON, got '{line[:40]}'") from None
    if not isinstance(row, dict) or not _number(row.get("stamp")) or row.get("type") not in (*_READERS, "session"):
        raise ValueError(f"expected an object with a stamp and a type of {', '.join(_READERS)}, got '{line[:40]}'")
    return row


def _needs(row: dict, **kinds: type | tuple[type, ...]) -> None:
    for name, kind in kinds.items():
        if not isinstance(row.get(name), kind) or isinstance(row.get(name), bool):
            raise ValueError(f"{row['type']}: expected the field {name}, got {str(row.get(name))[:40]}")


def _begun(path: Path, row: dict) -> Session:
    if row["type"] != "session":
        raise ValueError(f"got one of type {row['type']}")
    _needs(row, participant=str, number=int, order=str, conditions=list, trials=list)
    names = [str(name) for name in row["conditions"]]
    trials = [str(name) for name in row["trials"]]
    stamp = float(row["stamp"])
    return Session(path, row["participant"], row["number"], row["order"], names, trials, stamp, newest=stamp)


def _on_trial_begin(session: Session, row: dict) -> None:
    _needs(row, trial=int, condition=str)
    if not 1 <= row["trial"] <= len(session.trials):
        raise ValueError(f"trial_begin: expected a trial of 1 to {len(session.trials)}, got {row['trial']}")
    before = sum(attempt.trial == row["trial"] for attempt in session.attempts)
    session.attempts.append(Attempt(row["trial"], before + 1, row["condition"], float(row["stamp"])))


def _on_trial_end(session: Session, row: dict) -> None:
    _needs(row, trial=int, outcome=str)
    running = session.running()
    if running is None or running.trial != row["trial"]:
        came = f"trial {running.trial} is" if running else "none is"
        raise ValueError(f"trial_end: expected trial {row['trial']} to be under way, {came}")
    running.ended, running.outcome = float(row["stamp"]), row["outcome"]


def _on_result(session: Session, row: dict) -> None:
    _needs(row, kind=str, outcome=str, duration_s=(int, float))
    (session.running() or session.outside).results.append(row)


def _on_note(session: Session, row: dict) -> None:
    _needs(row, who=str, text=str)
    (session.running() or session.outside).notes.append(row)


def _on_stop(session: Session, row: dict) -> None:
    (session.running() or session.outside).stops.append(row)


def _on_session_end(session: Session, row: dict) -> None:
    session.ended = float(row["stamp"])


_READERS: dict[str, Callable[[Session, dict], None]] = {
    "trial_begin": _on_trial_begin,
    "trial_end": _on_trial_end,
    "result": _on_result,
    "note": _on_note,
    "stop": _on_stop,
    "stopped": _on_stop,
    "resumed": lambda session, row: None,
    "session_end": _on_session_end,
}


# --- results beside trials ------------------------------------------------------------------------------------


def _take_results(session: Session) -> list[dict]:
    """All results, taken from where they ended; each keeps that place as a way out."""
    found = []
    for attempt in (*session.attempts, session.outside):
        found += [{**row, "_ended_in": attempt} for row in attempt.results]
        attempt.results = []
    return sorted(found, key=lambda row: row["stamp"])


def _place(session: Session, row: dict) -> Attempt:
    """The attempt in which the action began: trials are often ended while the arm is on its way home, and the journal
    tells an action at its end. Where it began in none, the one in which it ended."""
    ended_in = row.pop("_ended_in")
    began = _action_began(row)
    return next((attempt for attempt in reversed(session.attempts) if attempt.covers(began)), ended_in)


def _action_began(row: dict) -> float:
    """When an action began, s since 1970; older files have the time of its end alone."""
    began = row.get("began")
    return float(began) if began is not None and _number(began) else float(row["stamp"] - row["duration_s"])


# --- tables ---------------------------------------------------------------------------------------------------


def rows_of(sessions: list[Session], table: str) -> list[dict[str, Any]]:
    """Rows of one of the tables of COLUMNS: a row per attempt at a trial, per action, or per note and stop."""
    make = {"trials": _trial_rows, "actions": _action_rows, "events": _event_rows}[table]
    return [{name: row[name] for name in COLUMNS[table]} for session in sessions for row in make(session)]


def _time(stamp: float) -> str:
    """UTC in the way that every table program reads."""
    return datetime.fromtimestamp(stamp, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _head(session: Session, attempt: Attempt) -> dict[str, Any]:
    inside = attempt is not session.outside
    return {
        "session": session.path.stem,
        "participant": session.participant,
        "number": session.number,
        "order": session.order,
        "trial": attempt.trial if inside else "",
        "attempt": attempt.attempt if inside else "",
        "condition": attempt.condition,
        "outcome": attempt.outcome if inside else "",
    }


def _action(row: dict) -> dict[str, Any]:
    return {
        "action": row["kind"],
        "object_id": row.get("object_id", ""),
        "result": row["outcome"],
        "reason": row.get("reason", ""),
        "reason_code": row.get("reason_code", ""),
        "action_s": round(row["duration_s"], 3),
    }


def _trial_rows(session: Session) -> list[dict[str, Any]]:
    """With the last action of each: what it came to."""
    nothing = dict.fromkeys(("action", "object_id", "result", "reason", "reason_code", "action_s"), "")
    ahead = range(max((attempt.trial for attempt in session.attempts), default=0), len(session.trials))
    waiting = [Attempt(i + 1, 0, session.trials[i], outcome=NOT_BEGUN) for i in ahead]
    return [
        {
            **_head(session, one),
            "began": _time(one.began) if one.attempt else "",
            "duration_s": "" if one.duration is None else one.duration,
            "actions": len(one.results),
            **(_action(one.results[-1]) if one.results else nothing),
            "stops": len(one.stops),
            "notes": "; ".join(note["text"] for note in one.notes),
        }
        for one in (*session.attempts, *waiting)
    ]


def _action_rows(session: Session) -> list[dict[str, Any]]:
    found = []
    for attempt in (*session.attempts, session.outside):
        for row in attempt.results:
            begin, marks = row.get("started"), row.get("marks")
            times = marks.items() if isinstance(marks, dict) and _number(begin) else ()
            after = {name: round(time - begin, 3) for name, time in times if _number(time)}
            found.append(
                {
                    **_head(session, attempt),
                    **_action(row),
                    "began": _time(_action_began(row)),
                    "causes": "; ".join(map(str, row.get("causes") or ())),
                    "marks": json.dumps(after),
                }
            )
    return sorted(found, key=lambda row: row["began"])


def _event_rows(session: Session) -> list[dict[str, Any]]:
    found = [
        {
            **_head(session, attempt),
            "stamp": _time(row["stamp"]),
            "kind": row["type"],
            "who": row.get("who", ""),
            "phase": row.get("phase", ""),
            "text": row.get("text", row.get("cause", "")),
        }
        for attempt in (*session.attempts, session.outside)
        for row in (*attempt.notes, *attempt.stops)
    ]
    return sorted(found, key=lambda row: row["stamp"])
