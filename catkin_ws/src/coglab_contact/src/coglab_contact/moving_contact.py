"""Contact from the torques of a moving arm: momentum observer, change of its residual, learnt thresholds.

The computation is C++: see include/coglab_contact/moving_contact.hpp. This module uses and learns the thresholds.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import coglab_controllers as cc
import numpy as np

from coglab_contact import _core
from coglab_contact._core import Change, Offset
from coglab_contact.momentum_observer import Dynamics
from coglab_contact.motion_thresholds import Thresholds, learn

SHORTEST = 40  # samples, shortest motion that counts
LONGEST = 4000  # samples, longest recorded motion; later samples belong to the next one


class MovingContact(_core.MovingContact):
    """Processes every sample of lwr/joint_states; returns evidence of contact. The default payload is zero."""

    def __init__(
        self,
        thresholds: Thresholds,
        dynamics: Dynamics,
        jacobian: cc.Chain | Callable[[np.ndarray], np.ndarray],
        period: float = 0.0,
    ) -> None:
        """``jacobian``: the chain to the palm, or a function from joint positions (rad) to the palm's 3 x 7 matrix,
        base frame. ``period``: see MomentumObserver."""
        super().__init__(dynamics, jacobian, period)
        self.use(thresholds)

    def use(self, thresholds: Thresholds) -> None:
        """Use these thresholds, and the lag of the torques that was learnt with them."""
        self.thresholds = thresholds
        self.set_thresholds(
            thresholds.variance, thresholds.limit, thresholds.steady, thresholds.steady_limit, thresholds.lag
        )


def unwritable(file: str) -> str:
    """Returns the reason why a file cannot be written, a sentence; empty if it can. The file is not touched: an empty
    one would be read at the next start."""
    path = Path(file)
    if path.is_dir():
        return f"{path} is a folder: name a file in it"
    if path.exists():
        return "" if os.access(path, os.W_OK) else f"{path}: no permission to write"
    folder = path.absolute().parent
    if not folder.is_dir():
        return f"{path} cannot be written: the folder {folder} does not exist; create it"
    return "" if os.access(folder, os.W_OK) else f"{path} cannot be written: no permission to write in {folder}"


class MotionRecorder:
    """Records the motions of a MovingContact, for learning. Nobody may touch the arm meanwhile."""

    def __init__(self, moving: MovingContact) -> None:
        self.moving = moving
        self.reaches: list[list[Change]] = []
        self.offsets: list[Offset] = []
        self._reach: list[Change] = []
        self._stamp = 0.0

    def look(self) -> None:
        """Call this after each sample of the arm. One motion lasts from rest to rest."""
        change = self.moving.change
        if change is None or change.stamp == self._stamp:
            return
        self._stamp = change.stamp
        self._reach.append(change)
        resting = self.moving.still()
        if len(self._reach) >= LONGEST or (resting and self._moved()):
            self.end()
        elif resting:
            # Of the rest before a motion, only the last moment belongs to it, not the stop of the previous motion.
            self._reach = self._reach[-SHORTEST:]

    def _moved(self) -> bool:
        return max(change.features[0, 1] for change in self._reach) > 0.1

    def end(self) -> None:
        """End the motion and keep it if it was long enough."""
        if len(self._reach) >= SHORTEST and self._moved():
            self.reaches.append(self._reach)
            offset = self.moving.offset_of_motion()
            if offset is not None and self.moving.load == 0.0:
                self.offsets.append(offset)
        self._reach = []

    def learn(self) -> Thresholds:
        """Learn from the recorded motions. ThresholdError if there are too few."""
        return learn(self.reaches, self.offsets, lag=self.moving.thresholds.lag)
