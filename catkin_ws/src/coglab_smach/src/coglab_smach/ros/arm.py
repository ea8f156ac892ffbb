"""ArmPort on the services and topics of the controller manager and of the LWR interface. Names are relative."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from coglab_msgs.msg import (
    ControllerStatus,
    DmpFeedback,
    FeedbackStatus,
    FinishedPtp,
    LwrState,
    ReasonCode,
    UnfinishedPtp,
)
from coglab_msgs.srv import (
    AddPtp,
    CancelMotion,
    ExecuteDmp,
    ExecuteDmpRequest,
    FeedbackSelect,
    ListControllers,
    LoadController,
    LoadDmps,
    LwrCommand,
    SwitchController,
    SwitchDmp,
    SwitchDmpRequest,
)
from coglab_py import parameters
from geometry_msgs.msg import Point, Quaternion, Vector3
from sensor_msgs.msg import JointState

from coglab_smach.kinematics.motion_time import MotionLimits, read_limits
from coglab_smach.ports.interfaces import DmpProgress, DmpRequest, Verdict
from coglab_smach.ports.pending import Pending, Permit, Polled, PortError, Threaded, ending_motion
from coglab_smach.ros.calls import Newest, call, call_now, mapped

JOINTS = ("lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6")


class RosArm:
    """ArmPort on controller_manager and lwr. It uses the plug-ins that are loaded as dmp and ptp."""

    def __init__(self, manager: str = "controller_manager", lwr: str = "lwr") -> None:
        self._manager, self._lwr = manager, lwr
        self._lock = threading.Lock()
        self._ended: dict[int, PortError | None] = {}
        self._addressed = ""
        self._limits = read_limits({})
        self._started_at = 0.0
        self._lwr_state = Newest(f"{lwr}/state", LwrState)
        self._joints = Newest(f"{lwr}/joint_states", JointState)
        self._feedback = Newest(f"{manager}/dmp/feedback", DmpFeedback)
        self._status = Newest(f"{manager}/status", ControllerStatus)
        self._cascade = Newest(f"{manager}/feedback/status", FeedbackStatus)
        self._ptp = Newest(f"{manager}/ptp/finished_ptp", FinishedPtp, self._on_finished)
        self._unfinished = Newest(f"{manager}/ptp/unfinished_ptp", UnfinishedPtp, self._on_unfinished)

    def _on_finished(self, message: FinishedPtp) -> None:
        with self._lock:
            self._ended[message.ptp_id] = None

    def _on_unfinished(self, message: UnfinishedPtp) -> None:
        with self._lock:
            self._ended[message.ptp_id] = PortError(
                "the point-to-point motion ended before its target", (message.reason,), message.reason_code
            )

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        def run(permit: Permit) -> None:
            # Read in this thread: the parameter server may hang, and a state must not.
            self._limits = read_limits(parameters.read(self._manager, dict, {}))
            loaded = call_now(f"{self._manager}/list_controllers", ListControllers, permit)
            if (controller_id, controller_type) in zip(loaded.controller_ids, loaded.controller_types, strict=False):
                return
            call_now(
                f"{self._manager}/load_controller",
                LoadController,
                permit,
                controller_id=controller_id,
                controller_type=controller_type,
            )

        return Threaded(run, f"loading of plug-in '{controller_id}'")

    def load_dmps(self, filename: str) -> Pending:
        return mapped(call(f"{self._manager}/dmp/load_dmps", LoadDmps, filename=filename), lambda r: r.num_loaded)

    def lwr_command(self, event: str) -> Pending:
        return mapped(call(f"{self._lwr}/command", LwrCommand, event=event), lambda r: r.message)

    def motion_allowed(self) -> Verdict:
        state = self._lwr_state.message
        if state is None:
            return _unheard(f"{self._lwr}/state")
        if self._joints.age() > 1.0:
            return self._silent()
        if state.motion_allowed:
            return Verdict(True)
        return Verdict(
            False,
            state.reason or f"the LWR interface is in state '{state.supervisor}'",
            state.reason_code or (ReasonCode.HELD if state.hold_latched else ReasonCode.NONE),
        )

    def _silent(self) -> Verdict:
        return Verdict(
            False,
            f"{self._lwr}/joint_states is silent for {min(self._joints.age(), 999):.1f} s",
            ReasonCode.NODE_SILENT,
        )

    def standing(self) -> Verdict:
        status = self._status.message
        if status is None:
            return _unheard(f"{self._manager}/status")
        if self._joints.age() > 1.0:
            return self._silent()
        return Verdict(status.standing, "" if status.standing else f"the arm is {status.state}")

    def _cancelling(self, name: str, reason: str) -> Threaded:
        return Threaded(lambda _: self._cancel(name, reason), f"cancelling of '{name}'")

    def cancel_motion(self, reason: str) -> Pending:
        status = self._status.message
        running = {self._addressed, status.active_controller if status is not None else ""} & {"dmp", "ptp"}
        # Each call has its own Permit, which is never withdrawn.
        calls = [self._cancelling(name, reason) for name in sorted(running)]
        if not calls:
            return Polled(lambda: self.standing().ok, lambda: None)

        def failed() -> bool:
            return any(c.failed() for c in calls)

        # The answer may arrive before the status message that reports the standstill.
        return Polled(
            lambda: failed() or (all(c.done() for c in calls) and self.standing().ok),
            lambda: [c.result() for c in calls][0],
        )

    def _cancel(self, controller_id: str, reason: str) -> None:
        try:
            call_now(
                f"{self._manager}/{controller_id}/cancel",
                CancelMotion,
                Permit(),
                wait=1.0,
                time_limit=0.0,
                reason=reason[:200],
            )
        except PortError as error:
            status = self._status.message
            # A restarted robot node has no plug-in loaded: it has no such service, and nothing moves.
            elsewhere = status is not None and status.active_controller != controller_id
            gone = error.code == ReasonCode.NODE_SILENT and elsewhere
            if not gone and error.code not in (ReasonCode.NOTHING_RUNS, ReasonCode.NOT_ACTIVE):
                raise

    def motion_limits(self) -> MotionLimits:
        return self._limits

    def speed_scale(self) -> float:
        return self._status.message.speed_scale if self._status.message is not None else 1.0

    def switch_controller(self, controller_id: str) -> Pending:
        self._addressed = controller_id
        return mapped(
            call(f"{self._manager}/switch_controller", SwitchController, wait=5.0, controller_id=controller_id),
            lambda r: r.controller_type,
        )

    def apply_profile(self, profile: str) -> Pending:
        return mapped(
            call(f"{self._manager}/feedback/apply_profile", FeedbackSelect, wait=5.0, names=[profile], reason=""),
            lambda r: None,
        )

    def profile_settled(self, profile: str) -> Verdict:
        message = self._cascade.message
        if message is None:
            return _unheard(f"{self._manager}/feedback/status")
        if message.profile != profile:
            return Verdict(False, f"profile '{message.profile}' is in force")
        busy = [f"{c.name} is {c.activity}" for c in message.controllers if not c.enabled and c.activity != "off"]
        return Verdict(not busy, ", ".join(busy))

    def execute_dmp(self, request: DmpRequest) -> Pending:
        self._started_at = time.monotonic()
        pending = call(f"{self._manager}/dmp/execute_dmp", ExecuteDmp, wait=5.0, **_fields(request, ExecuteDmpRequest))

        def accepted(response: Any) -> None:
            self._started_at = time.monotonic()

        return ending_motion(mapped(pending, accepted), self.cancel_motion)

    def switch_dmp(self, request: DmpRequest) -> Pending:
        return mapped(
            call(f"{self._manager}/dmp/switch_dmp", SwitchDmp, wait=1.0, **_fields(request, SwitchDmpRequest)),
            lambda r: None,
        )

    def dmp_progress(self) -> DmpProgress:
        message = self._feedback.message
        if message is None or self._feedback.stamp < self._started_at:
            return DmpProgress("running" if self._started_at else "idle")
        return DmpProgress(
            message.state,
            message.reason,
            message.primitive_id,
            message.phase,
            message.remaining_distance,
            message.reason_code,
            message.remaining_time,
        )

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        with self._lock:
            self._ended.clear()
        added = call(
            f"{self._manager}/ptp/add_ptp",
            AddPtp,
            wait=5.0,
            position=list(position),
            max_vel=list(max_velocity),
            max_acc=[],
        )
        ended: list[PortError | None] = []

        def finished() -> bool:
            if not ended and added.done():
                end = self._end_of_ptp(added)
                if end is not None:
                    ended.append(end[0])
            return bool(ended)

        def value() -> None:
            if ended[0] is not None:
                raise ended[0]

        return ending_motion(Polled(finished, value, added.cancel), self.cancel_motion)

    def _end_of_ptp(self, added: Pending) -> tuple[PortError | None] | None:
        """Returns None while the motion runs; at its end, a tuple with its error or None."""
        try:
            identity = added.result().ptp_id
        except PortError as error:
            return (error,)
        with self._lock:
            if identity in self._ended:
                return (self._ended.pop(identity),)
        status = self._status.message
        if status is not None and status.state == "fault":
            return (
                PortError(
                    "the point-to-point motion ended in a fault of the controller manager",
                    (status.reason,),
                    status.reason_code,
                ),
            )
        allowed = self.motion_allowed()
        if not allowed.ok:
            return (PortError("the arm does not follow any more", (allowed.why,), allowed.code),)
        return None

    def joint_positions(self) -> tuple[float, ...] | None:
        return self.measured()[0]

    def measured(self) -> tuple[tuple[float, ...] | None, float]:
        """Joint positions (rad), None if unknown or older than 0.5 s, and when they were measured (s, ROS time)."""
        message = self._joints.message
        if message is None or self._joints.age() > 0.5:
            return None, 0.0
        by_name = dict(zip(message.name, message.position, strict=False))
        joints = tuple(by_name[name] for name in JOINTS) if all(name in by_name for name in JOINTS) else None
        return joints, message.header.stamp.to_sec()

    def hold(self, reason: str) -> Pending:
        run = Threaded(lambda _: call_now(f"{self._lwr}/command", LwrCommand, Permit(), wait=1.0, event="hold"), "hold")
        return mapped(run, lambda r: r.message)


def _unheard(topic: str) -> Verdict:
    return Verdict(False, f"{topic} has never been published; is the robot node running?", ReasonCode.NODE_SILENT)


def _fields(request: DmpRequest, kind: type[ExecuteDmpRequest | SwitchDmpRequest]) -> dict[str, Any]:
    """Returns the fields of a request that this service has. Other fields of the service keep their defaults."""
    message = kind()
    for name, value in vars(request).items():
        if name in message.__slots__:
            own = type(getattr(message, name))
            setattr(message, name, own(*value) if own in (Point, Quaternion, Vector3) else value)
    return {name: getattr(message, name) for name in message.__slots__}
