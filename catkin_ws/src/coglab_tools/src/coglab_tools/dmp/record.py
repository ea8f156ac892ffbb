"""Records a demonstration: the hand-guided arm, or a tracked hand.

`record()` works on the running robot and in a `coglab.World`. The arm is in hand guiding (`robot.arm.guided()`) only
during the recording; then it stands in place, in position mode.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any

import numpy as np
from coglab.results import Refused

from coglab_tools.command import CheckFailed, NotThere
from coglab_tools.dmp.cut import LOW, SHORTEST
from coglab_tools.dmp.demonstration import Demonstration
from coglab_tools.dmp.read import MOTOR_CLOSED

PERIOD = 0.005  # s between two looks at the palm or at a tracked hand
SAME_SIGHT = 0.002  # s; sights with a smaller difference in time are the same one
STILL = 0.5  # s at rest after a reach, end of a demonstration
WINDOW = 0.1  # s over which the speed is taken
FASTEST = 1.5  # m/s; a faster palm is not guided by a hand
TRACE = 0.1  # s between two lines of the live trace


class Trace:
    """Positions, speed and distance from the start of the hand over time."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.poses: list[Any] = []
        self.closing: list[float] = []
        self.still_since: float | None = None

    def add(self, t: float, pose: Any, fingers: tuple[int, ...]) -> None:
        """Add a sample at t (s). An older sample, or the same sight again, is ignored."""
        if self.times and t <= self.times[-1] + SAME_SIGHT:
            return
        self.times.append(t)
        self.poses.append(pose)
        self.closing.append(float(np.mean(fingers[1:])) / MOTOR_CLOSED if len(fingers) == 5 else np.nan)
        if self.speed > LOW:
            self.still_since = None
        elif self.still_since is None:
            self.still_since = t

    @property
    def speed(self) -> float:
        """m/s over the last 0.1 s"""
        i = len(self.times) - 1
        while i > 0 and self.times[-1] - self.times[i] < WINDOW:
            i -= 1
        span = self.times[-1] - self.times[i]
        way = self.poses[-1].position - self.poses[i].position
        return float(np.linalg.norm(way)) / span if span >= 0.5 * WINDOW else 0.0

    @property
    def way(self) -> float:
        """m from the start"""
        return float(np.linalg.norm(self.poses[-1].position - self.poses[0].position))

    @property
    def over(self) -> bool:
        """True if the hand rests after a reach."""
        if not self.times:
            return False
        rests = self.still_since is not None and self.times[-1] - self.still_since >= STILL
        return rests and self.way >= SHORTEST

    def line(self) -> str:
        """The live trace: time, place, speed and a bar for the way."""
        x, y, z = self.poses[-1].position
        bar = "#" * min(30, int(30 * self.way))
        return (
            f"{self.times[-1] - self.times[0]:5.1f} s  x {x:6.3f}  y {y:6.3f}  z {z:6.3f} m  {self.speed:5.2f} m/s  "
            f"{self.way:5.3f} m {bar:30}"
        )


def record(
    robot: Any,
    name: str,
    frame: str = "",
    *,
    limit: float = 30.0,
    ends: Callable[[], bool] = lambda: False,
    show: Callable[[str], None] = lambda line: None,
) -> Demonstration:
    """Record one demonstration with the robot of `coglab.connect()` or `World.robot`.

    `frame`: tf frame of the tracked hand; empty: the hand-guided arm. It ends when `ends()` is true, when the
    hand rests for 0.5 s after a reach, or after `limit` s. `show` gets ten lines per second. CheckFailed if the arm is
    too fast, the brain starts an action, or nothing was recorded.
    """
    if not frame:
        check_free(robot)
    trace = Trace()
    problem = ""
    try:
        with nullcontext() if frame else robot.arm.guided():
            _follow(robot, frame, trace, limit, ends, show)
    except (Refused, TimeoutError) as error:
        if not trace.over and not ends():
            raise
        problem = f"the end of hand guiding failed: {error}"  # the recording is valid
    if len(trace.times) < 10:
        raise CheckFailed(f"{len(trace.times)} samples were recorded, expected at least 10")
    closing = np.array(trace.closing)
    return Demonstration(
        name,
        np.array(trace.times) - trace.times[0],
        np.array([pose.position for pose in trace.poses]),
        np.array([pose.orientation for pose in trace.poses]),
        closing if np.isfinite(closing).all() else None,
        (f"recorded from {f'the frame {frame}' if frame else 'the arm, led by hand'}", *([problem] if problem else [])),
    )


