"""The kinematic cell behind the simulated ports: state, faults and the partner's script."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .clock import Clock
from .pending import Pending, Polled, PortError, Ready
from .pose import Pose


@dataclass
class Faults:
    """What is broken. Sets of names are compared with the port method that is called."""

    dead: set[str] = field(default_factory=set)
    """ports that never answer: arm, hand, perception, database, contact"""
    refuse: dict[str, str] = field(default_factory=dict)
    """port method -> sentence with which it refuses"""
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
    pattern: str = "unknown"
    pattern_at: float = 0.0
    """s into the motion at which the pattern is decided"""


class SimulatedCell:
    """State shared by the simulated ports, advanced by looking at the clock: no thread of its own."""

    def __init__(self, clock: Clock, reach_time: float = 1.3, ptp_time: float = 1.0) -> None:
        self.clock = clock
        self.faults = Faults()
        self.partner = Partner()
        self.reach_time = reach_time
        self.ptp_time = ptp_time
        self.calls: list[tuple[float, str]] = []
        self.active = ""
        self.profile = ""
        self.profile_since = 0.0
        self.fade_time = 0.2
        self.loaded: dict[str, str] = {}
        self.primitives = {"reach_human", "reach_human_high", "give_human", "take_board", "put_board"}
        self.enabled = False
        self.held = False
        self.joints = tuple([0.3] * 7)
        self.reached_at: float | None = None
        self.motion_started: float | None = None
        self.hand_positions = (0, 0, 0, 0, 0)
        self.preshaped = False
        self.objects: dict[str, Pose] = {"mug": Pose(np.array([0.78, 0.03, 0.43])),
                                         "board": Pose(np.array([0.45, -0.55, 0.05])),
                                         "human_hand": Pose(np.array([0.86, 0.03, 0.43]))}

    def note(self, what: str) -> None:
        """Remember a call with its time."""
        self.calls.append((self.clock.now(), what))

    def called(self, prefix: str = "") -> list[str]:
        """Names of the calls so far that begin with ``prefix``."""
        return [what for _, what in self.calls if what.startswith(prefix)]

    def answer(self, port: str, method: str, after: float, value: Callable[[], Any]) -> Pending:
        """A pending answer that respects the faults."""
        self.note(method)
        if port in self.faults.dead:
            return Polled(lambda: False, lambda: None)
        if method in self.faults.refuse:
            return Ready(error=PortError(self.faults.refuse[method]))
        due = self.clock.now() + after
        cancelled = [False]

        def ready() -> bool:
            return self.clock.now() >= due and port not in self.faults.dead

        def cancel() -> None:
            cancelled[0] = True
            self.note(f"cancel {method}")

        return Polled(ready, value, cancel)
