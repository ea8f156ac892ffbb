"""The arm of the kinematic cell behind its port: what it takes and refuses is what the controller manager does."""

from __future__ import annotations

from collections.abc import Sequence

from coglab_msgs.msg import ReasonCode
from coglab_smach.kinematics.motion_time import MotionLimits
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest, Verdict
from coglab_smach.ports.pending import Pending, Polled, PortError, ending_motion

from coglab_trials.scripted.arm_requests import (
    PROFILES,
    check_goal,
    check_load,
    check_primitive,
    check_profile,
    read_library,
)
from coglab_trials.scripted.cell import SimulatedCell


class SimulatedArm:
    """ArmPort of the kinematic cell."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self._progress = DmpProgress()

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        def apply() -> None:
            if self.cell.loaded.get(controller_id) != controller_type:
                check_load(controller_id, controller_type, self.cell.loaded)
            self.cell.loaded[controller_id] = controller_type

        return self.cell.answer("arm", "load_controller", 0.1, apply)

    def load_dmps(self, filename: str) -> Pending:
        def apply() -> int:
            ids = read_library(filename)
            self.cell.primitives.update(ids)
            return len(ids)

        return self.cell.answer("arm", "load_dmps", 0.1, apply)

    def lwr_command(self, event: str) -> Pending:
        def apply() -> str:
            arm = self.cell.arm
            if event == "start" and arm.held:
                raise PortError("'start' refused: hold is latched; send reset first", code=ReasonCode.HELD)
            if event not in ("start", "hold", "reset", "stop", "position"):
                raise PortError(f"event '{event}' is not known", code=ReasonCode.UNKNOWN_NAME)
            arm.enabled = event == "start" or (arm.enabled and event != "stop")
            arm.held = event == "hold" or (arm.held and event != "reset")
            return event

        return self.cell.answer("arm", f"lwr {event}", 0.05, apply)

    def _here(self) -> bool:
        self.cell.advance()
        return "arm" not in self.cell.faults.dead

    def motion_allowed(self) -> Verdict:
        if not self._here():
            return Verdict(False, "/lwr/state is silent", ReasonCode.NODE_SILENT)
        why, code = self.cell.arm.blocked()
        return Verdict(code == ReasonCode.NONE, why, code)

    def standing(self) -> Verdict:
        if not self._here():
            return Verdict(False, "/lwr/state is silent", ReasonCode.NODE_SILENT)
        standing = self.cell.arm.standing()
        return Verdict(standing, "" if standing else "the arm moves")

    def cancel_motion(self, reason: str) -> Pending:
        arm = self.cell.arm
        asked = self.cell.answer("arm", "cancel", 0.02, lambda: arm.end(reason, ReasonCode.CANCELLED))
        # Never withdrawn: whoever gives up waiting leaves it in force.
        return Polled(lambda: asked.done() and self.standing().ok, lambda: asked.result() and None)

    def motion_limits(self) -> MotionLimits:
        return self.cell.arm.limits

    def speed_scale(self) -> float:
        return self.cell.arm.speed_scale

    def switch_controller(self, controller_id: str) -> Pending:
        def apply() -> str:
            if controller_id not in self.cell.loaded:
                raise PortError(f"controller '{controller_id}' is not loaded", code=ReasonCode.UNKNOWN_NAME)
            self.cell.arm.switch(controller_id)
            # As the controller manager does: the profile of the motion controller's name comes with it.
            if controller_id in PROFILES:
                self._begin_profile(controller_id)
            return self.cell.loaded[controller_id]

        return self.cell.answer("arm", f"switch {controller_id}", 0.02, apply)

    def apply_profile(self, profile: str) -> Pending:
        def apply() -> None:
            check_profile(profile)
            self._begin_profile(profile)

        return self.cell.answer("arm", f"profile {profile}", 0.01, apply)

    def _begin_profile(self, profile: str) -> None:
        self.cell.profile, self.cell.profile_since = profile, self.cell.clock.now()

    def profile_settled(self, profile: str) -> Verdict:
        cell = self.cell
        if cell.profile != profile:
            return Verdict(False, f"profile '{cell.profile}' is in force")
        faded = cell.clock.now() - cell.profile_since >= cell.fade_time
        return Verdict(faded, "" if faded else "ee_admittance is stopping")

    def execute_dmp(self, request: DmpRequest) -> Pending:
        def apply() -> None:
            self.cell.arm.require("dmp")
            check_primitive(request, self.cell.primitives)
            check_goal(request, self.cell.frames())
            self.cell.arm.execute(request)

        return ending_motion(self.cell.answer("arm", "execute_dmp", 0.02, apply), self.cancel_motion)

    def switch_dmp(self, request: DmpRequest) -> Pending:
        def apply() -> None:
            self.cell.arm.require("dmp")
            check_primitive(request, self.cell.primitives)
            self.cell.arm.substitute(request)

        return self.cell.answer("arm", f"switch_dmp {request.primitive_id}", 0.02, apply)

    def dmp_progress(self) -> DmpProgress:
        if self._here():
            self._progress = self.cell.arm.dmp
        return self._progress

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        arm = self.cell.arm
        added = self.cell.answer("arm", "move_ptp", 0.02, lambda: arm.add_ptp(position, max_velocity))
        ended: list[PortError | None] = []

        def finished() -> bool:
            if not ended and added.done():
                ended.extend(self._end_of_ptp(added) or ())
            return bool(ended)

        def value() -> None:
            if ended[0] is not None:
                raise ended[0]

        return ending_motion(Polled(finished, value, added.cancel), self.cancel_motion)

    def _end_of_ptp(self, added: Pending) -> tuple[PortError | None] | None:
        try:
            end = self.cell.arm.ended(added.result())
        except PortError as error:
            return (error,)
        allowed = self.motion_allowed()
        if end is None and not allowed.ok:
            return (PortError("the arm does not follow any more", (allowed.why,), allowed.code),)
        return end

    def joint_positions(self) -> tuple[float, ...] | None:
        return self.cell.joints if self._here() else None

    def hold(self, reason: str) -> Pending:
        return self.lwr_command("hold")