def _follow(
    robot: Any, frame: str, trace: Trace, limit: float, ends: Callable[[], bool], show: Callable[[str], None]
) -> None:
    """Fill the trace until it is over. A sample's time is that of its measurement."""
    begun, shown, hub = robot.time, -np.inf, robot.state.state
    while robot.time - begun < limit and not ends() and not trace.over:
        pose, age = robot.seen(frame or "palm")
        trace.add(robot.time - age, pose, () if frame else robot.state.fingers)
        if not frame and trace.speed > FASTEST:
            raise CheckFailed(
                f"the palm moves at {trace.speed:.1f} m/s and is not led any more (at most {FASTEST:g} m/s): "
                "the arm was stopped. Are the load data of the hand right?"
            )
        if robot.time - shown >= TRACE:
            shown = robot.time
            show(trace.line())
            if not frame and robot.state.state != hub:
                raise CheckFailed(f"the brain left {hub}: somebody started an action; hand guiding was ended")
        robot.pause(PERIOD)


def check_free(robot: Any) -> None:
    """CheckFailed unless the arm can be led now: no action runs, and the hand is empty."""
    state = robot.state
    if state.holding:
        raise CheckFailed(
            f"the hand holds '{state.holding}', and the arm would sink under its weight: give it or put it first"
        )
    if state.state and not state.actions:
        raise CheckFailed(f"an action runs ({state.state}): record when it has ended; ./coglab status shows it")


def settle(robot: Any, terminal: Terminal, stay: bool) -> str:
    """After hand guiding: bring the arm home, or leave it. Returns a sentence on the state of the machine."""
    if not stay:
        terminal.say("let go of the hand: the arm goes home")
        terminal.count_down(3, robot.pause)
        if robot.state.actions and "reset" not in robot.state.actions:
            end = robot.arm.move_joints(robot.arm.home, 4.0)
        else:
            end = robot.reset()
        if not end.ok:
            return f"the arm did not come home: {end}; go on with: ./coglab start reset"
    state = robot.state
    if not state.state:
        return f"the arm is {'home' if not stay else 'where it was led'}; this robot has no brain"
    name = state.state.rpartition("/")[2]
    if "reset" in state.actions or "initialise" in state.actions:
        return f"the machine is in '{name}', the arm where it was led; go on with: ./coglab start {state.actions[0]}"
    return f"the machine waits in '{name}', ready for {', '.join(state.actions)}"


class Terminal:
    """Count-down, live trace and end key of `dmp record`."""

    def __init__(self) -> None:
        self.interactive = sys.stdin.isatty() and sys.stderr.isatty()
        self._lines = 0

    def count_down(self, seconds: int, pause: Callable[[float], None]) -> None:
        """Say 3, 2, 1."""
        for left in range(seconds, 0, -1):
            self.say(f"{left} ...")
            pause(1.0)

    def begin(self) -> None:
        """Announce the start and the ways to end the recording."""
        self.say("now; rest ends it" + (", and so does any key" if self.interactive else ""))

    def say(self, line: str) -> None:
        """Print a permanent line."""
        print(f"\r{line:100}" if self.interactive else line, file=sys.stderr, flush=True)

    def show(self, line: str) -> None:
        """Replace the last line; without a terminal print only each tenth."""
        self._lines += 1
        if self.interactive:
            print(f"\r{line}", end="", file=sys.stderr, flush=True)
        elif self._lines % 10 == 1:
            print(line, file=sys.stderr, flush=True)

    @contextmanager
    def keys(self) -> Iterator[Callable[[], bool]]:
        """Yields a function that is true once a key was pressed."""
        if not self.interactive:
            yield lambda: False
            return
        import select
        import termios
        import tty

        before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
        try:
            yield lambda: bool(select.select([sys.stdin], [], [], 0.0)[0])
        finally:
            with suppress(termios.error):
                termios.tcflush(sys.stdin, termios.TCIFLUSH)
                termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


class Button:
    """A button that somebody holds: std_msgs/Bool, or any button of sensor_msgs/Joy, on a topic."""

    def __init__(self, topic: str) -> None:
        import rospy
        import rostopic

        kind, name, _ = rostopic.get_topic_class(topic, blocking=False)
        if kind is None:
            raise NotThere(
                f"nobody publishes the button {topic}: start its node first (std_msgs/Bool or sensor_msgs/Joy)"
            )
        if not {"data", "buttons"} & set(kind.__slots__):
            raise NotThere(f"the button {topic} is a {kind._type}; expected std_msgs/Bool or sensor_msgs/Joy")
        self.held = False
        self._subscriber = rospy.Subscriber(name, kind, self._take, queue_size=1)

    def _take(self, message: Any) -> None:
        self.held = any(message.buttons) if hasattr(message, "buttons") else bool(message.data)


def await_button(button: Button, robot: Any, limit: float = 60.0) -> None:
    """Wait until the button is held. NotThere after `limit` s."""
    end = robot.time + limit
    while not button.held:
        if robot.time > end:
            raise NotThere(f"the button was not pressed within {limit:g} s")
        robot.pause(0.02)
