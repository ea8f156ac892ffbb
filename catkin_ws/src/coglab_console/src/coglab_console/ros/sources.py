"""Who has said something when: what is shown of a source that has fallen silent is not taken for news."""

from __future__ import annotations

import time
from collections.abc import Callable

SILENT = 0.75
"""s without a word. Each source speaks four times a second at least, and the page shows it within another 0.2 s"""


class Sources:
    """Called from any thread. `now` in s of the steady clock."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._heard: dict[str, float] = {}

    def heard(self, name: str) -> None:
        """It has said something."""
        self._heard[name] = self._now()

    def speaks(self, name: str) -> bool:
        """Whether it was heard a moment ago."""
        return self._now() - self._heard.get(name, float("-inf")) < SILENT

    def silent(self) -> dict[str, float]:
        """For how long (s) each one that was heard before has been silent."""
        now = self._now()
        return {name: round(now - at, 1) for name, at in list(self._heard.items()) if now - at >= SILENT}
