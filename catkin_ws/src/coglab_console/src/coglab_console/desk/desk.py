"""Decides on each command of a browser: checks it, performs it and records it. Needs neither ROS nor a web library.

A Backend reaches the robot: the node has the real one, tests have a double.
"""

from __future__ import annotations

import re
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, Protocol

from ..web.fan_out import Documents
from .commands import STARTS, BadCommand, judge
from .control_conditions import Standing, control, reasons
from .events import EventLog
from .experiment import GIVES, TAKES, Experiment, ExperimentError
from .motion_guard import HeldButton, MotionGuard
from .words import command as words_of
from .words import plain

UNKNOWN = "unknown"  # the brain's name of an object that was in the hand before the brain started
NOTICE = 3.0  # s between the announcement of a new operator and the change
ABSENCE = 10.0  # s without a connection after which the operator loses the role; longer than reloading a page


class DeskReply(dict):
    """{"success", "message"} and, where a command gives data, "data"."""

    def __init__(self, success: bool, message: str, data: Any = None) -> None:
        super().__init__(success=success, message=message)
        if data is not None:
            self["data"] = data


class Backend(Protocol):
    """The robot as the desk sees it."""

    real: bool

    def standing(self) -> Standing:
        """State of the robot from the newest messages; never waits."""

    def stop(self, who: str) -> None:
        """Brakes the arm, latches the hold and ends the action. Returns at once; the outcome comes as events."""

    def publish(self, name: str, text: str) -> None:
        """Publishes a note, or the object of the next action, on ROS. Returns at once."""

    def mark(self, names: dict[str, str]) -> None:
        """Names the trial under way for recorders: study, participant, condition, session. Returns at once."""

    def call(self, name: str, arguments: dict) -> Awaitable[DeskReply]:
        """Runs a command that needs the robot. It ends within its time limit."""


class Roles:
    """One browser operates, all others watch. Taking over is announced, and the operator may keep the control.

    Browsers are known by their name; `say(text, level)` makes an event. Called from one thread."""

    def __init__(self, say: Callable[[str, str], object], now: Callable[[], float] = time.monotonic) -> None:
        self._say, self._now = say, now
        self.operator = ""
        self.claimant = ""
        self._due = 0.0
        self._absent_since: float | None = None

    def connected(self, name: str) -> None:
        """A browser is there; the first one becomes the operator."""
        if name == self.operator:
            self._absent_since = None
        elif not self.operator:
            self._make(name, f"{name} is the operator", "info")

    def disconnected(self, name: str) -> None:
        """The last connection of a browser closed. The operator keeps the role for ABSENCE s."""
        if name == self.operator:
            self._absent_since = self._now()
        if name == self.claimant:
            self.claimant = ""
            self._say(f"{name} disconnected and no longer takes over", "info")

    def take_over(self, name: str) -> str:
        """The browser `name` requests to be the operator. Returns the answer in words."""
        if name == self.operator:
            return "you are the operator"
        if self.claimant and self.claimant != name:
            return f"{self.claimant} is taking over already"
        if not self.operator:
            self._make(name, f"{name} is the operator now; nobody was")
            return "you are the operator now"
        if not self.claimant:
            self.claimant, self._due = name, self._now() + NOTICE
            self._say(
                f"{name} takes over from {self.operator} in {NOTICE:.0f} s, unless {self.operator} keeps the control",
                "warning",
            )
        return f"{self.operator} was informed; you are the operator in {NOTICE:.0f} s unless they keep the control"

    def keep(self, name: str) -> str:
        """The operator refuses to hand over. Returns the answer in words."""
        if name != self.operator or not self.claimant:
            return "nobody is taking over from you"
        self._say(f"{name} keeps the control; {self.claimant} goes on watching", "warning")
        self.claimant = ""
        return "you keep the control"

    def tick(self) -> bool:
        """Call this several times a second. Returns True if the operator changed."""
        absent = self._absent_since is not None and self._now() - self._absent_since > ABSENCE
        if self.claimant and (absent or self._now() >= self._due):
            self._make(self.claimant, f"{self.claimant} is the operator now, {self.operator} watches")
        elif absent:
            gone, self.operator, self._absent_since = self.operator, "", None
            self._say(f"{gone} has been away for {ABSENCE:.0f} s: nobody operates; press Take over", "warning")
        else:
            return False
        return True

    def view(self) -> dict:
        """The roles, as every browser shows them."""
        return {"operator": self.operator, "claimant": self.claimant}

    def _make(self, name: str, sentence: str, level: str = "warning") -> None:
        self.operator, self.claimant, self._absent_since = name, "", None
        self._say(sentence, level)


