"""Triggers of the hubs: who asks for what, and which hub takes it."""
from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Request:
    """One trigger: an action by name, the object it is about (may be empty), who asked (operator or recognition)."""

    action: str
    object_id: str = ""
    source: str = "operator"


class Requests:
    """Mailbox between the trigger's sender and the state that waits for one. Accepts only what the open hub takes."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._hub = ""
        self._allowed: tuple[str, ...] = ()
        self._request: Request | None = None
        self._names_object = False

    def open(self, hub: str, allowed: Iterable[str], names_object: bool = False) -> None:
        """A hub starts to wait for one of these actions; a trigger left over is dropped.

        ``names_object``: nobody knows what the hand holds, so the trigger has to say it."""
        with self._lock:
            self._hub, self._allowed, self._request = hub, tuple(allowed), None
            self._names_object = names_object

    def close(self) -> None:
        """The hub has left; triggers are refused until the next one opens."""
        with self._lock:
            self._hub, self._allowed, self._request = "", (), None

    def submit(self, action: str, object_id: str = "", source: str = "operator") -> tuple[bool, str]:
        """Ask for an action. Returns whether a hub takes it, and one sentence."""
        with self._lock:
            if not self._hub:
                return False, (f"'{action}' refused: the machine is not in a hub now; wait until it is in "
                               "wait_without_object or wait_with_object")
            if action not in self._allowed:
                return False, (f"'{action}' refused: {self._hub} takes {', '.join(self._allowed)}")
            if self._names_object and not object_id:
                return False, (f"'{action}' refused: the hand holds an object that is not known after a restart; name "
                               "its object_id")
            if self._request is not None:
                return False, f"'{action}' refused: '{self._request.action}' was asked for a moment ago"
            self._request = Request(action, object_id, source)
            return True, f"'{action}' accepted by {self._hub}"

    def take(self) -> Request | None:
        """The trigger, once; None while there is none."""
        with self._lock:
            request, self._request = self._request, None
            return request

    def hub(self) -> str:
        """Label of the open hub, empty while an action runs."""
        with self._lock:
            return self._hub
