"""What an arm feels while it rests, and felt at the rest that its last motion has left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

JOLT = 0.02
"""rad that a joint moves at most when somebody pushes an arm that rests, or lets go of it"""
REMEMBERED = 0.25
"""s over which what is felt at rest is averaged, whatever the period: so long a push on the resting arm is not
forgotten"""


class RestTorque:
    """Joint torques (Nm) at rest. Who pushes an arm at rest and lets go of it jolts it; that is no motion, and what it
    felt between is no rest without a touch."""

    def __init__(self) -> None:
        self.before_motion: np.ndarray | None = None
        """at the last rest before a motion that was more than a jolt; None: there was none"""
        self._here: np.ndarray | None = None
        self._left: np.ndarray | None = None
        self._travelled: np.ndarray | None = None
        """rad, since the rest that was left; None: at rest"""

    def move(self, gap: float, velocity: Sequence[float] | np.ndarray) -> None:
        """The arm moves (rad/s), ``gap`` s after the sample before."""
        if self._travelled is None:
            self._left, self._travelled = self._here, np.zeros(7)
        self._travelled = self._travelled + gap * np.asarray(velocity)
        if self._left is not None and self.travels:
            self.before_motion = self._left

    @property
    def travels(self) -> bool:
        """Whether it is on a motion that is more than a jolt."""
        return self._travelled is not None and bool(np.abs(self._travelled).max() > JOLT)

    def stand(self) -> None:
        """It has just come to a stop."""
        self._here = self._travelled = None

    def learn(self, torque: np.ndarray, gap: float) -> None:
        """What it feels now, having stood for a while, ``gap`` s after the sample before."""
        share = min(1.0, gap / REMEMBERED)
        self._here = torque if self._here is None else self._here + share * (torque - self._here)
