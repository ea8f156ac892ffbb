"""Answers that take time: every port call that may wait returns a Pending, and states wait on it with a limit."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from coglab_msgs.msg import ReasonCode


class PortError(Exception):
    """A port could not do what was asked: one sentence with what was expected, what came, what to do next.

    ``causes`` is the chain behind the sentence, nearest first. ``code`` is its number in coglab_msgs/ReasonCode, for
    programs: no program reads the words.
    """

    def __init__(self, sentence: str, causes: tuple[str, ...] = (), code: int = ReasonCode.NONE) -> None:
        super().__init__(sentence)
        self.sentence = sentence
        self.causes = tuple(causes)
        self.code = int(code)


class Pending:
    """A value that arrives later. Polled, never blocking, so that it works in virtual time too."""

    def done(self) -> bool:
        """True when result() will not say 'not yet' any more."""
        raise NotImplementedError

    def result(self) -> Any:
        """The value; raises PortError if the call failed."""
        raise NotImplementedError

    def cancel(self) -> None:
        """Nobody waits any more: what has not been sent never is, a motion that was started is ended."""


class Ready(Pending):
    """A value that is already there, or an error that already happened."""

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
    """A value computed from callables: ``ready()`` says when, ``value()`` gives it (may raise PortError)."""

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
    """The handle of a motion: cancelled, the request is withdrawn if it was not sent, and the motion is ended."""

    def cancel() -> None:
        pending.cancel()
        cancel_motion("its owner has given up waiting")

    return Polled(pending.done, pending.result, cancel)


class Permit:
    """Whether a request may still be sent. Sending and giving up happen in different threads: whichever comes first
    decides, and what was given up first is never sent."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._withdrawn = threading.Event()

    def withdraw(self) -> None:
        """Nothing more is sent."""
        with self._lock:
            self._withdrawn.set()

    def check(self) -> None:
        """PortError if it was withdrawn; called at the last moment before something is sent."""
        with self._lock:
            if self._withdrawn.is_set():
                raise PortError("the request was given up before it was sent", code=ReasonCode.CANCELLED)


class Threaded(Pending):
    """A blocking call run in a daemon thread of its own; abandoned, not awaited, when nobody waits any more.

    ``call`` is given the Permit that it has to check before it sends anything.
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
        except Exception as error:  # whatever the middleware throws becomes one sentence for the machine
            self._error = PortError(f"{self._what} failed: {error}", code=ReasonCode.UNEXPECTED)
        self._event.set()

    def done(self) -> bool:
        return self._event.is_set()

    def failed(self) -> bool:
        """Whether it has ended with an error."""
        return self._event.is_set() and self._error is not None

    def result(self) -> Any:
        if not self._event.is_set():
            raise PortError(f"{self._what} has not answered yet", code=ReasonCode.TIME_LIMIT)
        if self._error is not None:
            raise self._error
        return self._value

    def cancel(self) -> None:
        self._permit.withdraw()
