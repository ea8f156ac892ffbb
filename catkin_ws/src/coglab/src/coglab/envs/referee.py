"""True result of a handover: success, time, force on the person, a fallen object. Policies do not see it."""

from __future__ import annotations

import math
from typing import Any

from coglab_trials.world import DT, World

RECEIVE, GIVE = "receive", "give"
KEEPER = {RECEIVE: "robot", GIVE: "human"}  # holder of the object after a success
KEPT = 1.0  # s that the receiver must hold the object alone
GENTLE = 5.0  # N, force on the person without a penalty


class Referee:
    """Judges one handover by the truth of the simulated cell. Call look() after each period of the world.

    Attributes: ``success``: the receiver has held the object alone for 1 s. ``time``: s from the beginning until the
    receiver held it alone; None without a success. ``force``: largest force (N) of the robot's hand on the person or on
    an object that the person holds, mean over 5 ms. ``rough``: N s, force above 5 N summed over time. ``dropped``: the
    object lies on the floor. ``gave_up``: the person has gone back without a success.
    """

    def __init__(self, world: World, task: str) -> None:
        self._world, self._keeper = world, KEEPER[task]
        self._begun = world.t
        self._since: float | None = None
        self._came = False
        self.success = self.dropped = self.gave_up = False
        self.time: float | None = None
        self.force = self.now = self.rough = 0.0

    def look(self) -> None:
        """Looks at the world after one period."""
        t = self._world.t
        held_by, dropped, force = self._world.cell.handover()
        self.now = force if held_by in ("human", "both") else 0.0
        self.force = max(self.force, self.now)
        self.rough += DT * max(0.0, self.now - GENTLE)
        self.dropped = self.dropped or dropped
        if self.success:
            return
        if held_by != self._keeper or self.dropped:
            self._since = None
        elif self._since is None:
            self._since = t
        elif t - self._since >= KEPT - 1e-9:
            self.success, self.time = True, self._since - self._begun
        phase = self._world.human.phase
        self._came = self._came or phase != "idle"
        self.gave_up = self._came and phase == "idle" and self._since is None and not self.success

    def info(self) -> dict[str, Any]:
        """The figures so far, for ``info``. ``time`` is infinite without a success."""
        return {
            "success": self.success,
            "time": math.inf if self.time is None else self.time,
            "force": self.force,
            "dropped": self.dropped,
            "gave_up": self.gave_up,
        }
