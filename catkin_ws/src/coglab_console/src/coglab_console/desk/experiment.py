"""A session with one participant: conditions, order of trials, notes, and one file that tools can read.

The file holds one JSON object a line, each with `type` and `stamp` (s since 1970): session, trial_begin, trial_end,
result (as on coglab/results), note, stop, session_end. Participants are pseudonyms; no names belong here.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path

MAX_TRIALS = 600


class ExperimentError(Exception):
    """Not possible now; the sentence says why and what to do."""


def latin_row(conditions: list[str], number: int) -> list[str]:
    """One row of a balanced Latin square (Williams design): over 2n rows each condition follows each other equally
    often; over n rows where n is even."""
    n = len(conditions)
    first = [0]
    for step in range(1, n):
        first.append((step + 1) // 2 if step % 2 else n - step // 2)
    row = [(value + number) % n for value in first]
    if n % 2 and (number // n) % 2:
        row.reverse()
    return [conditions[index] for index in row]


def order_of(conditions: list[str], repetitions: int, order: str, number: int) -> list[str]:
    """The condition of each trial, in blocks that hold every condition once."""
    if len(conditions) * repetitions > MAX_TRIALS:
        raise ExperimentError(
            f"{len(conditions) * repetitions} trials are more than {MAX_TRIALS}; use fewer repetitions"
        )
    chance = random.Random(number)
    trials: list[str] = []
    for block in range(repetitions):
        if order == "latin_square":
            trials += latin_row(conditions, number + block)
        elif order == "random":
            trials += chance.sample(conditions, len(conditions))
        else:
            trials += conditions
    return trials


class Experiment:
    """At most one session at a time. A file that cannot be written is told, and the session goes on in memory."""

    def __init__(self, folder: Path, now: Callable[[], float], warn: Callable[[str], object]) -> None:
        self._folder, self._now, self._warn = folder, now, warn
        self._path: Path | None = None
        self.participant = ""
        self.trials: list[dict] = []
        self.position = 0
        self.running = False
        self.notes: list[dict] = []

    def begin(self, participant: str, conditions: list[str], repetitions: int, order: str, number: int) -> str:
        """Opens a session; the answer in words."""
        if self.participant:
            raise ExperimentError(f"the session of {self.participant} is open; end it first")
        trials = order_of(conditions, repetitions, order, number)
        self._folder.mkdir(parents=True, exist_ok=True)
        stamp = int(self._now())
        path = self._folder / f"{participant}_{stamp}.jsonl"
        while path.exists():
            stamp += 1
            path = self._folder / f"{participant}_{stamp}.jsonl"
        self._path, self.participant, self.position, self.running, self.notes = path, participant, 0, False, []
        self.trials = [{"condition": condition, "outcome": ""} for condition in trials]
        self._write(
            "session", participant=participant, number=number, order=order, conditions=conditions, trials=trials
        )
        return f"session of {participant}: {len(trials)} trials, written to {path}"

    def end(self) -> str:
        """Closes the session."""
        if not self.participant:
            raise ExperimentError("no session is open")
        self._write("session_end", done=sum(trial["outcome"] == "done" for trial in self.trials))
        sentence = f"session of {self.participant} closed; {self._path}"
        self._path, self.participant, self.trials, self.position, self.running = None, "", [], 0, False
        return sentence

    def trial_begin(self) -> str:
        """The next trial of the order."""
        if not self.participant:
            raise ExperimentError("no session is open; begin one first")
        if self.running:
            raise ExperimentError(f"trial {self.position + 1} is under way; end it first")
        if self.position >= len(self.trials):
            raise ExperimentError("every trial is done; end the session")
        self.running = True
        condition = self.trials[self.position]["condition"]
        self._write("trial_begin", trial=self.position + 1, condition=condition)
        return f"trial {self.position + 1} of {len(self.trials)}: {condition}"

    def trial_end(self, outcome: str) -> str:
        """`repeat` leaves the trial to be done again."""
        if not self.running:
            raise ExperimentError("no trial is under way")
        self.running = False
        trial = self.position + 1
        self._write("trial_end", trial=trial, condition=self.trials[self.position]["condition"], outcome=outcome)
        self.trials[self.position]["outcome"] = outcome
        self.position += outcome != "repeat"
        return f"trial {trial}: {outcome}"

    def note(self, who: str, text: str) -> str:
        """A note, also between trials."""
        self.notes = [*self.notes[-99:], {"stamp": round(self._now(), 3), "who": who, "text": text}]
        self._write("note", who=who, text=text)
        return "noted"

    def record(self, kind: str, /, **fields: object) -> None:
        """A result or a stop, into the file of the open session."""
        self._write(kind, **fields)

    def view(self) -> dict:
        """What the page shows."""
        return {
            "participant": self.participant,
            "file": str(self._path or ""),
            "trials": self.trials,
            "position": self.position,
            "running": self.running,
            "notes": self.notes[-20:],
        }

    def _write(self, kind: str, /, **fields: object) -> None:
        if self._path is None:
            return
        fields = {"type": kind, "stamp": round(self._now(), 3), **fields}
        if self.running and "trial" not in fields:
            fields["trial"] = self.position + 1
        try:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(fields) + "\n")
        except OSError as error:
            self._warn(
                f"{self._path} cannot be written ({error.strerror}); free the disk, the session goes on unwritten"
            )
