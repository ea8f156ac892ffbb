"""Answers that take time: each port call that may wait returns a Pending. States wait for it with a time limit."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from coglab_msgs.msg import ReasonCode


class PortError(Exception):
    """A port could not fulfil a request. One sentence: expected value, actual value, next step.

    ``causes``: causes of the error, nearest first. ``code``: its coglab_msgs/ReasonCode. Programs use only the code,
    not the text.
    """

    def __init__(self, sentence: str, causes: tuple[str, ...] = (), code: int = ReasonCode.NONE) -> None:
        super().__init__(sentence)
        self.sentence = sentence
        self.causes = tuple(causes)
        self.code = int(code)


class Pending:
    """A value that arrives later. It is polled and never blocks, so that it also works in virtual time."""

    def done(self) -> bool:
        """True when result() returns the value or raises the error of the call."""
        raise NotImplementedError

    def result(self) -> Any:
        """Returns the value; raises PortError if the call failed."""
        raise NotImplementedError

    def cancel(self) -> None:
        """Stop waiting: an unsent request is not sent any more, and a started motion ends."""


class Ready(Pending):
    """A value or an error that is available at once."""

    def __init__(self, value: Any = None, error: PortError | None = None) -> None:
        self._value = value
        self._error = error

    def done(self) -> bool:
        return True

    def result(self) -> Any:
        if self._error is not None:
            raise self._error
        return self._value


class Polled(Pending):
    """A value computed by callables: ``ready()`` returns whether it is there; ``value()`` returns it or raises
    PortError."""

    def __init__(
        self, ready: Callable[[], bool], value: Callable[[], Any], cancel: Callable[[], None] | None = None
    ) -> None:
        self._ready = ready
        self._value = value
        self._cancel = cancel

    def done(self) -> bool:
        return self._ready()

    def result(self) -> Any:
        return self._value()

    def cancel(self) -> None:
        if self._cancel is not None:
            self._cancel()


def ending_motion(pending: Pending, cancel_motion: Callable[[str], object]) -> Pending:
    """Returns the handle of a motion. Its cancel() withdraws an unsent request and ends the motion."""

    def cancel() -> None:
        pending.cancel()
        cancel_motion("its owner has given up waiting")

    return Polled(pending.done, pending.result, cancel)


class Permit:
    """Permission to send a request. Sending and giving up happen in different threads. The first one decides: a request
    that was given up first is never sent."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._withdrawn = threading.Event()

    def withdraw(self) -> None:
        """Forbid sending from now on."""
        with self._lock:
            self._withdrawn.set()

    def check(self) -> None:
        """Raises PortError if the permit was withdrawn. Call it immediately before sending."""
        with self._lock:
            if self._withdrawn.is_set():
                raise PortError("the request was given up before it was sent", code=ReasonCode.CANCELLED)


class Threaded(Pending):
    """A blocking call in its own daemon thread. If the caller stops waiting, the thread is abandoned, not joined.

    ``call`` receives the Permit and must check it before it sends anything.
    """

    def __init__(self, call: Callable[[Permit], Any], what: str) -> None:
        self._value: Any = None
        self._error: PortError | None = None
        self._event = threading.Event()
        self._call = call
        self._what = what
        self._permit = Permit()
        threading.Thread(target=self._run, name=f"call:{what}", daemon=True).start()

    def _run(self) -> None:
        try:
            self._value = self._call(self._permit)
        except PortError as error:
            self._error = error
        except Exception as error:  # any exception of the middleware becomes one sentence
            self._error = PortError(f"{self._what} failed: {error}", code=ReasonCode.UNEXPECTED)
        self._event.set()

    def done(self) -> bool:
        return self._event.is_set()

    def failed(self) -> bool:
        """True if the call has ended with an error."""
        return self._event.is_set() and self._error is not None

    def result(self) -> Any:
        if not self._event.is_set():
            raise PortError(f"{self._what} has not answered yet", code=ReasonCode.TIME_LIMIT)
        if self._error is not None:
            raise self._error
        return self._value

    def cancel(self) -> None:
        self._permit.withdraw()
