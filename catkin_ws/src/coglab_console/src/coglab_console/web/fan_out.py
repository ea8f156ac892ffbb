"""Sends documents with versions, the newest state, and all new events to the browsers.

Only the newest state is queued per browser; documents and events are looked up when there is room to send. There is
room while fewer than WINDOW states wait for the acknowledgement of the browser. Otherwise the buffers of the network
would hold seconds of old states. So a slow browser misses states but no event, and shows new values.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Awaitable, Callable, Iterator

from ..desk.events import EventLog

WINDOW = 4  # states not yet acknowledged by one browser: at 30 Hz enough for a round trip of 0.13 s


def to_json(value: object) -> str:
    """Returns compact JSON. Numbers that are not finite become null."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_finite(value), separators=(",", ":"))


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if value - value == 0.0 else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value


class Documents:
    """Named values that change seldom. Call it only from the event loop."""

    def __init__(self) -> None:
        self._texts: dict[str, tuple[int, str]] = {}
        self.changed: Callable[[], None] = lambda: None

    def put(self, name: str, value: object) -> bool:
        """Sets a document. Returns True if it has changed."""
        text = to_json({"t": "doc", "name": name, "value": value})
        version, before = self._texts.get(name, (0, ""))
        if text == before:
            return False
        self._texts[name] = (version + 1, text)
        self.changed()
        return True

    def remove(self, name: str) -> None:
        """Removes a document. Browsers get null."""
        if name in self._texts:
            self.put(name, None)

    def newer(self, known: dict[str, int]) -> Iterator[str]:
        """Documents newer than the versions in `known`, as text. Updates `known`."""
        for name, (version, text) in list(self._texts.items()):
            if known.get(name, 0) != version:
                known[name] = version
                yield text


class Client:
    """One connection. `send` is awaited; it may take as long as the browser needs to read."""

    def __init__(self, name: str, seq: int, documents: Documents, events: EventLog) -> None:
        self.name = name
        self._seq = seq
        self._documents, self._events = documents, events
        self._versions: dict[str, int] = {}
        self._state: tuple[int, str] | None = None
        self._on_the_way: deque[int] = deque()
        self._behind_since = 0.0
        self._wake = asyncio.Event()
        self._wake.set()
        self.states_dropped = 0

    def state(self, number: int, text: str) -> None:
        """Queues the newest state in place of an unsent one. `number` increases."""
        self.states_dropped += self._state is not None
        self._state = (number, text)
        self._wake.set()

    def seen(self, number: object) -> bool:
        """The browser acknowledges this state and all before it. Returns False if this state was not on the way."""
        if isinstance(number, bool) or not isinstance(number, int) or number not in self._on_the_way:
            return False
        while self._on_the_way and self._on_the_way[0] <= number:
            self._on_the_way.popleft()
        self._wake.set()
        return True

    def behind(self) -> bool:
        """True if so many states are on the way that nothing more is sent."""
        return len(self._on_the_way) >= WINDOW

    def wake(self) -> None:
        """There are new events or documents."""
        self._wake.set()

    def take(self) -> list[str]:
        """Returns the texts to send now, oldest first; none while the browser is behind."""
        if self.behind():
            return []
        texts = list(self._documents.newer(self._versions))
        events, lost = self._events.since(self._seq)
        if events or lost:
            texts.append(to_json({"t": "events", "lost": lost, "events": events}))
        if events:
            self._seq = events[-1]["seq"]
        if self._seq < self._events.newest():
            self._wake.set()
        if self._state is not None:
            number, text = self._state
            texts.append(text)
            self._on_the_way.append(number)
            self._state = None
        return texts

    async def serve(self, send: Callable[[str], Awaitable[None]], limit: float) -> None:
        """Sends until cancelled. TimeoutError if the browser takes no message or acknowledges no state in `limit` s."""
        loop = asyncio.get_running_loop()
        while True:
            await self._wake.wait()
            self._wake.clear()
            if not self.behind():
                self._behind_since = loop.time()
            elif loop.time() - self._behind_since > limit:
                raise TimeoutError(f"no state was acknowledged for {limit:.0f} s")
            for text in self.take():
                await asyncio.wait_for(send(text), limit)
