"""The fingers around an object that a person takes: they loosen with the load, and can close again."""

from __future__ import annotations

import math
from collections.abc import Callable

from coglab_smach.ports.interfaces import HandPort
from coglab_smach.ports.pending import Pending

FINGERS = slice(1, 5)  # motors that bend fingers
FIRMER = 0.15  # excess over the wanted grip force (relative) at which the fingers open
WEAKER = 0.3  # lack of the wanted grip force (relative) at which they close
AHEAD = 0.04  # s from the order to stop until the grip force stops changing: sensors, nodes and serial line
SEEN_AFTER = 0.1  # s from that order until its effect is measured


class LooseningGrip:
    """The fingers around an object. They open by counts of motor position (0 open .. 254 closed), or until the measured
    grip force has fallen to a value. They can close again."""

    def __init__(
        self,
        hand: HandPort,
        speed: int,
        closing_speed: int,
        easing_speed: int = 1,
        force: Callable[[], float | None] = lambda: None,
    ) -> None:
        """Wire speeds, 1..511: ``speed`` of loosening; ``closing_speed`` of closing, which also sets the force;
        ``easing_speed`` of loosening while ``force`` (measured grip force, N) is not None."""
        self._hand, self._speed, self._closing_speed = hand, speed, closing_speed
        self._easing_speed, self._force = easing_speed, force
        self._closed, self._firm = hand.state().positions, force()
        self._seen: tuple[float, float] | None = None
        self._rate, self._stood = 0.0, -math.inf
        """rate: N/s of the grip force. stood: time (s) when force-controlled fingers stopped last"""
        self._opening: Pending | None = None
        self._closing: Pending | None = None

    def loosened(self) -> int | None:
        """Returns the counts by which the finger that moved most has opened since the grip; None if unknown."""
        now = self._hand.state().positions
        if not now or not self._closed:
            return None
        return max(c - n for c, n in zip(self._closed[FINGERS], now[FINGERS], strict=True))

    def loosen_to(self, counts: float) -> None:
        """Open the fingers up to ``counts``. Call this repeatedly."""
        if not self._has_closed():
            return
        loosened = self.loosened()
        if self._opening is None:
            if loosened is not None and loosened + 1 <= counts:
                self._opening = self._hand.open(self._speed)
        elif loosened is None or loosened >= counts or self._opening.done():
            self.stand()

    def ease_to(self, part: float, least: float, counts: float, now: float) -> bool:
        """Open the fingers until the grip force is ``part`` of that of the closed grip, at least ``least`` N, and open
        them by ``counts`` at most. Call this repeatedly. Returns False, and does nothing, if no force is measured."""
        force, loosened = self._force(), self.loosened()
        if force is None or loosened is None:
            return False
        if self._firm is None:
            self._firm = force
        before, self._seen = self._seen, (now, force)
        if before is not None and now > before[0]:
            self._rate += 0.5 * ((force - before[1]) / (now - before[0]) - self._rate)
        ahead = force + AHEAD * self._rate
        wanted = max(least, part * self._firm)
        if not self._has_closed():
            if ahead >= wanted and self._closing is not None:
                self._closing.cancel()
                self._closing, self._stood = None, now
        elif self._opening is not None:
            if ahead <= wanted or loosened >= counts or self._opening.done():
                self.stand()
                self._stood = now
        elif now < self._stood + SEEN_AFTER:
            pass
        elif force < (1.0 - WEAKER) * wanted and loosened > 0:
            self.tighten()
        elif force > (1.0 + FIRMER) * wanted and loosened + 1 <= counts:
            self._opening = self._hand.open(self._easing_speed)
        return True

    def _has_closed(self) -> bool:
        """Returns whether no closing is running. A finished closing defines the new closed grip."""
        if self._closing is None:
            return True
        if not self._closing.done():
            return False
        self._closed, self._firm, self._closing = self._hand.state().positions, self._force(), None
        return True

    def stand(self) -> None:
        """Stop loosening."""
        if self._opening is not None:
            self._opening.cancel()
            self._opening = None

    def tighten(self) -> None:
        """Close the fingers again, unless they are already closing."""
        self.stand()
        if self._closing is None:
            self._closing = self._hand.close(self._closing_speed)
