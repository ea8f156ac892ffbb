"""Trials kept in a file, one JSON line each: a campaign that was cut off goes on where it was.

The first line holds the commit of the sources whose trials these are, and machine and date of their beginning; trials
of two commits are never mixed.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

SOURCES = Path(__file__).resolve().parents[2]


def commit_of_sources() -> str:
    """The last commit that changed anything in catkin_ws/src, with "-changed" where files differ from it; "unknown"
    without git."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(SOURCES), *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=30).stdout.strip()

    try:
        commit = git("log", "-1", "--format=%h", "--", ".")
        return commit + ("-changed" if git("status", "--porcelain", "--", ".") else "")
    except (OSError, subprocess.SubprocessError):
        return "unknown"


def whole_hash(commit: str) -> str:
    """All hex digits of a commit as ``commit_of_sources`` names it; empty without git, or where it does not know it."""
    command = ["git", "-C", str(SOURCES), "rev-parse", "--verify", "--quiet", commit.removesuffix("-changed")]
    try:
        return subprocess.run(command, check=True, capture_output=True, text=True, timeout=30).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def commit_in(path: Path) -> str:
    """The commit whose trials a file holds. ValueError if it is none."""
    try:
        with open(path, encoding="utf-8") as stream:
            return str(json.loads(stream.readline())["sources"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is no file of trials ({error!r}); name another one") from None


def origin() -> dict[str, str]:
    """Machine and date, as they are kept in a file of trials."""
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}"
    return {"machine": machine, "date": datetime.now(UTC).strftime("%Y-%m-%d")}


def origin_in(path: Path) -> str:
    """Machine and date of a file of trials, in words; those of files that have none were not noted."""
    with open(path, encoding="utf-8") as stream:
        first = json.loads(stream.readline())
    return f"Machine: {first.get('machine', 'not noted')}; begun: {first.get('date', 'not noted')}."


class TrialFile:
    """Results of trials by key. ``known``: what the file holds."""

    def __init__(self, path: Path, commit: str | None = None) -> None:
        """ValueError for a file of another commit (by default: of the sources as they are) or of something else."""
        self.path = path
        self.commit = commit_of_sources() if commit is None else commit
        self.known: dict[str, dict[str, Any]] = {}
        if path.is_file() and path.stat().st_size > 0:
            self._read()
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps({"sources": self.commit} | origin()) + "\n", encoding="utf-8")

    def _read(self) -> None:
        data = self.path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if whole != data:  # cut off while a line was written
            os.truncate(self.path, len(whole))
        lines = whole.decode("utf-8").splitlines()
        try:
            theirs = commit_in(self.path)
            entries = list(map(json.loads, lines[1:]))
            self.known = {entry["key"]: entry["trial"] for entry in entries}
        except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{self.path} is no file of trials ({error!r}); name another one") from None
        if theirs != self.commit:
            raise ValueError(
                f"{self.path} holds trials of commit {theirs}, the sources are {self.commit}: "
                "check that commit out, or name another file"
            )

    def add(self, key: str, trial: dict[str, Any]) -> dict[str, Any]:
        """Append one result; returns it as a later run will read it."""
        line = json.dumps({"key": key, "trial": trial})
        with open(self.path, "a", encoding="utf-8") as stream:
            stream.write(line + "\n")
        self.known[key] = json.loads(line)["trial"]
        return self.known[key]
