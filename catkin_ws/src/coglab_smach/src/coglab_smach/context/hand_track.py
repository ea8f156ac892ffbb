"""A person's hand from sight to sight: one and the same, or another one that the tracker has taken for it."""

from __future__ import annotations

import numpy as np

JUMP, FASTEST = 0.12, 2.0
"""m between two sights that no person's hand goes, nor anything that falls; and m/s of a hand that goes, which may be
so much farther away for each second for which it was hidden"""

Sight = tuple[float, np.ndarray]
"""s, when it was taken, and m"""


class HandTrack:
    """For states in which it matters whose hand it is: one that is hidden may be elsewhere when it is seen again; one
    that is seen all the time goes no faster than a hand can."""

    def __init__(self) -> None:
        self.is_one = True
        """False from a sight of another hand on, until one leads back to where the first one may be"""
        self._newest: Sight | None = None
        self._last: Sight | None = None
        """the newest one of that hand"""

    def follow(self, at: float, place: np.ndarray) -> None:
        """A sight that was taken at ``at`` (s), at ``place`` (m)."""
        before, last = self._newest, self._last
        at = at if before is None else max(at, before[0])
        self._newest = at, place
        jumped = before is not None and _too_far(before, at, place)
        if self.is_one:
            self.is_one = not jumped
        elif jumped and last is not None:
            self.is_one = not _too_far(last, at, place)
        if self.is_one:
            self._last = at, place


def _too_far(before: Sight, at: float, place: np.ndarray) -> bool:
    """Whether no hand goes from that sight to this one."""
    return float(np.linalg.norm(place - before[1])) > JUMP + FASTEST * (at - before[0])
