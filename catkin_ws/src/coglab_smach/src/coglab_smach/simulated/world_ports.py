"""The ports of the machines on the virtual world: the real controllers and bridge, the hand's driver on its emulator.

The world is coglab_sim.virtual_world.World; it is given, so that nothing here imports the simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import ih2_hand.progress as progress
import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import ObjectDatabase, ObjectError

from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.kinematics.manager_limits import read_limits
from coglab_smach.kinematics.motion_time import MotionLimits
from coglab_smach.ports.interfaces import (
    ContactEvent,
    DmpProgress,
    DmpRequest,
    HandState,
    Located,
    Recognition,
    Verdict,
)
from coglab_smach.ports.pending import Pending, Polled, PortError, Ready


def answered(good: bool, message: str, code: int = 0, value: Any = None) -> Pending:
    """(success, message) of a controller as a Pending."""
    return Ready(value) if good else Ready(error=PortError(message, code=code))


class VirtualArm:
    """ArmPort on the virtual world: the real controller manager and bridge. Requests act at once; motions go on until
    they end, whoever waits."""

    def __init__(self, rig: Any) -> None:
        self.rig, self.robot = rig, rig.robot.virtual
        self.request: DmpRequest | None = None
        self._limits = read_limits(rig.robot.parameters)

    def _answered(self, answer: Sequence[Any], value: Any = None) -> Pending:
        return answered(answer[0], answer[1], self.robot.reason_code, value)

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        if self.rig.robot.loaded.get(controller_id) == controller_type:
            return Ready()
        answer = self.robot.load_controller(controller_id, controller_type)
        done = self._answered(answer)
        if answer[0]:
            self.rig.robot.loaded[controller_id] = controller_type
        if controller_id == "dmp":
            self.robot.set_ik_debug(True)
        return done

    def load_dmps(self, filename: str) -> Pending:
        answer = self.robot.load_dmps(filename)
        return self._answered(answer, answer[2])

    def lwr_command(self, event: str) -> Pending:
        try:
            ticket = self.robot.submit(event)
            outcome: list[tuple[bool, str]] = []
        except ValueError as error:
            return Ready(error=PortError(str(error), code=ReasonCode.UNKNOWN_NAME))

        def done() -> bool:
            if not outcome:
                answer = self.robot.outcome(ticket)
                if answer is not None:
                    outcome.append(answer)
            return bool(outcome)

        def value() -> str:
            good, message = outcome[0]
            if not good:
                raise PortError(f"LWR command '{event}' failed: {message}")
            return message

        return Polled(done, value)

    def motion_allowed(self) -> Verdict:
        report = self.rig.robot.report
        return Verdict(report["motion_allowed"], report["blocked_by"])

    def standing(self) -> Verdict:
        standing = self.rig.robot.report["standing"]
        return Verdict(standing, "" if standing else "the set-point moves")

    def cancel_motion(self, reason: str) -> Pending:
        begun = self.rig.t
        answers: dict[str, dict[str, Any]] = {}
        orders = {name: self.robot.ask_cancel(name, reason) for name in self.rig.robot.loaded}

        def done() -> bool:
            waited = self.rig.t - begun
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
        return float(self.rig.speed_scale)

    def switch_controller(self, controller_id: str) -> Pending:
        return self._answered(self.robot.switch_controller(controller_id), self.rig.robot.loaded.get(controller_id))

    def execute_dmp(self, request: DmpRequest) -> Pending:
        self.request = request
        self.rig.robot.debug = None
        limits = (request.goal_region_low, request.goal_region_high, request.goal_retreat, request.goal_drop)
        answer = self.robot.execute_dmp(*self._fields(request), request.goal_frame, *limits)
        return self._ends_motion(self._answered(answer))

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

    def _ends_motion(self, pending: Pending) -> Pending:
        def cancel() -> None:
            self.cancel_motion("its owner has given up waiting")

        return Polled(pending.done, pending.result, cancel)

    def dmp_progress(self) -> DmpProgress:
        now = self.robot.dmp_progress()
        return DmpProgress(
            now["motion"], now["reason"], now["primitive"], now["phase"], now["remaining_distance"], now["reason_code"]
        )

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        status, identity, message = self.robot.add_ptp(list(position), list(max_velocity))
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

        return self._ends_motion(Polled(done, value))

    def _end_of_ptp(self, identity: int) -> list[PortError | None]:
        robot = self.rig.robot
        end, allowed = robot.ended.get(identity), self.motion_allowed()
        if end is not None and end["executed"]:
            return [None]
        if end is not None:
            return [
                PortError("the point-to-point motion ended before its target", (end["reason"],), end["reason_code"])
            ]
        if robot.report["fault"]:
            return [PortError("the point-to-point motion ended in a fault", (robot.report["reason"],))]
        return [] if allowed.ok else [PortError("the arm does not follow any more", (allowed.why,))]

    def joint_positions(self) -> tuple[float, ...] | None:
        return tuple(self.rig.robot.report["position"])

    def hold(self, reason: str) -> Pending:
        return self.lwr_command("hold")


class VirtualHand:
    """HandPort on the virtual world."""

    def __init__(self, rig: Any) -> None:
        self.rig = rig

    def _task(self, task: Any) -> Pending:
        hand = self.rig.hand
        if hand.dead:
            return Polled(lambda: False, lambda: None)
        try:
            hand.begin(task)
        except Exception as error:
            return Ready(error=PortError(str(error), code=getattr(error, "reason", 0)))

        cancelled: list[bool] = []

        def value() -> None:
            if cancelled:
                raise PortError(f"{task.name} was cancelled", code=ReasonCode.CANCELLED)
            if not hand.verdict.ok:
                raise PortError(f"{task.name} ended without success", (hand.verdict.text,))

        def cancel() -> None:
            # As the hand's node does: the motors stop where they are.
            if hand.task is task:
                cancelled.append(True)
                hand.task = None
                hand.driver.stop_all()

        return Polled(lambda: bool(cancelled) or hand.verdict is not None, value, cancel)

    def calibrate(self, mode: str) -> Pending:
        hand = self.rig.hand
        hand.driver.calibration(mode)
        due = hand.clock.monotonic()

        def value() -> None:
            hand.calibrated = True

        return Polled(lambda: self.rig.t >= due, value)

    def preshape(self, mode: str, level: str) -> Pending:
        return self._task(progress.PreshapeTask(mode, level, True, 8.0))

    def close_on_object(self) -> Pending:
        return self._task(progress.GraspTask((1, 2, 3, 4), 8.0))

    def open(self, speed: int) -> Pending:
        return self._task(progress.OpenTask(speed))

    def state(self) -> HandState:
        hand = self.rig.hand
        if hand.dead:
            return HandState(message="hand_status is silent")
        return HandState(True, hand.calibrated, False, hand.holding, hand.message, hand.positions)


class VirtualPerception:
    """PerceptionPort on the virtual world's trackers; the recogniser, if one is given, sees the tracked hand."""

    def __init__(self, rig: Any, recogniser: Any = None) -> None:
        self.rig, self.recogniser = rig, recogniser

    def init_vision(self, time_limit: float) -> Pending:
        return Ready("rig")

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        name = object_id if object_id in ("board", "human_hand") else f"object_{object_id}"
        end = self.rig.t + time_limit
        known = name == "board" or name in self.rig.trackers

        def fresh() -> bool:
            return known and self.rig.newest(name)[1] < 0.5

        def value() -> Located:
            if not fresh():
                raise PortError(f"'{name}' was not seen within {time_limit:.1f} s", code=ReasonCode.OBJECT_NOT_SEEN)
            frame, age = self.rig.newest(name)
            x, y, z = frame.position
            qx, qy, qz, qw = frame.orientation
            return Located(name, "world", (x, y, z), (qx, qy, qz, qw), age)

        return Polled(lambda: fresh() or self.rig.t >= end, value)

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        return Ready([Located("", "board", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 0.0)])

    def recognition(self) -> Recognition:
        if self.recogniser is None:
            return Recognition()
        seen = self.recogniser.estimate
        return Recognition(seen.pattern, seen.confidence, seen.decided, seen.probabilities)


