"""The scripted arm: seven joints that go straight to their targets with minimum jerk, one motion at a time.

It is no model of the controllers: what the real ones do is tested with VirtualArm. A motion goes on until its end, even
if nobody waits for it. Only a cancel, a switch, a hold, an abort, another motion or the loss of command mode ends it
earlier. Times in s on the cell's clock, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_smach.kinematics.motion_time import MotionLimits, ptp_time, read_limits
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest, Verdict
from coglab_smach.ports.pending import Pending, Polled, PortError, ending_motion

if TYPE_CHECKING:
    from coglab_trials.scripted.cell import ScriptedCell

REACH = np.array([0.9, -0.5, 0.3, -0.4, 0.5, -0.6, 0.4])  # rad, added to the joints by a reach; subtracted on return
REACH_LENGTH = 0.45  # m
BRAKING = 0.1  # s
SILENT = Verdict(False, "/lwr/state is silent", ReasonCode.NODE_SILENT)


class ScriptedArm:
    """ArmPort of a ScriptedCell."""

    def __init__(self, cell: ScriptedCell) -> None:
        self._cell = cell
        self.limits: MotionLimits = read_limits({})
        self.scale = 1.0  # speed scale, no unit
        self.reach_time = 1.3
        self.active = ""
        self.enabled = self.held = False
        self.profile, self.profile_since = "", 0.0
        self.request: DmpRequest | None = None
        self.dmp = self._heard = DmpProgress()
        self.motion_started: float | None = None
        """start (s) of the running or the last DMP motion; None: no motion since the last switch"""
        self._start = self._end = np.full(7, 0.3)
        self._t0 = self._duration = 0.0
        self._reached_out = False
        self._ptp: list[PortError] | None = None
        """the running point-to-point motion: the reason of its early end, if any"""

    # ---- position and velocity

    def _time_share(self) -> float:
        """Returns the share of the motion's duration that is over."""
        return min(1.0, (self._cell.clock.now() - self._t0) / self._duration) if self._duration > 0.0 else 1.0

    def _left(self) -> float:
        """Returns the share of the path that is left."""
        s = self._time_share()
        return 1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s * s)

    def position(self) -> tuple[float, ...]:
        """Returns the true joint positions, rad."""
        left = self._left()
        return tuple(map(float, left * self._start + (1.0 - left) * self._end))

    def velocity(self) -> np.ndarray:
        """Returns the true joint velocities, rad/s."""
        s = self._time_share()
        return 30.0 * (s * (1.0 - s)) ** 2 / max(self._duration, 1e-9) * (self._end - self._start)

    def _go(self, target: np.ndarray, duration: float) -> None:
        self._start, self._end = np.array(self.position()), np.asarray(target, dtype=float)
        self._t0, self._duration = self._cell.clock.now(), duration

    # ---- motions

    def follow(self) -> None:
        """Process what has happened since the last call: end of a motion, a block, an abort."""
        if "arm" in self._cell.faults.dead:
            self.enabled = False  # without answers the robot controller brakes and leaves command mode
        why, code = self._blocked()
        if code:
            self.end(f"the robot stopped the motion: {why}", code)
        over = self._time_share() >= 1.0
        if over:
            self._ptp = None
        if self.dmp.state == "running":
            self._follow_dmp(over)

    def _follow_dmp(self, over: bool) -> None:
        faults = self._cell.faults
        assert self.motion_started is not None and self.request is not None
        if faults.abort_dmp_after and self._cell.clock.now() - self.motion_started >= faults.abort_dmp_after:
            self.end(faults.abort_reason, ReasonCode.GOAL_LOST)
            return
        left = self._left()
        self.dmp = DmpProgress(
            "reached" if over else "running",
            primitive_id=self.request.primitive_id,
            phase=left,
            remaining_distance=REACH_LENGTH * left,
            remaining_time=left * self.reach_time * self.request.dmp_ratio,
        )
        self._reached_out = self._reached_out or over

    def _blocked(self) -> tuple[str, int]:
        """Returns the reason why the arm may not move, and its code; code 0 if it may."""
        if self._cell.faults.arm_disabled:
            return self._cell.faults.arm_disabled, ReasonCode.NOT_IN_COMMAND_MODE
        if self.held:
            return "hold is latched; reset first", ReasonCode.HELD
        return ("", 0) if self.enabled else ("command mode was not asked for", ReasonCode.NOT_STARTED)

    def end(self, reason: str, code: int) -> None:
        """End the running motion. The arm stands BRAKING s later."""
        if self._ptp is None and self.dmp.state != "running":
            return
        if self._ptp is not None:
            self._ptp.append(PortError("the point-to-point motion ended before its target", (reason,), code))
            self._ptp = None
        else:
            self.dmp = replace(self.dmp, state="aborted", reason=reason, code=code, remaining_time=0.0)
        self._go(np.array(self.position()) + 0.5 * BRAKING * self.velocity(), BRAKING)

    def _require(self, controller_id: str) -> None:
        """PortError if this controller may not move the arm now."""
        if self.active != controller_id:
            raise PortError(f"refused: '{self.active}' is the active controller", code=ReasonCode.NOT_ACTIVE)
        why, code = self._blocked()
        if code:
            raise PortError(f"refused: {why}", code=code)

    # ---- ArmPort

    def _ask(self, method: str, after: float, act: Callable[[], Any]) -> Pending:
        return self._cell.answer("arm", method, after, act)

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        return self._ask("load_controller", 0.1, lambda: self._cell.loaded.update({controller_id: controller_type}))

    def load_dmps(self, filename: str) -> Pending:
        return self._ask("load_dmps", 0.1, lambda: 5)

    def lwr_command(self, event: str) -> Pending:
        def act() -> str:
            if event == "start" and self.held:
                raise PortError("'start' refused: hold is latched; send reset first", code=ReasonCode.HELD)
            self.enabled = event == "start" or (self.enabled and event != "stop")
            self.held = event == "hold" or (self.held and event != "reset")
            return event

        return self._ask(f"lwr {event}", 0.05, act)

    def hold(self, reason: str) -> Pending:
        return self.lwr_command("hold")

    def _silent(self) -> bool:
        self._cell.advance()
        return "arm" in self._cell.faults.dead

    def motion_allowed(self) -> Verdict:
        if self._silent():
            return SILENT
        why, code = self._blocked()
        return Verdict(not code, why, code)

    def standing(self) -> Verdict:
        if self._silent():
            return SILENT
        standing = not np.any(self.velocity())
        return Verdict(standing, "" if standing else "the arm moves")

    def cancel_motion(self, reason: str) -> Pending:
        asked = self._ask("cancel", 0.02, lambda: self.end(reason, ReasonCode.CANCELLED))
        # Never withdrawn: the cancel stays in force if the caller stops waiting.
        return Polled(lambda: asked.done() and self.standing().ok, asked.result)

    def motion_limits(self) -> MotionLimits:
        return self.limits

    def speed_scale(self) -> float:
        return self.scale

    def switch_controller(self, controller_id: str) -> Pending:
        def act() -> str:
            if controller_id not in self._cell.loaded:
                raise PortError(f"controller '{controller_id}' is not loaded", code=ReasonCode.UNKNOWN_NAME)
            if controller_id != self.active:
                self.end("ended by a switch to another controller", ReasonCode.SWITCHED)
                self.motion_started = None
            self.active = controller_id
            self._begin_profile(controller_id)  # a switch also applies the profile of the same name
            return self._cell.loaded[controller_id]

        return self._ask(f"switch {controller_id}", 0.02, act)

    def apply_profile(self, profile: str) -> Pending:
        return self._ask(f"profile {profile}", 0.01, lambda: self._begin_profile(profile))

    def _begin_profile(self, profile: str) -> None:
        self.profile, self.profile_since = profile, self._cell.clock.now()

    def fading(self) -> bool:
        """True while a correction of the previous profile is fading out."""
        return self._cell.clock.now() - self.profile_since < self._cell.fade_time

    def profile_settled(self, profile: str) -> Verdict:
        if self.profile != profile:
            return Verdict(False, f"profile '{self.profile}' is in force")
        return Verdict(False, "ee_admittance is stopping") if self.fading() else Verdict(True)

    def execute_dmp(self, request: DmpRequest) -> Pending:
        """Reach out from the current posture, or return if the arm is already out."""

        def act() -> None:
            self._require("dmp")
            way = -REACH if self._reached_out else REACH
            # 1.875: ratio of peak to mean velocity of a minimum-jerk profile.
            slow = 1.875 * float(np.max(np.abs(way) / np.asarray(self.limits.velocity)))
            asked = self.reach_time * request.dmp_ratio
            self.request, self.motion_started = request, self._cell.clock.now()
            self.dmp = DmpProgress("running", "", request.primitive_id, 1.0, REACH_LENGTH, remaining_time=asked)
            self._go(np.array(self.position()) + way, max(asked, slow) / max(self.scale, 1e-3))
            self._reached_out = False

        return ending_motion(self._ask("execute_dmp", 0.02, act), self.cancel_motion)

    def switch_dmp(self, request: DmpRequest) -> Pending:
        def act() -> None:
            if self.dmp.state != "running":
                raise PortError("switch_dmp refused: no motion runs", code=ReasonCode.NOTHING_RUNS)
            self.request = request

        return self._ask(f"switch_dmp {request.primitive_id}", 0.02, act)

    def dmp_progress(self) -> DmpProgress:
        if not self._silent():
            self._heard = self.dmp
        return self._heard

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        motion: list[PortError] = []

        def act() -> None:
            self._require("ptp")
            self.end("another motion began", ReasonCode.SUPERSEDED)
            duration = ptp_time(self.limits, self.position(), list(position), max_velocity)
            self._go(np.asarray(position), duration / max(self.scale, 1e-3))
            self._ptp, self._reached_out = motion, False

        added = self._ask("move_ptp", 0.02, act)

        def value() -> None:
            added.result()
            if motion:
                raise motion[0]

        over = Polled(lambda: added.done() and self._ptp is not motion, value, added.cancel)
        return ending_motion(over, self.cancel_motion)

    def joint_positions(self) -> tuple[float, ...] | None:
        return None if self._silent() else self.position()
