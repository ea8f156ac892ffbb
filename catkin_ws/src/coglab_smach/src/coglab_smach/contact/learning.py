"""Gathers the robot's own motions without contact, to learn the thresholds of a moving arm from them."""

from __future__ import annotations

import os
from pathlib import Path

from coglab_smach.contact.motion_thresholds import Change, Offset, Thresholds, learn
from coglab_smach.contact.moving_contact import MovingContact

SHORTEST = 40
"""samples of a motion that counts"""
LONGEST = 4000
"""samples of one that is kept; what follows belongs to the next"""


def unwritable(file: str) -> str:
    """Why what is learnt cannot be written to this file, in a sentence; empty where it can. The file is not touched: an
    empty one would be read at the next start."""
    path = Path(file)
    if path.is_dir():
        return f"{path} is a folder: name a file in it"
    if path.exists():
        return "" if os.access(path, os.W_OK) else f"{path} may not be written"
    folder = path.absolute().parent
    if not folder.is_dir():
        return f"{path} cannot be written, for the folder {folder} is not there: create it"
    return "" if os.access(folder, os.W_OK) else f"{path} cannot be written, for the folder {folder} may not be written"


class MotionRecorder:
    """Look at a MovingContact after each sample; nobody touches the arm meanwhile."""

    def __init__(self, moving: MovingContact) -> None:
        self.moving = moving
        self.reaches: list[list[Change]] = []
        self.offsets: list[Offset] = []
        self._reach: list[Change] = []
        self._stamp = 0.0

    def look(self) -> None:
        """After each sample of the arm: one motion lasts from rest to rest."""
        change = self.moving.change
        if change is None or change.stamp == self._stamp:
            return
        self._stamp = change.stamp
        self._reach.append(change)
        resting = self.moving.still()
        if len(self._reach) >= LONGEST or (resting and self._moved()):
            self.end()
        elif resting:
            # Of the rest before a motion its last moment belongs to it: the stop of the one before does not.
            self._reach = self._reach[-SHORTEST:]

    def _moved(self) -> bool:
        return max(change.features[0, 1] for change in self._reach) > 0.1

    def end(self) -> None:
        """The motion is over, or has lasted long enough."""
        if len(self._reach) >= SHORTEST and self._moved():
            self.reaches.append(self._reach)
            offset = self.moving.offset_of_motion()
            if offset is not None and self.moving.load == 0.0:
                self.offsets.append(offset)
        self._reach = []

    def learn(self) -> Thresholds:
        """From what was gathered. ThresholdError where that is too little."""
        return learn(self.reaches, self.offsets, lag=self.moving.thresholds.lag)
