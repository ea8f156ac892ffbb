"""A session with one participant: conditions, order of trials, notes, and the session file (session_file reads it).

The file holds one JSON object per line, each with `type` and `stamp` (s since 1970). The types are session,
trial_begin, trial_end, result (as on coglab/results: its times are of the brain's clock, `began` is like `stamp`),
note, stop (by the page), stopped (the robot stands, for any reason), resumed (by the next console after one was killed)
and session_end.
Use pseudonyms for participants, never names.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

from coglab_py.orders import order_of

from ..web.fan_out import to_json
from .gates import Standing
from .session_file import Session, SessionFileError, newest, read_session
from .words import button, outcome

MAX_TRIALS = 600
RESUME = 4 * 3600.0  # s since the last line of the file; the session of a killed console is resumed within this time
TAKES = ("exchange_human_to_robot", "take")
"""Actions that begin with an empty hand and end with an object in it."""
GIVES = ("exchange_robot_to_human", "put")
_ACTION = {word: name for name in (*TAKES, *GIVES) for word in (name, button(name).lower())}


class ExperimentError(Exception):
    """The command is not possible now. The message gives the reason and what to do."""


def actions_in(condition: str) -> list[str]:
    """Actions that a condition names in its words: 'receive ball' names Receive, 'slowly' names none."""
    return [_ACTION[word] for word in re.split(r"[^a-z0-9_]+", condition.lower()) if word in _ACTION]


def unprepared(trials: Sequence[str], held: bool) -> list[int]:
    """Numbers of the trials before which somebody has to fill or empty the robot's hand.

    `held`: the hand holds something before the first trial."""
    found = []
    for number, named in enumerate(map(actions_in, trials), 1):
        if named and held != (named[0] in GIVES):
            found.append(number)
        held = named[-1] in TAKES if named else held
    return found


def _mark(row: dict) -> tuple:
    """Identity of a result: its kind, and when its action began and ended by the brain's clock."""
    return row.get("kind"), row.get("started"), row.get("ended")