class VirtualDatabase:
    """DatabasePort over the real object files."""

    def __init__(self, database: ObjectDatabase) -> None:
        self.database = database

    def get_object(self, object_id: str) -> Pending:
        try:
            return Ready(self.database.get(object_id))
        except ObjectError as error:
            return Ready(error=PortError(str(error), code=ReasonCode.OBJECT_UNKNOWN))

    def list_objects(self) -> Pending:
        return Ready(self.database.ids())


class VirtualContact:
    """ContactPort: the detector on the virtual arm's torques."""

    def __init__(self, rig: Any) -> None:
        self.rig = rig
        self.detector = ContactDetector(DetectorSettings(), lambda q: rig.robot.chain.jacobian(q)[:3])
        self.watched_while_moving = 0
        """periods in which the detector watched though the arm moved"""
        self._event: ContactEvent | None = None
        rig.after_period.append(self._sense)

    def _sense(self) -> None:
        report = self.rig.robot.report
        velocity = np.asarray(report["measured_velocity"])
        event = self.detector.feed(self.rig.t, report["external_torque"], report["position"], velocity)
        if event is not None and self._event is None:
            self._event = event
        if self.detector.state() == "watching" and np.max(np.abs(velocity)) > 0.05:
            self.watched_while_moving += 1

    def arm(self, mode: str, time_limit: float, settings: Mapping[str, Any]) -> Pending:
        self._event = None
        try:
            self.detector.arm(
                mode,
                self.rig.t,
                time_limit,
                float(settings.get("k", 0.0)),
                settings.get("joints", ()),
                float(settings.get("mass", 0.0)),
                float(settings.get("load_share", 0.0)),
            )
        except ValueError as error:
            return Ready(error=PortError(str(error), code=ReasonCode.INVALID_ARGUMENT))
        return Ready()

    def disarm(self) -> None:
        self.detector.disarm()

    def event(self) -> ContactEvent | None:
        return self._event
