"""A session with one participant: conditions, order of trials, notes.

The recorder of coglab_tools records each handover: its `trial.yaml` has participant, condition, study and session of
the trial, and the notes. The console itself writes only `session.json`, the state of the open session, from which a
restarted console continues. Use pseudonyms for participants, never names.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from coglab_py.orders import order_of

from ..web.fan_out import to_json
from .control_conditions import Standing
from .words import button, outcome

FILE = "session.json"
MAX_TRIALS = 600
RESUME = 4 * 3600.0  # s since the file was written; the session of a killed console is resumed within this time
TAKES = ("exchange_human_to_robot", "take")
"""Actions that begin with an empty hand and end with an object in it."""
GIVES = ("exchange_robot_to_human", "put")
_ACTION = {word: name for name in (*TAKES, *GIVES) for word in (name, button(name).lower())}
_KEPT = (
    "session",
    "study",
    "participant",
    "trials",
    "position",
    "running",
    "notes",
    "_goes",
    "_results",
    "_last_result",
)
"""Attributes that session.json contains."""


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
    """At most one session at a time. If the file cannot be written, the session goes on in memory, with a warning.

    `publish_note` sends a note to the recorder."""

    def __init__(
        self,
        folder: Path,
        now: Callable[[], float],
        warn: Callable[[str], object],
        publish_note: Callable[[str], object] = lambda text: None,
    ) -> None:
        self._path, self._now, self._warn, self._publish_note = folder / FILE, now, warn, publish_note
        self._close()
        self.notes: list[dict] = []
        self._goes = 0
        self._last_result: tuple = ()

    def _close(self) -> None:
        self.session, self.study, self.participant = "", "", ""
        self.trials: list[dict] = []
        self.position, self.running = 0, False
        self._results: list[dict] = []
        """Kind and outcome of the actions with an object in the current trial."""

    def resume(self) -> str:
        """Resumes the session that a killed console has left open. Returns a sentence about it, or an empty text."""
        if not self._path.exists():
            return ""
        try:
            found = json.loads(self._path.read_text(encoding="utf-8"))
            if self._now() - float(found["written"]) > RESUME:
                return ""
            for name in _KEPT:
                if not isinstance(found[name], type(getattr(self, name)) if name != "_last_result" else list):
                    raise ValueError(f"{name} is {str(found[name])[:40]}")
            for name, keys in (
                ("trials", ("condition", "outcome")),
                ("notes", ("stamp", "who", "text")),
                ("_results", ("kind", "outcome")),
            ):
                found[name] = [{key: row[key] for key in keys} for row in found[name]]
            if not 0 <= found["position"] <= len(found["trials"]):
                raise ValueError(f"position is {found['position']}")
        except (OSError, ValueError, KeyError, TypeError) as error:
            self._warn(f"the session is not resumed, {self._path} is damaged: {error}; remove it")
            return ""
        for name in _KEPT:
            setattr(self, name, found[name])
        self._last_result = tuple(self._last_result)
        stands = "is under way" if self.running else "is next"
        trial = min(self.position + 1, len(self.trials))
        return f"the session of {self.participant} goes on: trial {trial} of {len(self.trials)} {stands}"

    def begin(
        self,
        participant: str,
        conditions: list[str],
        repetitions: int,
        order: str,
        number: int,
        held: bool = False,
        study: str = "",
    ) -> str:
        """Opens a session. Returns the answer in words. `held`: something is in the robot's hand. `study`: its name,
        for the recordings."""
        self._needs("session_begin")
        if len(conditions) * repetitions > MAX_TRIALS:
            raise ExperimentError(
                f"{len(conditions) * repetitions} trials are more than {MAX_TRIALS}; use fewer repetitions"
            )
        trials = order_of(conditions, repetitions, order, number)
        self._close()
        self.session, self.study, self.participant = f"{participant}_{int(self._now())}", study, participant
        self.notes = []
        self.trials = [{"condition": condition, "outcome": ""} for condition in trials]
        self._write()
        sentence = f"session of {participant}: {len(trials)} trials"
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
        elsewhere = now.study if now is not None else ""
        live = elsewhere and f"the study {elsewhere} is run in a terminal: end it there first"
        return {
            "session_begin": live or self.participant and f"the session of {self.participant} is open; end it first",
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
        done = sum(trial["outcome"] == "done" for trial in self.trials)
        sentence = f"session of {self.participant} closed, {done} of {len(self.trials)} trials done"
        self._close()
        try:
            self._path.unlink(missing_ok=True)
        except OSError as error:
            self._warn(f"{self._path} cannot be removed: {error.strerror}; remove it")
        return sentence

    def trial_begin(self) -> str:
        """Begins the next trial of the order."""
        self._needs("trial_begin")
        self.running = True
        self._goes += 1
        self._results = []
        self._write()
        return f"trial {self.position + 1} of {len(self.trials)}: {self.condition()}"

    def trial_end(self, outcome: str) -> str:
        """Ends the trial. `repeat`: it is done again; `failed`: the robot has failed, and the next trial follows."""
        self._needs("trial_end")
        trial = f"trial {self.position + 1}"
        if self._results:  # the recording of its last action gets the experimenter's judgement
            self._publish_note(f"{trial}: {outcome}")
        self.running = False
        self.trials[self.position]["outcome"] = outcome
        self.position += outcome != "repeat"
        self._write()
        return f"{trial}: {outcome}"

    def note(self, who: str, text: str) -> str:
        """Keeps a note for the page, also between trials; the recorder has its own from coglab/note."""
        self.notes = [*self.notes[-99:], {"stamp": round(self._now(), 3), "who": who, "text": text}]
        self._write()
        return "noted"

    def result(self, row: dict) -> None:
        """Takes the result of an action. A repeated result is ignored, because the topic is latched."""
        if _mark(row) == self._last_result:
            return
        self._last_result = _mark(row)
        kind = row.get("kind")
        if self.running and kind in (*TAKES, *GIVES):
            self._results.append({"kind": kind, "outcome": row.get("outcome")})
            named = actions_in(self.condition())
            if named and kind not in named:
                self._warn(f"trial {self.position + 1} is '{self.condition()}', and {button(kind)} was done in it")
        self._write()

    def names(self) -> dict[str, str]:
        """Names for the recordings of the current trial; empty texts if no trial is under way."""
        found = (self.study, self.participant, self.condition(), self.session) if self.running else ("",) * 4
        return dict(zip(("study", "participant", "condition", "session"), found, strict=True))

    def view(self) -> dict:
        """The session as the page shows it."""
        return {
            "participant": self.participant,
            "study": self.study,
            "trials": self.trials,
            "position": self.position,
            "running": self.running,
            "notes": self.notes[-20:],
        }

    def _write(self) -> None:
        """Keeps the state, completely or not at all."""
        if not self.session:
            return
        state = {"written": round(self._now(), 3), **{name: getattr(self, name) for name in _KEPT}}
        part = self._path.with_name(f".{FILE}.part")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            part.write_text(to_json(state), encoding="utf-8")
            os.replace(part, self._path)
        except OSError as error:
            self._warn(
                f"{self._path} cannot be written ({error.strerror}); the session goes on, but a "
                "restarted console would not know it: free space on the disk"
            )