class Experiment:
    """At most one session at a time. If the file cannot be written, the session goes on in memory, with a warning."""

    def __init__(self, folder: Path, now: Callable[[], float], warn: Callable[[str], object]) -> None:
        self._folder, self._now, self._warn = folder, now, warn
        self._path: Path | None = None
        self.participant = ""
        self.trials: list[dict] = []
        self.position = 0
        self.running = False
        self._goes = 0
        self.notes: list[dict] = []
        self._last_result: tuple = ()
        self._results: list[dict] = []
        """Results of actions with an object in the current trial."""
        self.phase: Callable[[], str] = lambda: ""

    def resume(self) -> str:
        """Resumes the session that a killed console has left open. Returns a sentence about it, or an empty text."""
        try:
            path = newest(self._folder)
            found = read_session(path) if path is not None else None
        except (SessionFileError, OSError) as error:
            self._warn(f"no session goes on: {error}")
            return ""
        if found is None or found.ended is not None or self._now() - found.newest > RESUME:
            return ""
        self._restore(found)
        self._write("resumed")
        stands = "is under way" if self.running else "is next"
        trial = min(self.position + 1, len(self.trials))
        return f"the session of {self.participant} goes on: trial {trial} of {len(self.trials)} {stands}; {self._path}"

    def _restore(self, found: Session) -> None:
        self._path, self.participant = found.path, found.participant
        self.trials = [{"condition": condition, "outcome": ""} for condition in found.trials]
        for attempt in found.attempts:
            if attempt.ended is not None:
                self.trials[attempt.trial - 1]["outcome"] = attempt.outcome
        self.position, self.running = min(found.passed(), len(self.trials)), found.running() is not None
        places = (*found.attempts, found.outside)
        notes = sorted((note for place in places for note in place.notes), key=lambda note: note["stamp"])
        self.notes = [{name: note[name] for name in ("stamp", "who", "text")} for note in notes[-100:]]
        results = [row for place in places for row in place.results]
        self._last_result = _mark(max(results, key=lambda row: row["stamp"])) if results else ()
        running = found.running()
        self._results = [row for row in running.results if row["kind"] in (*TAKES, *GIVES)] if running else []

    def begin(
        self, participant: str, conditions: list[str], repetitions: int, order: str, number: int, held: bool = False
    ) -> str:
        """Opens a session. Returns the answer in words. `held`: something is in the robot's hand."""
        self._needs("session_begin")
        if len(conditions) * repetitions > MAX_TRIALS:
            raise ExperimentError(
                f"{len(conditions) * repetitions} trials are more than {MAX_TRIALS}; use fewer repetitions"
            )
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
        sentence = f"session of {participant}: {len(trials)} trials, written to {path}"
        first = unprepared(trials, held)
        if first:
            listed = ", ".join(map(str, first[:8])) + (" …" if len(first) > 8 else "")
            sentence += f"; the hand has to be filled or emptied before trial {listed}"
        return sentence

    def refusals(self, now: Standing | None = None) -> dict[str, str]:
        """Reason by command of sessions and trials, and by action that the current trial is not about.

        A reason is empty if the command is possible. `now`: state of the robot."""
        none = "" if self.participant else "no session is open; begin one first"
        running = f"trial {self.position + 1} is under way; end it first" if self.running else ""
        over = "every trial is done; end the session" if self.position >= len(self.trials) else ""
        return {
            "session_begin": self.participant and f"the session of {self.participant} is open; end it first",
            "session_end": none or running,
            "trial_begin": none or running or over or self._not_ready(now),
            "trial_end": "" if self.running else "no trial is under way",
            "trial_done": self._not_done(now) if self.running else "no trial is under way",
            **self._foreign(),
        }

    def _not_ready(self, now: Standing | None) -> str:
        """Reason why the next trial cannot begin with the hand as it is, or an empty text."""
        if now is None or not now.master_alive:
            return ""
        if now.under_way:
            return "an action is under way"
        named = actions_in(self.condition())
        if not named or bool(now.object_id) == (named[0] in GIVES):
            return ""
        stands, means = ("holds " + now.object_id, GIVES) if now.object_id else ("is empty", TAKES)
        return f"the hand {stands}: first {' or '.join(map(button, means))}, which counts for no trial"

    def _foreign(self) -> dict[str, str]:
        """Reasons of the actions that the current trial is not about."""
        named = actions_in(self.condition()) if self.running else []
        words = " and ".join(map(button, dict.fromkeys(named)))
        return {
            name: f"the trial is for {words}; end it first" for name in (*TAKES, *GIVES) if named and name not in named
        }

    def _not_done(self, now: Standing | None) -> str:
        """Reason why the current trial cannot be called done, or an empty text."""
        if now is not None and now.under_way:
            return "an action is under way"
        newest_of = {row["kind"]: row["outcome"] for row in self._results}
        named = actions_in(self.condition()) or [row["kind"] for row in self._results[-1:]]
        for name in named:
            if name not in newest_of:
                return f"no {button(name)} in this trial yet"
            if newest_of[name] != "succeeded":
                return f"{button(name)}: {outcome(newest_of[name])}"
        return ""

    def _needs(self, command: str) -> None:
        refusal = self.refusals()[command]
        if refusal:
            raise ExperimentError(refusal)

    def begun(self) -> tuple[int, int]:
        """Numbers of the current trial and of the attempt at it; zeros if there is no trial."""
        return (self.position + 1, self._goes) if self.running else (0, 0)

    def condition(self) -> str:
        """Condition of the current or next trial; empty after the last one."""
        return self.trials[self.position]["condition"] if self.position < len(self.trials) else ""

    def end(self) -> str:
        """Closes the session."""
        self._needs("session_end")
        self._write("session_end", done=sum(trial["outcome"] == "done" for trial in self.trials))
        sentence = f"session of {self.participant} closed; {self._path}"
        self._path, self.participant, self.trials, self.position, self.running = None, "", [], 0, False
        return sentence

    def trial_begin(self) -> str:
        """Begins the next trial of the order."""
        self._needs("trial_begin")
        self.running = True
        self._goes += 1
        self._results = []
        condition = self.trials[self.position]["condition"]
        self._write("trial_begin", trial=self.position + 1, condition=condition)
        return f"trial {self.position + 1} of {len(self.trials)}: {condition}"

    def trial_end(self, outcome: str) -> str:
        """Ends the trial. `repeat`: it is done again; `failed`: the robot has failed, and the next trial follows."""
        self._needs("trial_end")
        self.running = False
        trial = self.position + 1
        self._write("trial_end", trial=trial, condition=self.trials[self.position]["condition"], outcome=outcome)
        self.trials[self.position]["outcome"] = outcome
        self.position += outcome != "repeat"
        return f"trial {trial}: {outcome}"

    def note(self, who: str, text: str) -> str:
        """Records a note, also between trials."""
        self.notes = [*self.notes[-99:], {"stamp": round(self._now(), 3), "who": who, "text": text}]
        self.record("note", who=who, text=text)
        return "noted" if self._path is not None else "noted in the event log alone: no session is open"

    def result(self, row: dict) -> None:
        """Records the result of an action. A repeated result is ignored, because the topic is latched."""
        if _mark(row) == self._last_result:
            return
        self._last_result = _mark(row)
        kind = row.get("kind")
        if self.running and kind in (*TAKES, *GIVES):
            self._results.append(row)
            named = actions_in(self.condition())
            if named and kind not in named:
                self._warn(f"trial {self.position + 1} is '{self.condition()}', and {button(kind)} was done in it")
        fields = {key: value for key, value in row.items() if key not in ("type", "stamp", "trial", "began")}
        self._write("result", **fields, began=self._began(row))

    def _began(self, row: dict) -> float:
        """Start of a result's action in s since 1970: from the brain, or computed from its end, which is now."""
        try:
            return datetime.fromisoformat(row["started_utc"]).timestamp()
        except (KeyError, TypeError, ValueError):
            return round(self._now() - row.get("duration_s", 0.0), 3)

    def record(self, kind: str, /, **fields: object) -> None:
        """Writes a note or a stop, with the current phase, into the file of the open session."""
        phase = self.phase()
        self._write(kind, **fields, **({"phase": phase} if phase else {}))

    def names(self) -> dict[str, str]:
        """Names for the recordings of the current trial; empty texts if no trial is under way."""
        trial = (self.participant, self.condition(), self._path.stem) if self.running and self._path else ("", "", "")
        return {"study": "", **dict(zip(("participant", "condition", "session"), trial, strict=True))}

    def view(self) -> dict:
        """The session as the page shows it."""
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
            # A full disk or a killed console may have left half a line. End it first, or it would spoil this one.
            with self._path.open("a+b") as stream:
                if stream.tell():
                    stream.seek(-1, os.SEEK_END)
                whole = not stream.tell() or stream.read(1) == b"\n"
                stream.write(b"" if whole else b"\n")
                stream.write(f"{to_json(fields)}\n".encode())
        except OSError as error:
            self._warn(
                f"{self._path} cannot be written ({error.strerror}); free the disk, the session goes on unwritten"
            )
