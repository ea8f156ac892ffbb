"""The process behind a port of the virtual world, as its client sees it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.pending import Pending, PortError, Ready


class VirtualNode:
    """Acts on requests at once. While it is frozen it answers nothing; what was asked meanwhile acts in its order when
    it goes on, unless it was given up."""

    def __init__(self) -> None:
        self.frozen = False
        self._waiting: list[_Request] = []

    def ask(self, act: Callable[[], Pending]) -> Pending:
        """A request; ``act`` is called when it reaches the node and returns its answer."""
        request = _Request(act)
        self._waiting.append(request)
        self._serve()
        return request

    def freeze(self) -> None:
        """It stops as it stands."""
        self.frozen = True

    def thaw(self) -> None:
        """It goes on."""
        self.frozen = False
        self._serve()

    def _serve(self) -> None:
        while self._waiting and not self.frozen:
            self._waiting.pop(0).serve()


class _Request(Pending):
    def __init__(self, act: Callable[[], Pending]) -> None:
        self._act = act
        self._answer: Pending | None = None
        self._given_up = False

    def serve(self) -> None:
        """It has reached its node."""
        given_up = PortError("the request was given up before it was sent", code=ReasonCode.CANCELLED)
        self._answer = Ready(error=given_up) if self._given_up else self._act()

    def done(self) -> bool:
        return self._answer is not None and self._answer.done()

    def result(self) -> Any:
        if self._answer is None:
            raise PortError("the node has not answered yet", code=ReasonCode.TIME_LIMIT)
        return self._answer.result()

    def cancel(self) -> None:
        self._given_up = True
        if self._answer is not None:
            self._answer.cancel()
