"""Triggers of the hubs: requests for actions, and the hub that accepts them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from coglab_msgs.msg import ReasonCode
from coglab_py.actions import SHORT_NAMES

from coglab_smach.context.holding import UNKNOWN
from coglab_smach.ports.pending import Pending, PortError

if TYPE_CHECKING:
    from coglab_smach.context.context import Context

DATABASE_WAIT = 2.0  # s, time limit of the object database for a trigger
HUBS = ("wait_without_object", "wait_with_object")
"""States of the master machine that wait for a trigger."""


@dataclass(frozen=True)
class Request:
    """One trigger: name of the action, id of its object (may be empty), its source (operator or recognition), and how
    the object shall be given (empty: its default delivery)."""

    action: str
    object_id: str = ""
    source: str = "operator"
    delivery: str = ""


class TriggerReply(NamedTuple):
    """Reply to a trigger: accepted or not, one sentence, and the ReasonCode of a refusal."""

    ok: bool
    message: str
    code: int = ReasonCode.NONE


class Requests:
    """Mailbox between the sender of a trigger and the waiting state. It accepts only actions of the open hub."""

    def __init__(self, on_change: Callable[[], None] = lambda: None) -> None:
        self._lock = threading.Lock()
        self._on_change = on_change
        self._hub = ""
        self._allowed: tuple[str, ...] = ()
        self._request: Request | None = None
        self._names_object = False
        self.default_object: str | None = None
        """object of a trigger without an object id; None if triggers do not refer to an object of the database"""
        self.known: tuple[str, ...] = ()
        """all actions of this machine, in any hub; empty: unknown"""

    def open(
        self, hub: str, allowed: Iterable[str], names_object: bool = False, default_object: str | None = None
    ) -> None:
        """A hub starts to wait for one of these actions. An old trigger is deleted.

        ``names_object``: the object in the hand is unknown, so the trigger must name it."""
        with self._lock:
            self._hub, self._allowed, self._request = hub, tuple(allowed), None
            self._names_object, self.default_object = names_object, default_object
        self._on_change()

    def close(self) -> None:
        """The hub is left. Triggers are refused until the next hub opens."""
        with self._lock:
            self._hub, self._allowed, self._request = "", (), None
        self._on_change()

    def refusal(self, action: str, object_id: str = "") -> TriggerReply | None:
        """Returns the reason why no hub accepts this now; None if one does."""
        with self._lock:
            return self._refusal(action, object_id)

    def _refusal(self, action: str, object_id: str) -> TriggerReply | None:
        if not self._hub:
            return TriggerReply(
                False,
                f"'{action}' refused: the machine is not in a hub now; request it again in {' or '.join(HUBS)}",
                ReasonCode.WRONG_STATE,
            )
        if action not in self._allowed:
            return TriggerReply(
                False,
                f"'{action}' refused: {self._hub} takes {' or '.join(self._allowed)}",
                ReasonCode.WRONG_STATE,
            )
        if self._names_object and not object_id:
            return TriggerReply(
                False,
                f"'{action}' refused: the hand holds an object that is not known after a restart; name its object_id",
                ReasonCode.OBJECT_UNKNOWN,
            )
        if self._request is not None:
            return TriggerReply(
                False,
                f"'{action}' refused: '{self._request.action}' was requested a moment ago; wait until it is over",
                ReasonCode.BUSY,
            )
        return None

    def submit(self, action: str, object_id: str = "", source: str = "operator", delivery: str = "") -> TriggerReply:
        """Request an action. Returns whether a hub accepts it, and one sentence."""
        with self._lock:
            refusal = self._refusal(action, object_id)
            if refusal is not None:
                return refusal
            self._request = Request(action, object_id, source, delivery)
            return TriggerReply(True, f"'{action}' accepted by {self._hub}")

    def idle(self) -> bool:
        """True if a hub waits and no trigger is on its way to it."""
        with self._lock:
            return bool(self._hub) and self._request is None

    def take(self) -> Request | None:
        """Returns the trigger and removes it; None if there is none."""
        with self._lock:
            request, self._request = self._request, None
            return request

    def hub(self) -> str:
        """Returns the label of the open hub; empty while an action runs."""
        with self._lock:
            return self._hub

    def allowed(self) -> tuple[str, ...]:
        """Returns the actions that the open hub accepts."""
        with self._lock:
            return self._allowed


def ask_for(
    ctx: Context, action: str, object_id: str = "", source: str = "operator", delivery: str = ""
) -> TriggerReply:
    """Process a trigger from outside. It is refused at once if no hub accepts it, or if the database has no such object
    or delivery. Waits at most 2 s for each answer of the database.

    ``action`` may be one of SHORT_NAMES. ``object_id`` may have a delivery behind a slash: "mug/handle_first", or
    "/handle_first" for the object in the hand.
    """
    action = SHORT_NAMES.get(action, action)
    known = ctx.requests.known
    if known and action not in known:
        there = ", ".join([*SHORT_NAMES, *(each for each in known if each not in SHORT_NAMES.values())])
        return TriggerReply(
            False, f"'{action}' refused: there is no such action; there are: {there}", ReasonCode.UNKNOWN_NAME
        )
    object_id, _, behind = object_id.partition("/")
    delivery = delivery or behind
    refusal = ctx.requests.refusal(action, object_id)
    if refusal is not None:
        return refusal
    default = ctx.requests.default_object
    wanted = object_id or default
    try:
        if default is not None and wanted:
            objects = sorted(_answer(ctx, ctx.database.list_objects()))
            if wanted not in objects:
                return TriggerReply(
                    False,
                    f"'{action}' refused: object '{wanted}' is not in the database; it has: "
                    f"{', '.join(objects) or 'none'}",
                    ReasonCode.OBJECT_UNKNOWN,
                )
        refusal = _delivery_refusal(ctx, action, object_id, delivery) if delivery else None
    except PortError as error:
        again = "request it again when the database answers"
        return TriggerReply(False, f"'{action}' refused: {error.sentence}; {again}", error.code)
    return refusal or ctx.requests.submit(action, object_id, source, delivery)


def _delivery_refusal(ctx: Context, action: str, object_id: str, delivery: str) -> TriggerReply | None:
    """Returns the reason why the object in the hand cannot be given in this way; None if it can."""
    if not ctx.holding or action == "put":
        why = "'put' puts the object on the board" if ctx.holding else "the hand is empty"
        return TriggerReply(
            False,
            f"'{action}' refused: a delivery is how an object is given, and {why}; leave delivery '{delivery}' out",
            ReasonCode.INVALID_ARGUMENT,
        )
    held = object_id if ctx.holding == UNKNOWN else ctx.holding
    known = [*_answer(ctx, ctx.database.get_object(held))["deliveries"], *ctx.parts.deliveries]
    if delivery in known:
        return None
    return TriggerReply(
        False,
        f"'{action}' refused: '{held}' has no delivery '{delivery}'; it has: {', '.join(known)}",
        ReasonCode.UNKNOWN_NAME,
    )


def _answer(ctx: Context, pending: Pending) -> Any:
    """Returns the answer of the object database. PortError if it does not come within DATABASE_WAIT."""
    end = ctx.clock.now() + DATABASE_WAIT
    while not pending.done():
        if ctx.clock.now() >= end:
            pending.cancel()
            raise PortError(
                f"the object database has not answered within {DATABASE_WAIT:.0f} s",
                code=ReasonCode.NODE_SILENT,
            )
        ctx.clock.sleep(0.01)
    return pending.result()
