"""Force of each closing order in a VirtualTrial, and whether a person's hand is at the object at that time."""

import numpy as np
from ih2_hand.emulator.hand import GRASP_CURRENT
from ih2_hand.emulator.motor import STALL_CURRENT
from ih2_hand.wire_choices import WIRE

REACHES = 0.15
"""m, distance from hand to object within which a person's fingers may be at it; a holding hand is within 0.1 m"""


def gentle_speed():
    """Returns the wire speed at which closing fingers stall with the current of the lowest force level."""
    return GRASP_CURRENT["low"] / STALL_CURRENT * WIRE.speed_max


class HandOrders:
    """Records the closing orders of a trial. ``beside``: force level or wire speed of each order while the true hand
    of the person was at the object. ``alone``: the same without a hand there."""

    def __init__(self, trial):
        self.trial, self.beside, self.alone, self._level = trial, [], [], ""
        hand = trial.ctx.hand
        preshape, close, on_object = hand.preshape, hand.close, hand.close_on_object
        hand.preshape = lambda mode, level: self._shaped(level) or preshape(mode, level)
        hand.close = lambda speed: self._told(speed) or close(speed)
        hand.close_on_object = lambda: self._told(self._level) or on_object()

    def _shaped(self, level):
        self._level = level

    def _told(self, force):
        truth = self.trial.world.cell.truth()
        away = np.linalg.norm(np.array(truth["human_hand"]["position"]) - np.array(truth["object"]["position"]))
        (self.beside if away < REACHES else self.alone).append(force)

    def gentle(self):
        """True if there were orders beside the person's hand, all with the lowest force."""
        levels = {each for each in self.beside if isinstance(each, str)}
        speeds = [each for each in self.beside if not isinstance(each, str)]
        return bool(self.beside) and levels <= {"low"} and all(speed <= gentle_speed() for speed in speeds)
