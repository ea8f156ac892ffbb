#!/usr/bin/python3
"""Sessions of the console's page Experiment as tables: each trial beside what the brain's journal told of it.

Without a name the newest session; a folder stands for all sessions in it. The tables: trials (a row per attempt at a
trial, with its last action), actions (a row per action, with its marks in s after it began), events (notes and stops).
Exit status: 0; 1 where a file cannot be read or written; 2 usage.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from pathlib import Path

import rospkg
from coglab_console.desk.session_file import COLUMNS, Session, SessionFileError, read_session, rows_of, session_files

SHOWN = {
    "trials": (
        "trial",
        "attempt",
        "condition",
        "outcome",
        "duration_s",
        "action",
        "result",
        "reason",
        "stops",
        "notes",
    ),
    "actions": ("trial", "attempt", "condition", "action", "object_id", "result", "reason", "action_s", "marks"),
    "events": ("stamp", "trial", "kind", "who", "text"),
}
"""Columns on the terminal; a CSV file has all of them"""
WIDEST = 44  # characters of a cell on the terminal


def csv_path(text: str) -> Path:
    """Another ending could be that of a session, which is not to be written over."""
    if not text.endswith(".csv"):
        raise argparse.ArgumentTypeError(f"expected a name that ends with .csv, got '{text}'")
    return Path(text)


def folders() -> list[Path]:
    """Where consoles keep sessions: in ROS_HOME, and in the homes that ./coglab launch makes."""
    top = os.environ.get("COGLAB_TOP", "")
    homes = sorted(Path(top, ".coglab").glob("home_*")) if top else []
    return [home / "console_sessions" for home in (Path(rospkg.get_ros_home()), *homes)]


def files_of(names: list[Path]) -> list[Path]:
    """The files that were named, or the newest one. SessionFileError where there is none."""
    if not names:
        found = [path for folder in folders() for path in session_files(folder)]
        if not found:
            looked = ", ".join(map(str, folders()))
            raise SessionFileError(f"no session in {looked}; begin one on the page Experiment, or name a file")
        return [max(found, key=lambda path: int(path.stem.rpartition("_")[2]))]
    found = [path for name in names for path in (session_files(name) if name.is_dir() else [name])]
    if not found:
        raise SessionFileError(f"no session in {', '.join(map(str, names))}; expected files like P07_1700000000.jsonl")
    return found


def show(session: Session, table: str) -> None:
    """One session in words and columns."""
    stands = "ended" if session.ended is not None else "not ended"
    print(
        f"{session.participant}, number {session.number}, {session.order} of {', '.join(session.conditions)}: "
        f"{session.passed()} of {len(session.trials)} trials behind, {stands}; {session.path}"
    )
    rows = [[str(row[name]) for name in SHOWN[table]] for row in rows_of([session], table)]
    lines = [[cell if len(cell) <= WIDEST else cell[: WIDEST - 1] + "…" for cell in row] for row in rows]
    lines.insert(0, list(SHOWN[table]))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


def main(words: list[str]) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="console_session.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", type=Path, metavar="FILE|FOLDER", help="default: the newest session")
    parser.add_argument("--table", choices=tuple(COLUMNS), default="trials", help="default: trials")
    parser.add_argument("--csv", type=csv_path, metavar="FILE", help="write the table there, with all of its columns")
    options = parser.parse_args(words)
    try:
        sessions = [read_session(path) for path in files_of(options.names)]
    except SessionFileError as error:
        print(f"[coglab] error: {error}", file=sys.stderr)
        return 1
    for session in sessions:
        for problem in session.problems:
            print(f"[coglab] warning: {session.path}: {problem}", file=sys.stderr)
    if options.csv is None:
        for session in sessions:
            show(session, options.table)
        return 0
    rows = rows_of(sessions, options.table)
    try:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, COLUMNS[options.table])
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        print(f"[coglab] error: {options.csv} cannot be written: {error.strerror}", file=sys.stderr)
        return 1
    print(f"[coglab] wrote {options.csv}: {len(rows)} rows of {len(sessions)} sessions")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
