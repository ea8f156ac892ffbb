"""Time in the simulated cell. It passes more slowly than real time while a busy computer slows the cell down."""

from __future__ import annotations

import threading
import time

TOPIC = "coglab_sim/real_time_factor"


class Slowed:
    """Maps the time of a clock to slowed time, which passes by a factor. Continuous when the factor changes."""

    def __init__(self) -> None:
        self._pieces = [(0.0, 0.0, 1.0)]  # (clock time, slowed time, factor from then on)

    def at(self, clock: float) -> float:
        """Slowed time (s) at a clock time (s)."""
        since, time_then, factor = self._piece(0, clock)
        return time_then + (clock - since) * factor

    def clock(self, time_here: float) -> float:
        """Clock time (s) at a slowed time (s)."""
        since, time_then, factor = self._piece(1, time_here)
        return since + (time_here - time_then) / factor

    def change(self, clock: float, factor: float) -> None:
        """From this clock time (s) on, slowed time passes by this factor."""
        here = self.at(clock)
        while self._pieces and self._pieces[-1][0] >= clock:  # the clock was set back
            self._pieces.pop()
        self._pieces.append((clock, here, factor))

    def _piece(self, axis: int, value: float) -> tuple[float, float, float]:
        """The newest piece that begins before a value of the clock (axis 0) or of slowed time (1), else the first."""
        return next((piece for piece in reversed(self._pieces) if piece[axis] <= value), self._pieces[0])


class Pace:
    """Follows the real-time factor that the simulated cell publishes. Without a cell (real robot) the factor is 1."""

    def __init__(self) -> None:
        self.factor = 1.0  # until `follow` has been called
        self._steady, self._stamps = Slowed(), Slowed()
        self._lock = threading.Lock()

    def follow(self, topic: str = TOPIC) -> Pace:
        """Subscribe to the cell's factor. Returns self."""
        import rospy  # here: programs without ROS can use this module
        from std_msgs.msg import Float64

        self._subscriber = rospy.Subscriber(topic, Float64, lambda message: self.change(message.data))
        return self

    def change(self, factor: float) -> None:
        """Set the factor. A value outside of (0, 1] is ignored."""
        if not 0.0 < factor <= 1.0 or factor == self.factor:
            return
        import rospy

        with self._lock:
            self._steady.change(time.monotonic(), factor)
            self._stamps.change(rospy.get_time(), factor)
            self.factor = factor

    def now(self) -> float:
        """Current time of the steady clock, slowed (s). For durations."""
        return self.at(time.monotonic())

    def at(self, steady: float) -> float:
        """A time of the steady clock (s), slowed (s)."""
        with self._lock:
            return self._steady.at(steady)

    def steady(self, slowed: float) -> float:
        """Time of the steady clock (s) at a slowed time (s)."""
        with self._lock:
            return self._steady.clock(slowed)

    def of(self, stamp: float) -> float:
        """A stamp (s of ROS time), slowed (s): the difference of two is the time that passed in the cell."""
        with self._lock:
            return self._stamps.at(stamp)
