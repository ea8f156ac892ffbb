"""A person's hand from sight to sight: one and the same, or another one that the tracker has taken for it."""

from __future__ import annotations

import numpy as np

JUMP, FASTEST = 0.12, 2.0
"""m between two sights that no person's hand goes, nor anything that falls; and m/s of a hand that goes, which may be
so much farther away for each second for which it was hidden"""
PLACE = 0.06
"""m in which a hand is where it was"""

Sight = tuple[float, np.ndarray]
"""s, when it was taken, and m"""


class HandTrack:
    """For states in which it matters whose hand it is: one that is hidden may be elsewhere when it is seen again, and
    so may another one; one that is seen all the time goes no faster than a hand can."""

    def __init__(self) -> None:
        self.is_one = True
        """False from a sight of another hand on, until one leads back to where the first one may be"""
        self.is_sure = False
        """whether it was seen all the way from the object on: not from a sight on that lies farther than JUMP from the
        one before, until it is seen again where it was before that"""
        self._newest: Sight | None = None
        self._last: Sight | None = None
        """the newest one of that hand"""
        self._sure: Sight | None = None
        """the newest one as long as that was sure"""

    def follow(self, at: float, place: np.ndarray, at_object: bool = True) -> None:
        """A sight that was taken at ``at`` (s), at ``place`` (m), where it may reach the object."""
        before, sure = self._newest, self._sure
        at = at if before is None else max(at, before[0])
        self._newest = at, place
        jumped = before is not None and _too_far(before, at, place)
        if jumped or not self.is_one:
            # It may go on from where it was sure last, whatever was taken for it between.
            self.is_one = any(
                _far(place, each[1]) <= PLACE or (jumped and not _too_far(each, at, place))
                for each in (self._last, sure)
                if each is not None
            )
        if self.is_one:
            self._last = at, place
            if sure is None:
                self.is_sure = at_object
            else:
                self.is_sure = _far(place, sure[1]) <= (JUMP if self.is_sure else PLACE)
            self._sure = self._last if self.is_sure else sure


def _far(place: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(place - other))


def _too_far(before: Sight, at: float, place: np.ndarray) -> bool:
    """Whether no hand goes from that sight to this one."""
    return _far(place, before[1]) > JUMP + FASTEST * (at - before[0])
