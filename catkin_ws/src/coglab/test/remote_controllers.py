"""Controllers for the tests of slots, good and bad."""

import time

import ctrl_more
import numpy as np
from my_sway import Sway as _Sway


class Sway(_Sway):
    """Sways for 10 s."""

    def configure(self, setup):
        """Like the base, but longer."""
        super().configure(setup)
        self.duration = setup.argument("longer", "s", 10.0, 0.5, 20.0)


class Shift(ctrl_more.FeedbackController):
    """Shifts the hand by `height` along z."""

    def describe(self):
        """Declare the correction and its gain."""
        d = ctrl_more.Description("shifts the hand")
        d.modifies("taskSpaceReferencePose", "ee", unit="m", frame="base")
        d.gain("height", 0.03, low=0.0, high=0.1, unit="m")
        return d

    def initialize(self, setup):
        """Fetch handles."""
        self.ee, self.height = setup.modify("ee"), setup.gain("height")
        self.cycles = 0

    def update(self, cycle, robot, original, modified):
        """Shift."""
        self.cycles += 1
        modified[self.ee][2] += self.scalar(self.height)
        self.then(modified)

    def then(self, modified):
        """Hook for the fault of a derived class."""


class Jump(Shift):
    """Requests a larger correction than a slot allows, up and down."""

    def then(self, modified):
        """Jump."""
        modified[self.ee][2] += 0.3 if self.cycles // 20 % 2 == 0 else -0.3


class Late(Shift):
    """Holds Python's lock for 0.3 s in its 40th cycle."""

    def then(self, modified):
        """Compute without releasing the lock."""
        end = time.monotonic() + 0.3
        while self.cycles == 40 and time.monotonic() < end:
            sum(range(1000))


class Endless(Shift):
    """Does not return from its 40th cycle."""

    def then(self, modified):
        """Loop."""
        while self.cycles >= 40:
            pass


class Raises(Shift):
    """Raises in its 40th cycle."""

    def then(self, modified):
        """Raise."""
        if self.cycles == 40:
            raise KeyError("my mistake")


class Nan(Shift):
    """Writes NaN from its 40th cycle on."""

    def then(self, modified):
        """Write."""
        if self.cycles >= 40:
            modified[self.ee][0] = np.nan
