"""The arm of the kinematic cell: seven joints, their motions, and the controllers that drive them.

A motion goes on until its end, whoever waits for it; it ends before only by cancelling, a switch, a hold, an abort or
the loss of command mode, and then the arm brakes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_smach.clocks.clock import Clock
from coglab_smach.kinematics.motion_time import MotionLimits, ptp_time, read_limits
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest
from coglab_smach.ports.pending import PortError

from coglab_trials.scripted.arm_requests import check_ptp

REACH = np.array([0.9, -0.5, 0.3, -0.4, 0.5, -0.6, 0.4])
"""rad, what a reach of the model adds to the posture it starts from; and back, from where it has ended"""
REACH_WAY = 0.45
"""m"""


@dataclass
class _Ptp:
    identity: int
    target: np.ndarray
    max_velocity: Sequence[float]


class ArmModel:
    """Minimum-jerk profiles, braking at constant deceleration. Times in s on the cell's clock, angles in rad."""

    def __init__(self, clock: Clock, faults: Any) -> None:
        self._clock, self._faults = clock, faults
        self.limits: MotionLimits = read_limits({})
        self.speed_scale = 1.0
        self.active = ""
        self.enabled = False
        self.held = False
        self.reach_time = 1.3
        self._start = self._end = np.full(7, 0.3)
        self._t0 = self._duration = 0.0
        self._braking = False
        self._reached_out = False
        self._next_id = 0
        self._running: _Ptp | None = None
        self._queue: list[_Ptp] = []
        self._ended: dict[int, PortError | None] = {}
        self.request: DmpRequest | None = None
        self.dmp = DmpProgress()
        self.motion_started: float | None = None
        """when the DMP motion began that runs now or has ended last; None: none since the last switch"""

    # ---- kinematics

    def _share(self) -> tuple[float, float]:
        """(way covered 0..1, its rate 1/s) now."""
        if self._duration <= 0.0:
            return 1.0, 0.0
        s = (self._clock.now() - self._t0) / self._duration
        if s >= 1.0:
            return 1.0, 0.0
        if self._braking:
            return 2.0 * s - s * s, 2.0 * (1.0 - s) / self._duration
        return s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) ** 2 / self._duration

    def position(self) -> tuple[float, ...]:
        """Seven joints, rad."""
        share = self._share()[0]
        return tuple(float(v) for v in (self._end if share >= 1.0 else self._start + share * (self._end - self._start)))

    def velocity(self) -> np.ndarray:
        """True velocity of the seven joints, rad/s."""
        return self._share()[1] * (self._end - self._start)

    def _go(self, target: np.ndarray, duration: float) -> None:
        self._start, self._end = np.array(self.position()), np.asarray(target, dtype=float)
        self._t0, self._duration, self._braking = self._clock.now(), duration / max(self.speed_scale, 1e-3), False

    def brake(self) -> None:
        """From the present velocity to rest, at the limits' deceleration."""
        velocity = self.velocity()
        if self._braking or not np.any(velocity):
            return
        duration = float(np.max(np.abs(velocity) / np.asarray(self.limits.acceleration)))
        here = np.array(self.position())
        self._start, self._end = here, here + 0.5 * duration * velocity
        self._t0, self._duration, self._braking = self._clock.now(), duration, True

    def standing(self) -> bool:
        """Whether no joint moves."""
        return not np.any(self.velocity())

    # ---- motions

    def follow(self) -> None:
        """What has happened since the last look: a motion at its end, a block, an abort."""
        if "arm" in self._faults.dead:
            self.enabled = False  # without answers the robot controller brakes and leaves command mode
        why, code = self.blocked()
        if code:
            self.end(f"the robot stopped the motion: {why}", code)
        over = self._clock.now() >= self._t0 + self._duration
        if self._running is not None and over:
            self._ended[self._running.identity] = None
            self._running = self._queue.pop(0) if self._queue else None
            if self._running is not None:
                self._begin(self._running)
        if self.dmp.state == "running":
            self._follow_dmp(over)

    def _follow_dmp(self, over: bool) -> None:
        faults = self._faults
        assert self.motion_started is not None and self.request is not None
        if faults.abort_dmp_after and self._clock.now() - self.motion_started >= faults.abort_dmp_after:
            self.end(faults.abort_reason, ReasonCode.GOAL_LOST)
            return
        share = self._share()[0]
        self.dmp = DmpProgress(
            "reached" if over else "running",
            "",
            self.request.primitive_id,
            phase=1.0 - share,
            remaining_distance=REACH_WAY * (1.0 - share),
            remaining_time=(1.0 - share) * self.reach_time * self.request.dmp_ratio,
        )
        self._reached_out = self._reached_out or over

    def blocked(self) -> tuple[str, int]:
        """Why the arm may not move, and its code; 0 if it may."""
        if self._faults.arm_disabled:
            return self._faults.arm_disabled, ReasonCode.NOT_IN_COMMAND_MODE
        if self.held:
            return "hold is latched; reset first", ReasonCode.HELD
        return ("", 0) if self.enabled else ("command mode was not asked for", ReasonCode.NOT_STARTED)

    def end(self, reason: str, code: int) -> bool:
        """End what runs and what waits; the arm brakes. Whether there was anything."""
        unfinished = ([self._running] if self._running is not None else []) + self._queue
        for motion in unfinished:
            self._ended[motion.identity] = PortError(
                "the point-to-point motion ended before its target", (reason,), code
            )
        self._running, self._queue = None, []
        ran = bool(unfinished) or self.dmp.state == "running"
        if self.dmp.state == "running":
            self.dmp = DmpProgress(
                "aborted", reason, self.dmp.primitive_id, self.dmp.phase, self.dmp.remaining_distance, code
            )
        self.brake()
        return ran

    def switch(self, controller_id: str) -> None:
        """Another controller drives the arm from now on."""
        if controller_id != self.active:
            self.end("ended by a switch to another controller", ReasonCode.SWITCHED)
            self.motion_started = None
        self.active = controller_id

    def add_ptp(self, target: Sequence[float], max_velocity: Sequence[float]) -> int:
        """Begin or queue a motion; its id. PortError as add_ptp refuses."""
        self.require("ptp")
        check_ptp(target, max_velocity, self.limits.velocity)
        motion = _Ptp(self._next_id, np.asarray(target, dtype=float), max_velocity)
        self._next_id += 1
        if self._running is None:
            self._begin(motion)
        else:
            self._queue.append(motion)
        return motion.identity

    def _begin(self, motion: _Ptp) -> None:
        self._running = motion
        self._go(motion.target, ptp_time(self.limits, self.position(), list(motion.target), motion.max_velocity))
        self._reached_out = False

    def ended(self, identity: int) -> tuple[PortError | None] | None:
        """How a motion has ended; None while it runs or waits."""
        return (self._ended[identity],) if identity in self._ended else None

    def execute(self, request: DmpRequest) -> None:
        """Begin a reach: out from where the arm is, or back if it is out already."""
        way = -REACH if self._reached_out else REACH
        # 1.875: peak over mean velocity of a minimum-jerk profile.
        slow = 1.875 * float(np.max(np.abs(way) / np.asarray(self.limits.velocity)))
        self.request, self.motion_started = request, self._clock.now()
        asked = self.reach_time * request.dmp_ratio
        self.dmp = DmpProgress("running", "", request.primitive_id, 1.0, REACH_WAY, remaining_time=asked)
        self._go(np.array(self.position()) + way, max(asked, slow))
        self._reached_out = False

    def substitute(self, request: DmpRequest) -> None:
        """Another primitive for the running motion."""
        if self.dmp.state != "running":
            raise PortError("switch_dmp refused: no motion runs", code=ReasonCode.NOTHING_RUNS)
        self.request = request

    def require(self, controller_id: str) -> None:
        """PortError where this controller may not move the arm now."""
        if self.active != controller_id:
            raise PortError(
                f"refused: '{self.active}' is the active controller, not '{controller_id}'", code=ReasonCode.NOT_ACTIVE
            )
        why, code = self.blocked()
        if code:
            raise PortError(f"refused: {why}", code=code)
