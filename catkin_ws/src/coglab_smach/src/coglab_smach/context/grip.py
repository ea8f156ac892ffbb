"""The grip on an object that a person may hold, too: what the states of a handover leave for each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coglab_smach.ports.interfaces import HandPort
from coglab_smach.ports.pending import Pending

JUMP = 0.12  # m between two sights that no hand and no falling object covers
FASTEST = 2.0  # m/s of a hand: for each second for which it was hidden it may be so much farther away
PLACE = 0.06  # m within which a hand is where it was

Sight = tuple[float, np.ndarray]
"""s, when it was taken, and m"""


class HandTrack:
    """Follows one hand from sight to sight, where it matters whose hand it is: a hidden hand may be elsewhere when it
    is seen again, and the tracker may have taken another hand for it."""

    def __init__(self) -> None:
        self.is_one = True
        """False from a sight of another hand on, until a sight leads back to where the first one may be"""
        self.is_sure = False
        """whether it was seen all the way from the object on; False from a jump on, until it is seen again where it was
        before that"""
        self._newest: Sight | None = None
        self._last: Sight | None = None  # the newest one of that hand
        self._sure: Sight | None = None  # the newest one while that was sure

    def follow(self, at: float, place: np.ndarray, at_object: bool = True) -> None:
        """Take a sight of time ``at`` (s); ``at_object``: from there the hand may reach the object."""
        before, sure = self._newest, self._sure
        at = at if before is None else max(at, before[0])
        self._newest = at, place
        jumped = before is not None and _too_far(before, at, place)
        if jumped or not self.is_one:
            # It may go on from where it was sure last, whatever was taken for it in between.
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
    """Distance."""
    return float(np.linalg.norm(place - other))


def _too_far(before: Sight, at: float, place: np.ndarray) -> bool:
    """Whether no hand goes from that sight to this one."""
    return far(place, before[1]) > JUMP + FASTEST * (at - before[0])


@dataclass
class Grip:
    """One record for the whole machine. It travels in user data as ``grip``; a copy of it is the same record."""

    object_id: str = ""
    """what the fingers are to close on, or hold"""
    mass: float = 0.0
    """kg of it"""
    firm: int = 0
    """wire speed, and with it the force, with which to tighten a gentle grip once no person's fingers can be between;
    0: nothing to tighten"""
    shared: bool = False
    """the person may hold the object, too"""
    preshaped: bool = False
    """the fingers have taken the preshape of the grasp"""
    closing: Pending | None = field(default=None, repr=False)
    """order to the fingers, given on the last of a reach's way"""
    tightening: Pending | None = field(default=None, repr=False)
    """order to the fingers around an object that the person has let go of"""
    hand: HandTrack = field(default_factory=HandTrack, repr=False)
    """the person's hand, while it may hold the object"""

    def reach_for(self, object_id: str, mass: float, firm: int) -> None:
        """A reach begins."""
        self.object_id, self.mass, self.firm = object_id, mass, firm
        self.closing, self.tightening, self.hand = None, None, HandTrack()

    def close(self, hand: HandPort) -> None:
        """The fingers begin to close on the person's object, whatever becomes of the reach."""
        self.shared, self.closing, self.hand = True, hand.close_on_object(), HandTrack()

    def take_closing(self) -> Pending | None:
        """The order that was given on the way, for whoever waits for it from now on."""
        closing, self.closing = self.closing, None
        return closing

    def stop(self) -> None:
        """No finger closes any further."""
        for order in (self.closing, self.tightening):
            if order is not None:
                order.cancel()

    def release(self) -> None:
        """Nothing is held any more."""
        self.shared, self.firm = False, 0

    def __copy__(self) -> Grip:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Viewers of user data get a plain dict."""
        plain = {name: getattr(self, name) for name in ("object_id", "mass", "firm", "shared", "preshaped")}
        return dict, (plain,)
