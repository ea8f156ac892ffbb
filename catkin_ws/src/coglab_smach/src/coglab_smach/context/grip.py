"""State of the grip on an object that a person may also hold. The states of a handover share it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coglab_smach.ports.interfaces import HandPort
from coglab_smach.ports.pending import Pending

JUMP = 0.12  # m, largest plausible distance between two sights of one hand or of a falling object
FASTEST = 2.0  # m/s, highest speed of a hand: adds to JUMP for each second between the sights
PLACE = 0.06  # m, distance within which a hand counts as unmoved

Sight = tuple[float, np.ndarray]  # (time in s, position in m, shape (3,))


class HandTrack:
    """Tracks one person's hand from sight to sight. A hidden hand may reappear elsewhere, and the tracker may
    confuse it with another hand."""

    def __init__(self) -> None:
        self.is_one = True
        """False from a sight of another hand on, until a sight fits the first hand again"""
        self.is_sure = False
        """True if the hand was tracked without a gap from the object on. False from a jump on, until it is seen where
        it was before the jump."""
        self._newest: Sight | None = None
        self._last: Sight | None = None  # newest sight of that hand
        self._sure: Sight | None = None  # newest sight while is_sure was True

    def follow(self, at: float, place: np.ndarray, at_object: bool = True) -> None:
        """Process a sight of time ``at`` (s). ``at_object``: the hand is within reach of the object."""
        before, sure = self._newest, self._sure
        at = at if before is None else max(at, before[0])
        self._newest = at, place
        jumped = before is not None and _too_far(before, at, place)
        if jumped or not self.is_one:
            # The hand may continue from its last sure place, even if the tracker confused it in between.
            self.is_one = any(
                far(place, each[1]) <= PLACE or (jumped and not _too_far(each, at, place))
                for each in (self._last, sure)
                if each is not None
            )
        if self.is_one:
            self._last = at, place
            if sure is None:
                self.is_sure = at_object
            else:
                self.is_sure = far(place, sure[1]) <= (JUMP if self.is_sure else PLACE)
            self._sure = self._last if self.is_sure else sure


def far(place: np.ndarray, other: np.ndarray) -> float:
    """Returns the distance, m."""
    return float(np.linalg.norm(place - other))


def _too_far(before: Sight, at: float, place: np.ndarray) -> bool:
    """True if no hand can move from that sight to this one."""
    return far(place, before[1]) > JUMP + FASTEST * (at - before[0])


@dataclass
class Grip:
    """One record for the whole machine, in user data as ``grip``. A copy of it is the same object."""

    object_id: str = ""
    """object to be grasped or held"""
    mass: float = 0.0
    """mass of the object, kg"""
    firm: int = 0
    """wire speed (and thus force) for tightening a gentle grip, once no fingers of a person can be in between; 0: no
    tightening"""
    shared: bool = False
    """the person may also hold the object"""
    preshaped: bool = False
    """the fingers are in the preshape of the grasp"""
    closing: Pending | None = field(default=None, repr=False)
    """closing order, sent during the last part of a reach"""
    tightening: Pending | None = field(default=None, repr=False)
    """tightening order, sent when the person has let go of the object"""
    hand: HandTrack = field(default_factory=HandTrack, repr=False)
    """track of the person's hand, while it may hold the object"""

    def reach_for(self, object_id: str, mass: float, firm: int) -> None:
        """Start of a reach."""
        self.object_id, self.mass, self.firm = object_id, mass, firm
        self.closing, self.tightening, self.hand = None, None, HandTrack()

    def close(self, hand: HandPort) -> None:
        """Start closing the fingers on the person's object, however the reach ends."""
        self.shared, self.closing, self.hand = True, hand.close_on_object(), HandTrack()

    def take_closing(self) -> Pending | None:
        """Returns the closing order of the reach and forgets it: the caller waits for it from now on."""
        closing, self.closing = self.closing, None
        return closing

    def stop(self) -> None:
        """Stop the closing and tightening of the fingers."""
        for order in (self.closing, self.tightening):
            if order is not None:
                order.cancel()

    def release(self) -> None:
        """Reset: nothing is held."""
        self.shared, self.firm = False, 0

    def __copy__(self) -> Grip:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Viewers of user data receive a plain dict."""
        plain = {name: getattr(self, name) for name in ("object_id", "mass", "firm", "shared", "preshaped")}
        return dict, (plain,)
