"""What happened and why: transitions with their reason, the cause chain of a failure, the result of each action."""
from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class TransitionRecord:
    """One transition of one container; ``to_state`` is a sibling label or an outcome of the container."""

    stamp: float
    path: str
    from_state: str
    outcome: str
    to_state: str
    reason: str
    causes: tuple[str, ...] = ()

    def sentence(self) -> str:
        """The transition in one line."""
        chain = "".join(f" <- {cause}" for cause in self.causes)
        reason = f": {self.reason}" if self.reason else ""
        return f"{self.path}/{self.from_state} -[{self.outcome}]-> {self.to_state}{reason}{chain}"


@dataclass
class ActionRecord:
    """One action of the master (an exchange, take, put, initialisation): what was asked and how it ended."""

    kind: str
    object_id: str
    started: float
    ended: float = 0.0
    outcome: str = ""
    reason: str = ""
    causes: tuple[str, ...] = ()
    marks: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain types for a result file."""
        return {"kind": self.kind, "object_id": self.object_id, "outcome": self.outcome, "reason": self.reason,
                "causes": list(self.causes), "started": self.started, "ended": self.ended,
                "duration_s": self.ended - self.started, "marks": dict(self.marks)}


class Journal:
    """Thread-safe record of transitions. The first failure of an action is its reason; later ones are consequences."""

    def __init__(self, now: Callable[[], float], keep: int = 2000) -> None:
        self._now = now
        self._keep = keep
        self._lock = threading.RLock()
        self._listeners: list[Callable[[TransitionRecord], None]] = []
        self._result_listeners: list[Callable[[ActionRecord], None]] = []
        self.transitions: list[TransitionRecord] = []
        self.results: list[ActionRecord] = []
        self._failure: tuple[str, tuple[str, ...]] | None = None
        self._newest: tuple[str, tuple[str, ...]] | None = None
        self._action: ActionRecord | None = None

    def listen(self, on_transition: Callable[[TransitionRecord], None]) -> None:
        """Call this for each transition, in the thread that made it."""
        self._listeners.append(on_transition)

    def listen_results(self, on_result: Callable[[ActionRecord], None]) -> None:
        """Call this at the end of each action."""
        self._result_listeners.append(on_result)

    def transition(self, path: str, from_state: str, outcome: str, to_state: str, reason: str,
                   causes: tuple[str, ...] = ()) -> None:
        """Record one transition."""
        record = TransitionRecord(self._now(), path, from_state, outcome, to_state, reason, causes)
        with self._lock:
            self.transitions.append(record)
            del self.transitions[:-self._keep]
        for listener in self._listeners:
            listener(record)

    def begin_action(self, kind: str, object_id: str) -> None:
        """A new action starts: earlier failures do not explain it."""
        with self._lock:
            self._failure = None
            self._action = ActionRecord(kind, object_id, self._now())

    def end_action(self, outcome: str) -> None:
        """The action has ended; its reason is its first failure."""
        with self._lock:
            action, self._action = self._action, None
            if action is None:
                return
            action.ended = self._now()
            action.outcome = outcome
            if self._failure is not None:
                action.reason, action.causes = self._failure
            self.results.append(action)
        for listener in self._result_listeners:
            listener(action)

    def mark(self, name: str) -> None:
        """Note the time of an event of the running action (first one of that name counts)."""
        with self._lock:
            if self._action is not None:
                self._action.marks.setdefault(name, self._now())

    def failure(self, sentence: str, causes: tuple[str, ...] = ()) -> None:
        """A state failed: kept as the reason of the action if it is the first."""
        with self._lock:
            if self._failure is None:
                self._failure = self._newest = (sentence, causes)

    def stopped(self, sentence: str, block: str) -> None:
        """The action cannot even recover: that is what the operator has to know. What failed before becomes its cause,
        unless it names the same ``block`` already."""
        with self._lock:
            before, causes = self._failure or ("", ())
            if block in before or any(block in cause for cause in causes):
                return
            self._failure = self._newest = (sentence, (before, *causes) if before else ())

    def settle(self) -> None:
        """The machine waits in a hub: what fails from now on is no consequence of what failed before."""
        with self._lock:
            self._failure = None

    def first_failure(self) -> tuple[str, tuple[str, ...]]:
        """Sentence and causes of the running action's first failure; empty if all is well."""
        with self._lock:
            return self._failure or ("", ())

    def why(self) -> str:
        """'Why did it stop?' in one sentence: the newest thing that did not succeed."""
        with self._lock:
            if self._newest is None:
                return "Nothing has failed."
            sentence, causes = self._newest
        return sentence + "".join(f", because {cause}" for cause in causes)
