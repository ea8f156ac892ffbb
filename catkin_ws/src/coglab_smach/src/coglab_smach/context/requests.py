"""Triggers of the hubs: who asks for what, and which hub takes it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from coglab_msgs.msg import ReasonCode

from coglab_smach.ports.pending import PortError

if TYPE_CHECKING:
    from coglab_smach.context.context import Context

DATABASE_WAIT = 2.0  # s that a trigger waits for the object database
COMMAND = "./coglab start"  # asks the machine for an action


def command(*actions: str) -> str:
    """What the operator has to type, for the end of a sentence."""
    return "type: " + " or ".join(f"{COMMAND} {action}" for action in actions)


@dataclass(frozen=True)
class Request:
    """One trigger: an action by name, the object it is about (may be empty), who asked (operator or recognition)."""

    action: str
    object_id: str = ""
    source: str = "operator"


class Answer(NamedTuple):
    """Whether a trigger is taken, one sentence, and the ReasonCode of a refusal."""

    ok: bool
    message: str
    code: int = ReasonCode.NONE


class Requests:
    """Mailbox between the trigger's sender and the state that waits for one. Accepts only what the open hub takes."""

    def __init__(self, on_change: Callable[[], None] = lambda: None) -> None:
        self._lock = threading.Lock()
        self._on_change = on_change
        self._hub = ""
        self._allowed: tuple[str, ...] = ()
        self._request: Request | None = None
        self._names_object = False
        self.default_object: str | None = None
        """object of a trigger that names none; None where triggers are about no object of the database"""

    def open(
        self, hub: str, allowed: Iterable[str], names_object: bool = False, default_object: str | None = None
    ) -> None:
        """A hub starts to wait for one of these actions; a trigger left over is dropped.

        ``names_object``: nobody knows what the hand holds, so the trigger has to say it."""
        with self._lock:
            self._hub, self._allowed, self._request = hub, tuple(allowed), None
            self._names_object, self.default_object = names_object, default_object
        self._on_change()

    def close(self) -> None:
        """The hub has left; triggers are refused until the next one opens."""
        with self._lock:
            self._hub, self._allowed, self._request = "", (), None
        self._on_change()

    def refusal(self, action: str, object_id: str = "") -> Answer | None:
        """Why no hub takes this now; None if one does."""
        with self._lock:
            return self._refusal(action, object_id)

    def _refusal(self, action: str, object_id: str) -> Answer | None:
        if not self._hub:
            return Answer(
                False,
                f"'{action}' refused: the machine is not in a hub now; to wait until it is in "
                f"wait_without_object or wait_with_object, {command(action)}",
                ReasonCode.WRONG_STATE,
            )
        if action not in self._allowed:
            return Answer(
                False,
                f"'{action}' refused: {self._hub} takes {', '.join(self._allowed)}; {command(*self._allowed)}",
                ReasonCode.WRONG_STATE,
            )
        if self._names_object and not object_id:
            return Answer(
                False,
                f"'{action}' refused: the hand holds an object that is not known after a restart; "
                f"name its object_id, {command(action)} OBJECT",
                ReasonCode.OBJECT_UNKNOWN,
            )
        if self._request is not None:
            return Answer(
                False,
                f"'{action}' refused: '{self._request.action}' was asked for a moment ago; "
                f"when that is over, {command(action)}",
                ReasonCode.BUSY,
            )
        return None

    def submit(self, action: str, object_id: str = "", source: str = "operator") -> Answer:
        """Ask for an action. Returns whether a hub takes it, and one sentence."""
        with self._lock:
            refusal = self._refusal(action, object_id)
            if refusal is not None:
                return refusal
            self._request = Request(action, object_id, source)
            return Answer(True, f"'{action}' accepted by {self._hub}")

    def take(self) -> Request | None:
        """The trigger, once; None while there is none."""
        with self._lock:
            request, self._request = self._request, None
            return request

    def hub(self) -> str:
        """Label of the open hub, empty while an action runs."""
        with self._lock:
            return self._hub

    def allowed(self) -> tuple[str, ...]:
        """What the open hub takes."""
        with self._lock:
            return self._allowed


def ask_for(ctx: Context, action: str, object_id: str = "", source: str = "operator") -> Answer:
    """A trigger from outside: refused at once where no hub takes it, or where the database has no such object. Waits
    for the database for 2 s at most."""
    refusal = ctx.requests.refusal(action, object_id)
    if refusal is not None:
        return refusal
    default = ctx.requests.default_object
    wanted = object_id or default
    if default is not None and wanted:
        try:
            known = _objects(ctx)
        except PortError as error:
            again = f"when the database answers, {command(action)} {wanted}"
            return Answer(False, f"'{action}' refused: {error.sentence}; {again}", error.code)
        if wanted not in known:
            return Answer(
                False,
                f"'{action}' refused: object '{wanted}' is not in the database; it has: "
                f"{', '.join(known)}; {command(action)} {known[0] if known else 'OBJECT'}",
                ReasonCode.OBJECT_UNKNOWN,
            )
    return ctx.requests.submit(action, object_id, source)


def _objects(ctx: Context) -> list[str]:
    pending = ctx.database.list_objects()
    end = ctx.clock.now() + DATABASE_WAIT
    while not pending.done():
        if ctx.clock.now() >= end:
            pending.cancel()
            raise PortError(
                f"the object database has not answered within {DATABASE_WAIT:.0f} s",
                code=ReasonCode.NODE_SILENT,
            )
        ctx.clock.sleep(0.01)
    return sorted(pending.result())
