"""Shared state of the scripted ports: faults, the person's script, the objects, and pending requests.

As over ROS, a request acts at its time even if nobody waits for it. It can be given up only while it is not sent,
because the node behind the port is frozen.
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

HAND_AT_WORK = np.array([0.86, 0.03, 0.43])  # m, position of the person's hand during a handover
HAND_AT_OBJECT = np.array([0.08, 0.0, 0.0])  # m, from the object to the person's hand that holds it
HAND_SPEED = 1.0  # m/s, speed of the person's hand


@dataclass
class Faults:
    """Faults of the cell. Names of requests are those in ``ScriptedCell.calls``."""

    dead: set[str] = field(default_factory=set)
    """ports whose node is frozen: arm, hand, perception, database, contact. Their requests act when the node
    continues, unless they were given up."""
    refuse: dict[str, str | PortError] = field(default_factory=dict)
    """request name -> sentence, or error with code, of the refusal"""
    not_seen: set[str] = field(default_factory=set)
    """objects that perception does not see"""
    abort_dmp_after: float = 0.0
    """time (s) after its start at which the motion aborts; 0: never"""
    abort_reason: str = "goal lost for 1.0 s"
    arm_disabled: str = ""
    """reason why the arm may not move; empty: it may"""
    empty_grasp: bool = False
    """the hand closes on nothing"""


@dataclass
class Partner:
    """The person's script: times (s) from arming the detector to touch, taking and letting go. None: never."""

    touch_after: float | None = 0.8
    take_after: float | None = 1.0
    let_go_after: float | None = 0.2
    away: float = 1.0
    """s until the person's hand returns after letting go"""
    offer: float = 0.0
    request: float = 0.0
    """believed intention of the person (offer, request): 0 to 1"""
    pattern: str = "unknown"
    pattern_at: float = 0.0
    """time (s) after the start of the motion at which the pattern is decided"""


class _Request(Pending):
    """One pending request."""

    def __init__(self, cell: ScriptedCell, port: str, name: str, after: float, act: Callable[[], Any]) -> None:
        self._cell, self._port, self._name, self._after, self._act = cell, port, name, after, act
        self._due: float | None = None
        """time (s) at which it acts; None: not sent yet"""
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
        """Send the request if its node answers. Execute it if its time has come."""
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
    """Shared state of the scripted ports. It has no thread: every access advances it to the current time. Tests may
    read and set its attributes at any time."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.faults, self.partner = Faults(), Partner()
        self.calls: list[tuple[float, str]] = []
        """(time in s, name) of each request"""
        self.arm = ScriptedArm(self)
        self.loaded: dict[str, str] = {}
        """loaded controllers: id -> type"""
        self.fade_time = 0.2  # s, fade-out of the previous profile's correction
        self.hand_positions: tuple[int, ...] = (0, 0, 0, 0, 0)
        self.calibrated = False
        self.lifted = 0.0  # N, upward force on the hand
        self.pulled: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
        """force (N) on the hand in the base frame; None: the detector has no value"""
        self.touch: float | None = None
        """grip force (N) per count of squeezing; None: the hand has no touch sensors"""
        self.objects: dict[str, Pose] = {
            "mug": Pose(np.array([0.78, 0.03, 0.43])),
            "board": Pose(np.array([0.45, -0.55, 0.05])),
            "human_hand": Pose(HAND_AT_WORK),
        }
        self.touched: tuple[str, Pose] | None = None
        """like at_palm: the object that the hand touched last, until the hand opens. Closing fingers grasp it again."""
        self.at_palm: tuple[str, Pose] | None = None
        """(object in the hand, pose of the palm relative to it)"""
        self.goes: tuple[float, np.ndarray] | None = None
        """movement of the person's hand: (time in s of its present position, target in m)"""
        self._back: float | None = None
        """time (s) at which the person's hand returns"""
        self._lock = threading.RLock()
        self._requests: list[_Request] = []

    # ---- requests

    def note(self, name: str) -> None:
        """Record a request with its time."""
        self.calls.append((self.clock.now(), name))

    def called(self, prefix: str = "") -> list[str]:
        """Returns the names of the requests so far that begin with ``prefix``."""
        return [name for _, name in self.calls if name.startswith(prefix)]

    def answer(self, port: str, name: str, after: float, act: Callable[[], Any]) -> Pending:
        """Returns a request that acts and is answered ``after`` s after it reached its node. It respects the faults."""
        self.note(name)
        request = _Request(self, port, name, after, act)
        with self._lock:
            self._requests.append(request)
        self.advance()
        return request

    def advance(self) -> None:
        """Process everything that is due at the current time."""
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
        """Joint positions of the arm, rad."""
        self.advance()
        return self.arm.position()

    # ---- person and objects

    def push(self, force: float) -> None:
        """Apply a vertical force (N) to the hand from now on; positive: upward."""
        self.lifted = force

    def pose(self, object_id: str) -> Pose:
        """Returns the pose of an object in the base frame. An object in the hand moves with it."""
        if self.at_palm is None or self.at_palm[0] != object_id:
            return self.objects[object_id]
        return self.palm() * self.at_palm[1].inverse()

    def palm(self) -> Pose:
        """Returns the pose of the robot's palm in the base frame."""
        return Pose(*default_arm().fk(np.asarray(self.arm.position())))

    def bring(self, object_id: str, palm: Pose) -> None:
        """The person brings the object into the robot's hand. ``palm``: pose of the palm relative to the object."""
        self.at_palm = self.touched = object_id, palm
        self.goes = self.clock.now(), self.pose(object_id).position + HAND_AT_OBJECT

    def let_go(self) -> None:
        """The person's hand leaves the object and returns ``partner.away`` s later."""
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
