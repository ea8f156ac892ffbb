"""Every joint to the ends of its range at full speed while datagrams are lost: what the stand-in's limit switches say.

Bridge and stand-in in lockstep, bytes in between. Losses keep within what the stand-in rides through.
"""

from __future__ import annotations

import random
import sys
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import lwr_fri_bridge as bridge_module
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))
from wire import LIMITS, Wire

IN_A_ROW, OF_HUNDRED = 5, 20
"""most cycles that are lost, in a row and of any hundred (docs/limits_under_loss.md)"""
A2 = 1
"""index of the joint that leans the whole arm over"""
SECONDS = 1.6  # of one approach
CLOSE = 0.06  # rad before its end that a joint comes to, or the approach shows nothing


class Lost(Enum):
    """What a cycle loses."""

    NOTHING = "nothing"
    MEASUREMENT = "the measurement"
    ANSWER = "the answer"


@dataclass(frozen=True)
class Losses:
    """How many cycles are lost, and in what groups."""

    share: float
    bursts: bool = False

    def pattern(self, draw: random.Random) -> Iterator[Lost]:
        """Cycle by cycle, one at a time or in bursts of 1 to 5; half lose the measurement, half the answer."""
        mean = 3.0 if self.bursts else 1.0
        begins = self.share / (mean * (1.0 - self.share))
        window: deque[bool] = deque(maxlen=99)
        left, last = 0, False
        while True:
            if left == 0 and not last and draw.random() < begins:
                left = draw.randint(1, IN_A_ROW) if self.bursts else 1
            if sum(window) >= OF_HUNDRED:
                left = 0
            last = left > 0
            left -= last
            window.append(last)
            yield draw.choice((Lost.MEASUREMENT, Lost.ANSWER)) if last else Lost.NOTHING


@dataclass(frozen=True)
class Approach:
    """What came of one."""

    limit_switches: int
    arrived: bool
    """the joint came close to its end, and command mode lasted"""


class LossyWire(Wire):
    """Bridge and stand-in, whose datagrams may get lost one by one."""

    def cycle(self, lost: Lost) -> None:
        """One FRI period."""
        measurement = None if lost is Lost.MEASUREMENT else self.measurement
        answer = self.bridge.answer(measurement, self.now) if measurement is not None else None
        if self.velocity is not None:
            self.bridge.send_velocity(self.velocity, self.now)
        self.measurement = self.cell.step(None if lost is Lost.ANSWER else answer)
        self.now += round(self.cell.period * 1e9)


def approach(period: float, losses: Losses, seed: int, **cell: object) -> Approach:
    """One joint, by the seed, to one end of its range; `cell`: parameters of the stand-in besides its period."""
    draw = random.Random(seed)
    limits = bridge_module.JointLimits(LIMITS)
    joint, side = seed % 7, 1.0 if seed % 14 < 7 else -1.0
    home = [draw.uniform(-0.6, 0.6) for _ in range(7)]
    if joint == A2:  # the forearm stays above the board
        home[2], home[3] = 0.0, 1.2 * side
    home[joint] = side * (limits.upper_position[joint] - draw.uniform(0.5, 1.2))
    wire = LossyWire(krc__period=period, home=home, **cell)
    wire.start()
    wire.velocity = np.zeros(7)
    wire.velocity[joint] = side * limits.velocity[joint]
    nearest = np.inf
    pattern = losses.pattern(draw)
    for _ in range(round(SECONDS / period)):
        wire.cycle(next(pattern))
        nearest = min(nearest, limits.upper_position[joint] - side * wire.cell.set_point[joint])
    return Approach(wire.cell.limit_switches, bool(nearest < CLOSE and wire.cell.fri_state == 2))
