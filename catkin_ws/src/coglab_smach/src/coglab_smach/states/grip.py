"""The grip on an object that a person may hold, too: what the states of a handover leave for each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from coglab_smach.ports.interfaces import HandPort
from coglab_smach.ports.pending import Pending
from coglab_smach.states.hand_tracking import HandTrack


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