class Desk:
    """Roles, guards and the open session of one console. Called from the event loop alone."""

    def __init__(
        self,
        backend: Backend,
        events: EventLog,
        documents: Documents,
        folder: Path,
        now: Callable[[], float],
        invite: Callable[[], str],
    ) -> None:
        self.backend, self.events, self.documents = backend, events, documents
        self._invite = invite
        self.roles = Roles(lambda text, level: events.add("control", text, level))
        self.guard = MotionGuard(backend.real)
        self.experiment = Experiment(
            folder,
            now,
            lambda text: events.add("experiment", text, "warning"),
            lambda text: backend.publish("note", text),
        )
        goes_on = self.experiment.resume()
        if goes_on:
            events.add("experiment", goes_on, "warning")
        self.object_id = ""
        """Object of the next action that needs one. Empty: the brain's default."""
        self._trial = (0, 0)
        self._held: dict[str, HeldButton] = {}
        self._begun: dict[str, tuple[str, dict]] = {}
        """By browser: the command that has begun and whose button is still held."""

    # --- calls of the browsers ------------------------------------------------------------------------------------

    def stop(self, who: str) -> DeskReply:
        """Executes STOP, from any browser, any number of times."""
        self.backend.stop(who)
        self.guard.stop(f"{who} pressed STOP")
        if self.backend.standing().under_way:
            self.backend.publish("note", f"STOP by {who}")  # a mark in the recording
        self.tick()
        return DeskReply(True, "STOP was sent to the arm and to the brain", {"stop": self.guard.stops})

    async def command(self, who: str, name: Any, arguments: Any) -> DeskReply:
        """Executes a command of the list for the browser `who`."""
        refusal = self._refusal(who, name, arguments)
        if refusal:
            return DeskReply(False, refusal)
        if name == "stop":
            return self.stop(who)
        if self.guard.guarded(name, arguments):
            return DeskReply(False, "press and hold the button for 0.8 s")
        return await self._perform(who, name, arguments)

    async def held(self, who: str, name: Any, arguments: Any) -> DeskReply | None:
        """Processes one message of a held button. Returns None until its command was executed."""
        # The begun action may be a reason to refuse the same command again, while the button is still down.
        if who in self._begun and self._begun[who] == (name, arguments):
            return None
        refusal = self._refusal(who, name, arguments)
        if refusal:
            self.released(who)
            return DeskReply(False, refusal)
        button = self._held.setdefault(who, HeldButton())
        if not button.held((name, sorted(arguments.items(), key=str))):
            return None
        self._begun[who] = (name, arguments)
        return await self._perform(who, name, arguments)

    def released(self, who: str, lost: bool = False) -> None:
        """The button was released. `lost`: its browser lost the connection, which becomes an event."""
        self._begun.pop(who, None)
        button = self._held.pop(who, None)
        what = button.unfinished() if button is not None and lost else None
        if what is not None:
            name, arguments = what
            words = words_of(name, dict(arguments))
            self.events.add("command", f"{who} disconnected while holding {words}: nothing was begun", "warning")

    def connected(self, who: str) -> None:
        """A browser's first connection."""
        self.roles.connected(who)
        self.tick()

    def disconnected(self, who: str) -> None:
        """A browser's last connection closed."""
        self.released(who, lost=True)
        self.roles.disconnected(who)
        self.tick()

    # --- calls of the robot ---------------------------------------------------------------------------------------

    def result(self, row: dict) -> None:
        """An action of the state machine has ended."""
        self.experiment.result(row)

    def set_from_topic(self, name: str, text: str, who: str) -> None:
        """Takes a note, or the object of the next action, from another node. An invalid one becomes a warning event."""
        arguments = {"text": text} if name == "note" else {"object_id": text}
        try:
            judge(name, arguments)
        except BadCommand as error:
            self.events.add("command", f"{who}: {error}", "warning")
            return
        if name == "note":
            self._note(who, text)
        else:
            self._select(who, text)
        self.tick()

    def observe(self, stopped: bool, cause: str, standstills: int = 0) -> None:
        """Takes whether the arm or the machine stands after a stop, the cause, and the number of standstills so far."""
        if self.guard.observe(stopped, cause, standstills):
            self.events.add("stop", f"stopped: {cause or 'no reason given'}", "fault")
            self.tick()

    def tick(self) -> None:
        """Call this several times a second: updates the roles and the document `desk` of every browser."""
        self.roles.tick()
        now = self.backend.standing()
        self._follow_trial(now)
        self.documents.put(
            "desk",
            {
                "roles": self.roles.view(),
                "own": [name for name in now.actions if name not in STARTS],
                "reasons": reasons(now, self.guard, self.experiment.refusals(now)),
                "guard": {
                    "stop": self.guard.stops,
                    "cause": self.guard.stop_text(now.actions if now.in_hub else ()),
                    "lifted": self.guard.lifted,
                    "unacknowledged": self.guard.unacknowledged,
                    "hold": self.guard.needs_hold,
                },
                "object": self.object_id,
                "experiment": self.experiment.view(),
            },
        )

    # --- inside -----------------------------------------------------------------------------------------------

    def _refusal(self, who: str, name: Any, arguments: Any) -> str:
        """Reason to refuse a command; empty if it is allowed."""
        try:
            command = judge(name, arguments)
        except BadCommand as error:
            return str(error)
        if command.operator and who != self.roles.operator:
            return f"{who} watches; {self.roles.operator or 'nobody'} is the operator: press Take over first"
        now = self.backend.standing()
        asked = [arguments["action"]] if name == "start" else []
        found = reasons(now, self.guard, self.experiment.refusals(now), asked)
        reason = found.get(control(name, arguments), "")
        return f"{words_of(name, arguments)}: {reason}" if reason else ""

    async def _perform(self, who: str, name: str, arguments: dict) -> DeskReply:
        try:
            answer = self._own(who, name, arguments)
        except ExperimentError as error:
            answer = DeskReply(False, str(error))
        except OSError as error:
            answer = DeskReply(False, f"a file cannot be written: {error}")
        if answer is None:
            if name == "start" and arguments["action"] in (*TAKES, *GIVES):
                arguments = {"object_id": self._meant(arguments["action"]), **arguments}
            stops = self.guard.stops
            answer = await self.backend.call(name, arguments)
            answer["message"] = plain(answer["message"])
            if answer["success"] and name in ("start", "home"):  # a calibration moves only the fingers
                self.guard.moved(stops)
        if name not in ("parameters", "note", "select_object", "preview"):
            text = f"{who}: {words_of(name, arguments)}: {answer['message']}"
            self.events.add("command", text, "info" if answer["success"] else "warning")
        self.tick()
        return answer

    def _meant(self, action: str) -> str:
        """Object of a request that names none: the held one to give it, otherwise the selected one."""
        held = self.backend.standing().object_id
        return held if action in GIVES and held not in ("", UNKNOWN) else self.object_id

    def _follow_trial(self, now: Standing) -> None:
        """Selects the first object that the condition of a new trial names."""
        trial = self.experiment.begun()
        if trial == self._trial or (trial[0] and not now.objects):
            return
        self._trial = trial
        condition = self.experiment.condition()
        named = next((word for word in re.split(r"[^a-z0-9_]+", condition.lower()) if word in now.objects), "")
        if trial[0] and named:
            self.backend.publish("select_object", named)
            self._select(f"trial {trial[0]} ({condition})", named)

    def _note(self, who: str, text: str) -> str:
        self.events.add("note", f"{who}: {text}")
        return self.experiment.note(who, text)

    def _select(self, who: str, object_id: str) -> str:
        self.object_id = object_id
        if self.experiment.running:
            self._trial = self.experiment.begun()
        self.events.add("object", f"{who}: the next object is {object_id or 'the default'}")
        return f"object {object_id or 'none'}"

    def _own(self, who: str, name: str, given: dict) -> DeskReply | None:
        """Executes the commands that do not need the robot. Returns None for the others."""
        session = self.experiment
        if name == "note":
            self.backend.publish("note", given["text"])
            return DeskReply(True, self._note(who, given["text"]))
        if name == "acknowledge":
            # The answer, and thereby the event, contains number and cause of the stop.
            refusal = self.guard.acknowledge(given["stop"])
            done = f"acknowledged stop {self.guard.stops} ({self.guard.cause}); the first motion needs a held button"
            return DeskReply(not refusal, refusal or done)
        if name == "take_over":
            return DeskReply(True, self.roles.take_over(who))
        if name == "keep":
            return DeskReply(True, self.roles.keep(who))
        if name == "invite":
            return DeskReply(True, "a link for one more browser, valid once", self._invite())
        if name == "select_object":
            self.backend.publish("select_object", given["object_id"])
            return DeskReply(True, self._select(who, given["object_id"]))
        if name == "session_begin":
            return DeskReply(
                True,
                session.begin(
                    given["participant"],
                    given["conditions"],
                    given["repetitions"],
                    given["order"],
                    given.get("number", 0),
                    bool(self.backend.standing().object_id),
                    given.get("study", ""),
                ),
            )
        if name == "session_end":
            return DeskReply(True, session.end())
        if name == "trial_begin":
            answer = session.trial_begin()
            self.backend.mark(session.names())
            self._follow_trial(self.backend.standing())
            return DeskReply(True, f"{answer}; the next object is {self.object_id or 'the default'}")
        if name == "trial_end":
            answer = session.trial_end(given["outcome"])
            self.backend.mark(session.names())
            return DeskReply(True, answer)
        return None
