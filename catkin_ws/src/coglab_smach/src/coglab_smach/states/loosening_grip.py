"""The fingers around an object that a person takes: looser as they carry it, and closed again."""

from __future__ import annotations

import math
from collections.abc import Callable

from coglab_smach.ports.interfaces import HandPort
from coglab_smach.ports.pending import Pending

FINGERS = slice(1, 5)  # motors that bend fingers
FIRMER = 0.15  # share of the wanted grip force above which the fingers open
WEAKER = 0.3  # share below which they close
AHEAD = 0.04  # s for which the grip goes on after an order to stand: delay of sensors, nodes and the hand's line
SEEN_AFTER = 0.1  # s after which the effect of that order is seen


class LooseningGrip:
    """The fingers around an object: opened by counts of a motor's position (0 open .. 254 closed), or until the grip
    that is felt has come down, and closed again."""

    def __init__(
        self,
        hand: HandPort,
        speed: int,
        closing_speed: int,
        easing_speed: int = 1,
        force: Callable[[], float | None] = lambda: None,
    ) -> None:
        """``speed``, ``closing_speed``, ``easing_speed``: 1..511, wire speeds of loosening, of closing (and with it the
        force) and of loosening while ``force`` (N of grip that are felt) is not None."""
        self._hand, self._speed, self._closing_speed = hand, speed, closing_speed
        self._easing_speed, self._force = easing_speed, force
        self._closed, self._firm = hand.state().positions, force()
        self._seen: tuple[float, float] | None = None
        self._rate, self._stood = 0.0, -math.inf
        """N/s of the grip, and when (s) fingers that followed it stood last"""
        self._opening: Pending | None = None
        self._closing: Pending | None = None

    def loosened(self) -> int | None:
        """Counts by which the finger that has moved most is more open than in the grip; None if that is not known."""
        now = self._hand.state().positions
        if not now or not self._closed:
            return None
        return max(c - n for c, n in zip(self._closed[FINGERS], now[FINGERS], strict=True))

    def loosen_to(self, counts: float) -> None:
        """Open on until they are so loose; call it again and again."""
        if not self._has_closed():
            return
        loosened = self.loosened()
        if self._opening is None:
            if loosened is not None and loosened + 1 <= counts:
                self._opening = self._hand.open(self._speed)
        elif loosened is None or loosened >= counts or self._opening.done():
            self.stand()

    def ease_to(self, part: float, least: float, counts: float, now: float) -> bool:
        """Grip with so much of the force of the closed grip, with ``least`` N at least, and looser by ``counts`` at
        most; call it again and again. False, and nothing done, where no force is felt."""
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
        """Whether no closing is under way any more. What they hold with then is the closed grip."""
        if self._closing is None:
            return True
        if not self._closing.done():
            return False
        self._closed, self._firm, self._closing = self._hand.state().positions, self._force(), None
        return True

    def stand(self) -> None:
        """No looser."""
        if self._opening is not None:
            self._opening.cancel()
            self._opening = None

    def tighten(self) -> None:
        """Close again, unless they do."""
        self.stand()
        if self._closing is None:
            self._closing = self._hand.close(self._closing_speed)
