"""ArmPort of a World: the real controller manager and bridge, in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from coglab_msgs.msg import ReasonCode
from coglab_smach.kinematics.motion_time import MotionLimits, read_limits
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest, Verdict
from coglab_smach.ports.pending import Pending, Polled, PortError, Ready, ending_motion

from coglab_trials.world import World

SILENT = "lwr/joint_states is silent"


class VirtualArm:
    """ArmPort of a World. Requests act at once. A motion goes on until it ends, even if nobody waits for it."""

    def __init__(self, world: World) -> None:
        self.world, self.robot = world, world.robot.virtual
        self.request: DmpRequest | None = None
        self._limits = read_limits(world.robot.parameters)

    def _silent(self, limit: float) -> bool:
        return bool(self.world.robot.silent > limit)

    def _answered(self, answer: Sequence[Any], value: Any = None) -> Pending:
        """Converts the (success, message) of a controller to a Pending."""
        return Ready(value) if answer[0] else Ready(error=PortError(answer[1], code=self.robot.reason_code))

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        if self.world.robot.loaded.get(controller_id) == controller_type:
            return Ready()
        answer = self.robot.load_controller(controller_id, controller_type)
        done = self._answered(answer)
        if answer[0]:
            self.world.robot.loaded[controller_id] = controller_type
        if controller_id == "dmp":
            self.robot.set_ik_debug(True)
        return done

    def load_dmps(self, filename: str) -> Pending:
        answer = self.robot.load_dmps(filename)
        return self._answered(answer, answer[2])

    def lwr_command(self, event: str) -> Pending:
        try:
            ticket = self.robot.submit(event)
            outcome: list[tuple[bool, str, int]] = []
        except ValueError as error:
            return Ready(error=PortError(str(error), code=ReasonCode.UNKNOWN_NAME))

        def done() -> bool:
            if not outcome:
                answer = self.robot.outcome(ticket)
                if answer is not None:
                    outcome.append(answer)
            return bool(outcome)

        def value() -> str:
            good, message, code = outcome[0]
            if not good:
                raise PortError(f"LWR command '{event}' failed: {message}", code=code)
            return message

        return Polled(done, value)

    def motion_allowed(self) -> Verdict:
        if self._silent(1.0):
            return Verdict(False, SILENT, ReasonCode.NODE_SILENT)
        report = self.world.robot.report
        return Verdict(report["motion_allowed"], report["blocked_by"], report["blocked_code"])

    def standing(self) -> Verdict:
        if self._silent(1.0):
            return Verdict(False, SILENT, ReasonCode.NODE_SILENT)
        standing = self.world.robot.report["standing"]
        return Verdict(standing, "" if standing else "the set-point moves")

    def cancel_motion(self, reason: str) -> Pending:
        """The request is never withdrawn: it stays in force if the caller stops waiting."""
        begun = self.world.t
        answers: dict[str, dict[str, Any]] = {}
        orders = {name: self.robot.ask_cancel(name, reason) for name in self.world.robot.loaded}

        def done() -> bool:
            waited = self.world.t - begun
            for name, order in orders.items():
                answer = self.robot.cancel_outcome(order, waited if waited > 2.0 else 0.0)
                if name not in answers and answer is not None:
                    answers[name] = answer
            return len(answers) == len(orders)

        def value() -> None:
            for answer in answers.values():
                if not answer["success"] and answer["reason_code"] != ReasonCode.NOT_ACTIVE:
                    raise PortError(answer["message"], code=answer["reason_code"])

        return Polled(done, value)

    def motion_limits(self) -> MotionLimits:
        return self._limits

    def speed_scale(self) -> float:
        return float(self.world.speed_scale)

    def switch_controller(self, controller_id: str) -> Pending:
        answer = self.robot.switch_controller(controller_id)
        return self._answered(answer, self.world.robot.loaded.get(controller_id))

    def apply_profile(self, profile: str) -> Pending:
        return self._answered(self.robot.apply_profile(profile))

    def profile_settled(self, profile: str) -> Verdict:
        now = self.robot.feedback_status()
        if now["profile"] != profile:
            return Verdict(False, f"profile '{now['profile']}' is in force")
        others = [c for c in now["controllers"] if not c["enabled"]]
        busy = [f"{c['name']} is {c['activity']}" for c in others if c["activity"] != "off"]
        return Verdict(not busy, ", ".join(busy))

    def execute_dmp(self, request: DmpRequest) -> Pending:
        self.request = request
        self.world.robot.debug = None
        limits = (request.goal_region_low, request.goal_region_high, request.goal_retreat, request.goal_drop)
        fields = (*self._fields(request), request.goal_frame, *limits, request.goal_approach, request.arrival_speed)
        return ending_motion(self._answered(self.robot.execute_dmp(*fields)), self.cancel_motion)

    def switch_dmp(self, request: DmpRequest) -> Pending:
        return self._answered(self.robot.switch_dmp(*self._fields(request)))

    @staticmethod
    def _fields(request: DmpRequest) -> tuple[Any, ...]:
        return (
            request.primitive_id,
            request.dmp_ratio,
            list(request.goal_offset),
            request.orientation_control,
            list(request.target_orientation),
        )

    def dmp_progress(self) -> DmpProgress:
        now = self.robot.dmp_progress()
        return DmpProgress(
            now["motion"],
            now["reason"],
            now["primitive"],
            now["phase"],
            now["remaining_distance"],
            now["reason_code"],
            now["remaining_time"],
        )

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        return ending_motion(self._add(list(position), list(max_velocity)), self.cancel_motion)

    def _add(self, position: list[float], max_velocity: list[float]) -> Pending:
        status, identity, message = self.robot.add_ptp(position, max_velocity)
        if status == 2:
            return Ready(error=PortError(f"add_ptp refused: {message}", code=self.robot.reason_code))
        ended: list[PortError | None] = []

        def done() -> bool:
            if not ended:
                ended.extend(self._end_of_ptp(identity))
            return bool(ended)

        def value() -> None:
            if ended[0] is not None:
                raise ended[0]

        return Polled(done, value)

    def _end_of_ptp(self, identity: int) -> list[PortError | None]:
        robot = self.world.robot
        end, allowed = robot.ended.get(identity), self.motion_allowed()
        if end is not None and end["executed"]:
            return [None]
        if end is not None:
            return [
                PortError("the point-to-point motion ended before its target", (end["reason"],), end["reason_code"])
            ]
        if robot.report["fault"]:
            return [PortError("the point-to-point motion ended in a fault", (robot.report["reason"],))]
        return [] if allowed.ok else [PortError("the arm does not follow any more", (allowed.why,), allowed.code)]

    def joint_positions(self) -> tuple[float, ...] | None:
        return None if self._silent(0.5) else tuple(self.world.robot.report["position"])

    def hold(self, reason: str) -> Pending:
        return self.lwr_command("hold")
