"""One operator; everybody else watches. Taking over is announced, and the operator may keep the control."""

from __future__ import annotations

import time
from collections.abc import Callable

NOTICE = 3.0
"""s between the announcement and the change"""
ABSENCE = 10.0
"""s without a connection after which nobody operates; longer than a page takes to load again"""


class Roles:
    """Sessions are known by their name; `say(text, level)` makes an event. Called from one thread."""

    def __init__(self, say: Callable[[str, str], object], now: Callable[[], float] = time.monotonic) -> None:
        self._say, self._now = say, now
        self.operator = ""
        self.claimant = ""
        self._due = 0.0
        self._absent_since: float | None = None

    def connected(self, name: str) -> None:
        """A browser is there; the first one becomes the operator."""
        if name == self.operator:
            self._absent_since = None
        elif not self.operator:
            self._make(name, f"{name} is the operator", "info")

    def disconnected(self, name: str) -> None:
        """The last connection of a browser closed. The operator stays it for ABSENCE s."""
        if name == self.operator:
            self._absent_since = self._now()
        if name == self.claimant:
            self.claimant = ""
            self._say(f"{name} went away and does not take over any more", "info")

    def take_over(self, name: str) -> str:
        """`name` wants to be the operator; the answer in words."""
        if name == self.operator:
            return "you are the operator"
        if self.claimant and self.claimant != name:
            return f"{self.claimant} is taking over already"
        if not self.operator:
            self._make(name, f"{name} is the operator now; nobody was")
            return "you are the operator now"
        if not self.claimant:
            self.claimant, self._due = name, self._now() + NOTICE
            self._say(
                f"{name} takes over from {self.operator} in {NOTICE:.0f} s, unless {self.operator} keeps the control",
                "warning",
            )
        return f"{self.operator} was told; you are the operator in {NOTICE:.0f} s unless they keep the control"

    def keep(self, name: str) -> str:
        """The operator refuses; the answer in words."""
        if name != self.operator or not self.claimant:
            return "nobody is taking over from you"
        self._say(f"{name} keeps the control; {self.claimant} goes on watching", "warning")
        self.claimant = ""
        return "you keep the control"

    def tick(self) -> bool:
        """Called several times a second; whether the operator changed."""
        absent = self._absent_since is not None and self._now() - self._absent_since > ABSENCE
        if self.claimant and (absent or self._now() >= self._due):
            self._make(self.claimant, f"{self.claimant} is the operator now, {self.operator} watches")
        elif absent:
            gone, self.operator, self._absent_since = self.operator, "", None
            self._say(f"{gone} has been away for {ABSENCE:.0f} s: nobody operates; press Take over", "warning")
        else:
            return False
        return True

    def view(self) -> dict:
        """What every browser is shown."""
        return {"operator": self.operator, "claimant": self.claimant}

    def _make(self, name: str, sentence: str, level: str = "warning") -> None:
        self.operator, self.claimant, self._absent_since = name, "", None
        self._say(sentence, level)
