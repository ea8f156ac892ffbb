"""Time as the simulated cell lives it: slower than the clocks while the cell is slowed down on a busy computer."""

from __future__ import annotations

import threading
import time

import rospy
from std_msgs.msg import Float64

TOPIC = "coglab_sim/real_time_factor"


class Slowed:
    """Maps the times of a clock to times that pass by a factor; continuous where the factor changes."""

    def __init__(self) -> None:
        self._pieces = [(0.0, 0.0, 1.0)]  # (clock, its time here, factor from then on), the two newest

    def at(self, clock: float) -> float:
        """The time here at a time of the clock, s."""
        since, time_then, factor = self._pieces[-1] if clock >= self._pieces[-1][0] else self._pieces[0]
        return time_then + (clock - since) * factor

    def clock(self, time_here: float) -> float:
        """The time of the clock at a time here, s."""
        since, time_then, factor = self._pieces[-1] if time_here >= self._pieces[-1][1] else self._pieces[0]
        return since + (time_here - time_then) / factor

    def change(self, clock: float, factor: float) -> None:
        """From this time of the clock on, time passes by this factor."""
        self._pieces = [self._pieces[-1], (clock, self.at(clock), factor)]


class Pace:
    """Follows the factor that the simulated cell publishes. Without such a cell, as on the robot, time is as it is."""

    def __init__(self) -> None:
        self.factor = 1.0  # until `follow` has been called
        self._steady, self._stamps = Slowed(), Slowed()
        self._lock = threading.Lock()

    def follow(self, topic: str = TOPIC) -> Pace:
        """Takes the factor from the cell from now on. Returns itself."""
        self._subscriber = rospy.Subscriber(topic, Float64, lambda message: self.change(message.data))
        return self

    def change(self, factor: float) -> None:
        """The cell goes on at this factor. One that is no number above 0 and up to 1 is ignored."""
        if not 0.0 < factor <= 1.0 or factor == self.factor:
            return
        with self._lock:
            self._steady.change(time.monotonic(), factor)
            self._stamps.change(rospy.get_time(), factor)
            self.factor = factor

    def now(self) -> float:
        """s, of the steady clock, slowed: for durations."""
        return self.at(time.monotonic())

    def at(self, steady: float) -> float:
        """A time of the steady clock (s), slowed."""
        with self._lock:
            return self._steady.at(steady)

    def steady(self, slowed: float) -> float:
        """The time of the steady clock (s) at a slowed one."""
        with self._lock:
            return self._steady.clock(slowed)

    def of(self, stamp: float) -> float:
        """A stamp (s of ROS time), slowed: two of them are as far apart as in the cell."""
        with self._lock:
            return self._stamps.at(stamp)
