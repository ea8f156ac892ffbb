"""What the scripted ports share: faults, the person's script, the objects, and requests on their way.

A request acts when its time has come, whether or not anybody waits for it, as over ROS. Only what could not be sent
yet, because the node behind the port is frozen, can be given up.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.clocks.clock import Clock
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import Pending, PortError

from coglab_trials.scripted.arm import ScriptedArm

HAND_AT_WORK = np.array([0.86, 0.03, 0.43])
"""m, of the person's hand while something is handed over"""
HAND_AT_OBJECT = np.array([0.08, 0.0, 0.0])
"""m, of the person's hand from what it holds"""
HAND_SPEED = 1.0  # m/s, of the person's hand


@dataclass
class Faults:
    """What is broken. Names of requests are those in ``ScriptedCell.calls``."""

    dead: set[str] = field(default_factory=set)
    """ports whose node is frozen: arm, hand, perception, database, contact. What is asked of it acts when it comes
    back, unless it was given up."""
    refuse: dict[str, str | PortError] = field(default_factory=dict)
    """name of a request -> sentence, or error with its code, with which it is refused"""
    not_seen: set[str] = field(default_factory=set)
    """objects perception does not see"""
    abort_dmp_after: float = 0.0
    """s into the motion at which it aborts (0: never)"""
    abort_reason: str = "goal lost for 1.0 s"
    arm_disabled: str = ""
    """reason why motion is not allowed"""
    empty_grasp: bool = False
    """the hand closes on nothing"""


@dataclass
class Partner:
    """The person's script: seconds from arming to the touch, to the taking and to the letting go; None: never."""

    touch_after: float | None = 0.8
    take_after: float | None = 1.0
    let_go_after: float | None = 0.2
    away: float = 1.0
    """s for which the person's hand is away then, before it is back at its work"""
    offer: float = 0.0
    request: float = 0.0
    """what is believed of the person"""
    pattern: str = "unknown"
    pattern_at: float = 0.0
    """s into the motion at which the pattern is decided"""


class _Request(Pending):
    """One request on its way."""

    def __init__(self, cell: ScriptedCell, port: str, name: str, after: float, act: Callable[[], Any]) -> None:
        self._cell, self._port, self._name, self._after, self._act = cell, port, name, after, act
        self._due: float | None = None
        """when it acts; None while it is not sent"""
        self.over = self._given_up = False
        self._value: Any = None
        self._error: PortError | None = None

    def done(self) -> bool:
        self._cell.advance()
        return self.over

    def result(self) -> Any:
        if self._error is not None:
            raise self._error
        return self._value

    def cancel(self) -> None:
        self._given_up = True
        self._cell.note(f"cancel {self._name}")

    def look(self, now: float) -> None:
        """Send it if its node is there, let it act if its time has come."""
        if self._port in self._cell.faults.dead:
            return
        if self._due is None and self._given_up:
            self.over = True
            self._error = PortError("the request was given up before it was sent", code=ReasonCode.CANCELLED)
            return
        self._due = now + self._after if self._due is None else self._due
        if now >= self._due:
            self.over = True
            refusal = self._cell.faults.refuse.get(self._name)
            try:
                if refusal is not None:
                    raise refusal if isinstance(refusal, PortError) else PortError(refusal)
                self._value = self._act()
            except PortError as error:
                self._error = error


class ScriptedCell:
    """The state behind the scripted ports, advanced by looking at the clock: no thread of its own. A test reads and
    sets its attributes at any time."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.faults, self.partner = Faults(), Partner()
        self.calls: list[tuple[float, str]] = []
        """when (s) what was asked for"""
        self.arm = ScriptedArm(self)
        self.loaded: dict[str, str] = {}
        """controllers: id -> type"""
        self.fade_time = 0.2
        """s for which the correction of the profile before lasts"""
        self.hand_positions: tuple[int, ...] = (0, 0, 0, 0, 0)
        self.calibrated = False
        self.lifted = 0.0
        """N, upward on the hand"""
        self.pulled: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
        """N, base frame, on the hand; None: the detector does not know"""
        self.touch: float | None = None
        """N of grip for each count by which the fingers squeeze what they hold; None: the hand does not feel"""
        self.objects: dict[str, Pose] = {
            "mug": Pose(np.array([0.78, 0.03, 0.43])),
            "board": Pose(np.array([0.45, -0.55, 0.05])),
            "human_hand": Pose(HAND_AT_WORK),
        }
        self.touched: tuple[str, Pose] | None = None
        """as at_palm, what the hand has touched last, until it is opened: fingers that close have it again"""
        self.at_palm: tuple[str, Pose] | None = None
        """what is in the hand, and the palm relative to it"""
        self.goes: tuple[float, np.ndarray] | None = None
        """the person's hand is on its way: s, when it was where it is, and m, to where it goes"""
        self._back: float | None = None
        """s, when the person's hand comes back"""
        self._lock = threading.RLock()
        self._requests: list[_Request] = []

    # ---- requests

    def note(self, name: str) -> None:
        """Remember a request with its time."""
        self.calls.append((self.clock.now(), name))

    def called(self, prefix: str = "") -> list[str]:
        """Names of the requests so far that begin with ``prefix``."""
        return [name for _, name in self.calls if name.startswith(prefix)]

    def answer(self, port: str, name: str, after: float, act: Callable[[], Any]) -> Pending:
        """A request that reaches its node, acts ``after`` s later and is answered then; it respects the faults."""
        self.note(name)
        request = _Request(self, port, name, after, act)
        with self._lock:
            self._requests.append(request)
        self.advance()
        return request

    def advance(self) -> None:
        """Let everything act whose time has come."""
        with self._lock:
            now = self.clock.now()
            for request in list(self._requests):
                request.look(now)
            self._requests = [request for request in self._requests if not request.over]
            self.arm.follow()
            if self._back is not None and now >= self._back:
                self.goes, self._back = (now, HAND_AT_WORK), None
            self._move_hand(now)

    @property
    def joints(self) -> tuple[float, ...]:
        """Where the arm is, rad."""
        self.advance()
        return self.arm.position()

    # ---- person and objects

    def push(self, force: float) -> None:
        """Somebody lifts the hand with so many N from now on, or presses it down if negative."""
        self.lifted = force

    def pose(self, object_id: str) -> Pose:
        """Where something is, in the base frame: what is in the hand goes with it."""
        if self.at_palm is None or self.at_palm[0] != object_id:
            return self.objects[object_id]
        return self.palm() * self.at_palm[1].inverse()

    def palm(self) -> Pose:
        """Of the robot, base frame."""
        return Pose(*default_arm().fk(np.asarray(self.arm.position())))

    def bring(self, object_id: str, palm: Pose) -> None:
        """The person's object has come into the robot's hand, and theirs comes with it. ``palm``: relative to it."""
        self.at_palm = self.touched = object_id, palm
        self.goes = self.clock.now(), self.pose(object_id).position + HAND_AT_OBJECT

    def let_go(self) -> None:
        """The person's hand leaves what it has given, and comes back later."""
        self.goes = self.clock.now(), HAND_AT_WORK + [0.3, 0.0, 0.0]
        self._back = self.clock.now() + self.partner.away

    def _move_hand(self, now: float) -> None:
        if self.goes is None:
            return
        since, there = self.goes
        here, step = np.asarray(self.objects["human_hand"].position), HAND_SPEED * (now - since)
        way = there - here
        left = float(np.linalg.norm(way))
        self.objects["human_hand"] = Pose(there if left <= step else here + step / left * way)
        self.goes = None if left <= step else (now, there)
