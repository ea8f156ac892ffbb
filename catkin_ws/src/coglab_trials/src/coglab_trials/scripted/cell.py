"""The kinematic cell behind the simulated ports: state, faults and the partner's script.

A request acts when its time has come, whether or not anybody waits for it, as over ROS: only what could not be sent
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

from coglab_trials.scripted.arm_model import ArmModel

HAND_AT_WORK = np.array([0.86, 0.03, 0.43])
"""m, of the person's hand while something is handed over"""
HAND_AT_OBJECT = np.array([0.08, 0.0, 0.0])
"""m, of it from what it holds"""
HAND_SPEED = 1.0
"""m/s with which it goes away and comes back"""


@dataclass
class Faults:
    """What is broken. Sets of names are compared with the port method that is called."""

    dead: set[str] = field(default_factory=set)
    """ports whose node is frozen: arm, hand, perception, database, contact. What is asked of it acts when it comes
    back, unless it was given up."""
    refuse: dict[str, str | PortError] = field(default_factory=dict)
    """port method -> sentence, or error with its code, with which it refuses"""
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


class _Call(Pending):
    """One request on its way."""

    def __init__(self, cell: SimulatedCell, port: str, method: str, after: float, apply: Callable[[], Any]) -> None:
        self.cell, self.port, self.method, self.after, self.apply = cell, port, method, after, apply
        self.due: float | None = None
        """when it acts; None while it is not sent"""
        self.over = self.given_up = False
        self.value: Any = None
        self.error: PortError | None = None

    def done(self) -> bool:
        self.cell.advance()
        return self.over

    def result(self) -> Any:
        if self.error is not None:
            raise self.error
        return self.value

    def cancel(self) -> None:
        self.given_up = True
        self.cell.note(f"cancel {self.method}")

    def look(self, now: float) -> None:
        """Send it if its node is there, let it act if its time has come."""
        if self.port in self.cell.faults.dead:
            return
        if self.due is None and self.given_up:
            self.over = True
            self.error = PortError("the request was given up before it was sent", code=ReasonCode.CANCELLED)
            return
        if self.due is None:
            self.due = now + self.after
        if now >= self.due:
            self.over = True
            try:
                self.value = self.apply()
            except PortError as error:
                self.error = error


class SimulatedCell:
    """State shared by the simulated ports, advanced by looking at the clock: no thread of its own."""

    def __init__(self, clock: Clock, reach_time: float = 1.3) -> None:
        self.clock = clock
        self.faults = Faults()
        self.partner = Partner()
        self.arm = ArmModel(clock, self.faults)
        self.reach_time = reach_time
        self.calls: list[tuple[float, str]] = []
        self.profile = ""
        self.profile_since = 0.0
        self.fade_time = 0.2
        self.loaded: dict[str, str] = {}
        self.primitives: set[str] = set()
        """those that were loaded"""
        self.hand_positions: tuple[int, ...] = (0, 0, 0, 0, 0)
        self.calibrated = self.preshaped = False
        self.calibrating_until = 0.0
        self.lifted = 0.0
        self.pulled: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
        """N, base frame: somebody pulls at the hand; None: the detector does not tell"""
        self.touch: float | None = None
        """N of grip for each count by which the fingers squeeze what they hold; None: the hand does not feel"""
        self.fingers: Callable[[], tuple[int, ...]] = lambda: self.hand_positions
        self.objects: dict[str, Pose] = {
            "mug": Pose(np.array([0.78, 0.03, 0.43])),
            "board": Pose(np.array([0.45, -0.55, 0.05])),
            "human_hand": Pose(HAND_AT_WORK),
        }
        self.touched: tuple[str, Pose] | None = None
        """as at_palm, what the hand has touched last, until it is opened: fingers that close have it again"""
        self.at_palm: tuple[str, Pose] | None = None
        """what is in the hand, and the palm relative to it"""
        self._lock = threading.RLock()
        self._under_way: list[_Call] = []
        self._back: float | None = None
        """when the person's hand comes back"""
        self._goes: tuple[float, np.ndarray] | None = None
        """s, when it was where it is, and m, to where it goes"""

    def note(self, what: str) -> None:
        """Remember a call with its time."""
        self.calls.append((self.clock.now(), what))

    def push(self, force: float) -> None:
        """Somebody lifts the hand with so many N from now on, or presses it down if negative."""
        self.lifted = force

    def pose(self, object_id: str) -> Pose:
        """Where something is, in the base frame: what is in the hand goes with it."""
        if self.at_palm is None or self.at_palm[0] != object_id:
            return self.objects[object_id]
        return Pose(*default_arm().fk(np.asarray(self.arm.position()))) * self.at_palm[1].inverse()

    def frames(self) -> dict[str, Pose]:
        """All frames that a goal may be given in, in the base frame."""
        seen = {n if n in ("board", "human_hand") else f"object_{n}": self.pose(n) for n in self.objects}
        return {"world": Pose(), "lwr_base_link": Pose(), **seen}

    def bring(self, object_id: str, palm: Pose) -> None:
        """The person's object has come into the robot's hand, and theirs comes with it. ``palm``: relative to it."""
        self.at_palm = self.touched = object_id, palm
        self._goes = self.clock.now(), self.pose(object_id).position + HAND_AT_OBJECT

    def let_go(self) -> None:
        """The person's hand leaves what it has given, and comes back later."""
        self._goes = self.clock.now(), HAND_AT_WORK + [0.3, 0.0, 0.0]
        self._back = self.clock.now() + self.partner.away

    def called(self, prefix: str = "") -> list[str]:
        """Names of the calls so far that begin with ``prefix``."""
        return [what for _, what in self.calls if what.startswith(prefix)]

    def answer(self, port: str, method: str, after: float, apply: Callable[[], Any]) -> Pending:
        """A request that reaches its node, acts ``after`` s later and is answered then; it respects the faults."""
        self.note(method)

        def act() -> Any:
            refusal = self.faults.refuse.get(method)
            if refusal is not None:
                raise refusal if isinstance(refusal, PortError) else PortError(refusal)
            return apply()

        call = _Call(self, port, method, after, act)
        with self._lock:
            self._under_way.append(call)
        self.advance()
        return call

    def advance(self) -> None:
        """Let everything act whose time has come."""
        with self._lock:
            now = self.clock.now()
            for call in list(self._under_way):
                call.look(now)
            self._under_way = [call for call in self._under_way if not call.over]
            self.arm.follow()
            if self._back is not None and now >= self._back:
                self._goes, self._back = (now, np.array(HAND_AT_WORK)), None
            self._move_hand(now)

    def _move_hand(self, now: float) -> None:
        """No hand is elsewhere from one moment to the next."""
        if self._goes is None:
            return
        since, there = self._goes
        here, step = np.asarray(self.objects["human_hand"].position), HAND_SPEED * (now - since)
        way = there - here
        left = float(np.linalg.norm(way))
        self.objects["human_hand"] = Pose(there if left <= step else here + step / left * way)
        self._goes = None if left <= step else (now, there)

    @property
    def joints(self) -> tuple[float, ...]:
        """Where the arm is, rad."""
        self.advance()
        return self.arm.position()
