"""With which force the hand of a VirtualTrial is told to close, and whether a person's hand is there then."""

import numpy as np
from ih2_hand.emulator.hand import GRASP_CURRENT
from ih2_hand.emulator.motor import STALL_CURRENT
from ih2_hand.wire_choices import WIRE

REACHES = 0.15
"""m from a person's hand to the object within which its fingers may be at it: it holds by 0.1 m at most"""


def gentle_speed():
    """Wire speed at which closing fingers stand with the current of the lowest force level."""
    return GRASP_CURRENT["low"] / STALL_CURRENT * WIRE.speed_max


class HandOrders:
    """Watches a trial from its beginning. ``beside``: of each order to close, the level asked for last or the wire
    speed, while the person's hand was at the object in truth; ``alone``: the same with no hand there."""

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
        """Whether nothing but the lowest force was asked for beside the person's hand, and anything was."""
        levels = {each for each in self.beside if isinstance(each, str)}
        speeds = [each for each in self.beside if not isinstance(each, str)]
        return bool(self.beside) and levels <= {"low"} and all(speed <= gentle_speed() for speed in speeds)
