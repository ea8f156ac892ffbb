"""Record of transitions and their reasons, the causes of failures, and the result of each action."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

NOTHING_FAILED = "Nothing has failed since the last success or reset."


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
    code: int = 0
    """coglab_msgs/ReasonCode of the reason"""

    def sentence(self) -> str:
        """The transition in one line."""
        chain = "".join(f" <- {cause}" for cause in self.causes)
        reason = f": {self.reason}" if self.reason else ""
        return f"{self.path}/{self.from_state} -[{self.outcome}]-> {self.to_state}{reason}{chain}"


@dataclass(frozen=True)
class Failure:
    """A failure: sentence, its causes (nearest first), its ReasonCode."""

    sentence: str = ""
    causes: tuple[str, ...] = ()
    code: int = 0

    def __str__(self) -> str:
        return self.sentence + "".join(f", because {cause}" for cause in self.causes)


@dataclass(frozen=True)
class Wait:
    """What an active state waits for: a sentence, its ``ReasonCode``, and the time (s of the journal's clock)
    at which it gives up. ``aside``: the state only monitors others in parallel; no state waits for its end."""

    what: str = ""
    deadline: float = math.inf
    code: int = 0
    aside: bool = False


@dataclass
class ActionRecord:
    """One action of the master (an exchange, take, put, initialisation): the request and its result."""

    kind: str
    object_id: str
    started: float
    ended: float = 0.0
    outcome: str = ""
    reason: str = ""
    causes: tuple[str, ...] = ()
    code: int = 0
    marks: dict[str, float] = field(default_factory=dict)
    delivery: str = ""
    """how the object is given; empty where the action gives none"""

    def to_dict(self) -> dict[str, Any]:
        """Returns plain types for a result file."""
        return {
            "kind": self.kind,
            "object_id": self.object_id,
            "delivery": self.delivery,
            "outcome": self.outcome,
            "reason": self.reason,
            "reason_code": self.code,
            "causes": list(self.causes),
            "started": self.started,
            "ended": self.ended,
            "duration_s": self.ended - self.started,
            "marks": dict(self.marks),
        }


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
        self._failure: Failure | None = None
        self._newest = Failure()
        self._action: ActionRecord | None = None
        self._active: list[str] = []
        self._waits: dict[str, Wait] = {}
        self._wait_listeners: list[Callable[[], None]] = []
        self._change_listeners: list[Callable[[], None]] = []

    def listen(self, on_transition: Callable[[TransitionRecord], None]) -> None:
        """Add a callback for each transition. It runs in the thread that made the transition."""
        self._listeners.append(on_transition)

    def listen_results(self, on_result: Callable[[ActionRecord], None]) -> None:
        """Add a callback for the end of each action."""
        self._result_listeners.append(on_result)

    def listen_changes(self, on_change: Callable[[], None]) -> None:
        """Add a callback for each change of the active states or of the newest failure."""
        self._change_listeners.append(on_change)

    def listen_waits(self, on_change: Callable[[], None]) -> None:
        """Add a callback for each start, extension and end of a wait."""
        self._wait_listeners.append(on_change)

    def changed(self) -> None:
        """Call the callbacks for changes."""
        for listener in self._change_listeners:
            listener()

    def entered(self, path: str) -> None:
        """A leaf state starts. In a concurrence, several are active."""
        with self._lock:
            self._active.append(path)
        self.changed()

    def left(self, path: str) -> None:
        """A leaf state has ended."""
        with self._lock:
            self._active.remove(path)

    def waits(self, path: str, wait: Wait | None) -> None:
        """Set the wait of the active state with this path; None: it waits no longer."""
        with self._lock:
            if wait is None:
                self._waits.pop(path, None)
            else:
                self._waits[path] = wait
        for listener in self._wait_listeners:
            listener()

    @contextmanager
    def waiting(self, path: str, wait: Wait) -> Iterator[None]:
        """Inside the block, the state of this path waits."""
        self.waits(path, wait)
        try:
            yield
        finally:
            self.waits(path, None)

    def wait(self) -> Wait:
        """Returns the wait of all active states that gives up first; an empty Wait if none has a limit. Waits with
        ``aside`` count only if no other state is active."""
        with self._lock:
            looking_on = {path for path, wait in self._waits.items() if wait.aside}
            alone = looking_on.issuperset(self._active)
            limited = [w for w in self._waits.values() if w.deadline < math.inf and (alone or not w.aside)]
        return min(limited, key=lambda wait: wait.deadline, default=Wait())

    def active(self) -> tuple[str, ...]:
        """Returns the paths of the active leaf states, in the order of their start."""
        with self._lock:
            return tuple(self._active)

    def transition(
        self,
        path: str,
        from_state: str,
        outcome: str,
        to_state: str,
        reason: str,
        causes: tuple[str, ...] = (),
        code: int = 0,
    ) -> None:
        """Record one transition."""
        record = TransitionRecord(self._now(), path, from_state, outcome, to_state, reason, causes, code)
        with self._lock:
            self.transitions.append(record)
            del self.transitions[: -self._keep]
        for listener in self._listeners:
            listener(record)

    def begin_action(self, kind: str, object_id: str) -> None:
        """A new action starts. Earlier failures are not its reason."""
        with self._lock:
            self._failure = None
            self._action = ActionRecord(kind, object_id, self._now())

    def end_action(self, outcome: str) -> None:
        """The action has ended. Its first failure becomes its reason. A success has no reason and deletes the earlier
        failures."""
        with self._lock:
            action, self._action = self._action, None
            if action is None:
                return
            action.ended = self._now()
            action.outcome = outcome
            if outcome == "succeeded":
                self._failure, self._newest = None, Failure()
            elif self._failure is not None:
                first = self._failure
                action.reason, action.causes, action.code = first.sentence, first.causes, first.code
            self.results.append(action)
        for listener in self._result_listeners:
            listener(action)
        self.changed()

    def delivers(self, name: str) -> None:
        """The running action gives its object in this way."""
        with self._lock:
            if self._action is not None:
                self._action.delivery = name

    def mark(self, name: str) -> None:
        """Store the time of an event of the running action. Only the first event of each name counts."""
        with self._lock:
            if self._action is not None:
                self._action.marks.setdefault(name, self._now())

    def marked(self, name: str) -> bool:
        """True if this event has happened in the running action."""
        with self._lock:
            return self._action is not None and name in self._action.marks

    def failure(self, sentence: str, causes: tuple[str, ...] = (), code: int = 0) -> None:
        """A state failed. The first failure of an action becomes its reason."""
        with self._lock:
            if self._failure is None:
                self._failure = self._newest = Failure(sentence, causes, code)

    def stopped(self, sentence: str, block: str, code: int = 0) -> None:
        """Even the recovery is impossible: this becomes the failure that the operator sees. The earlier failure becomes
        its cause, unless that already names the same ``block``."""
        with self._lock:
            before = self._failure or Failure()
            if block in before.sentence or any(block in cause for cause in before.causes):
                return
            causes = (before.sentence, *before.causes) if before.sentence else ()
            self._failure = self._newest = Failure(sentence, causes, code)

    def settle(self, forget: bool = False) -> None:
        """The machine waits in a hub: later failures do not follow from earlier ones. ``forget``: the operator has
        confirmed the failure, so it is no longer shown."""
        with self._lock:
            self._failure = None
            if forget:
                self._newest = Failure()
        self.changed()

    def first_failure(self) -> Failure:
        """Returns the first failure of the running action; an empty one if there is none."""
        with self._lock:
            return self._failure or Failure()

    def newest_failure(self) -> Failure:
        """Returns the newest failure; an empty one after a reset or a successful action."""
        with self._lock:
            return self._newest

    def why(self) -> str:
        """Returns the reason of the last stop in one sentence."""
        return str(self.newest_failure()) or NOTHING_FAILED
