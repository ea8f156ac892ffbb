"""ArmPort over the services and topics of the controller manager and of the LWR interface. Names are relative."""
from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from coglab_msgs.msg import ControllerStatus, DmpFeedback, FeedbackStatus, FinishedPtp, LwrState
from coglab_msgs.srv import (
    AddPtp,
    ExecuteDmp,
    FeedbackSelect,
    ListControllers,
    LoadController,
    LoadDmps,
    LwrCommand,
    SwitchController,
    SwitchDmp,
)
from geometry_msgs.msg import Point, Quaternion
from sensor_msgs.msg import JointState

from .pending import Pending, Polled, PortError, Threaded
from .ports import DmpProgress, DmpRequest
from .ros_calls import Newest, call, mapped, wait_for

JOINTS = ("lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6")


class RosArm:
    """ArmPort over controller_manager and lwr."""

    def __init__(self, manager: str = "controller_manager", lwr: str = "lwr") -> None:
        self._manager, self._lwr = manager, lwr
        self._lock = threading.Lock()
        self._finished: set[int] = set()
        self._started_at = 0.0
        self._lwr_state = Newest(f"{lwr}/state", LwrState)
        self._joints = Newest(f"{lwr}/joint_states", JointState)
        self._feedback = Newest(f"{manager}/dmp/feedback", DmpFeedback)
        self._status = Newest(f"{manager}/status", ControllerStatus)
        self._cascade = Newest(f"{manager}/feedback/status", FeedbackStatus)
        self._ptp = Newest(f"{manager}/ptp/finished_ptp", FinishedPtp, self._on_finished)

    def _on_finished(self, message: FinishedPtp) -> None:
        with self._lock:
            self._finished.add(message.ptp_id)

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        def run() -> None:
            loaded = wait_for(call(f"{self._manager}/list_controllers", ListControllers))
            if (controller_id, controller_type) in zip(loaded.controller_ids, loaded.controller_types, strict=False):
                return
            wait_for(call(f"{self._manager}/load_controller", LoadController, controller_id=controller_id,
                       controller_type=controller_type))

        return Threaded(run, f"loading of plug-in '{controller_id}'")

    def load_dmps(self, filename: str) -> Pending:
        return mapped(call(f"{self._manager}/dmp/load_dmps", LoadDmps, filename=filename), lambda r: r.num_loaded)

    def lwr_command(self, event: str) -> Pending:
        return mapped(call(f"{self._lwr}/command", LwrCommand, event=event), lambda r: r.message)

    def motion_allowed(self) -> tuple[bool, str]:
        state = self._lwr_state.message
        if state is None:
            return False, f"{self._lwr}/state has never been published; is the robot node running?"
        if self._joints.age() > 1.0:
            return False, f"{self._lwr}/joint_states is silent for {min(self._joints.age(), 999):.1f} s"
        if state.motion_allowed:
            return True, ""
        return False, state.reason or f"the LWR interface is in state '{state.supervisor}'"

    def switch_controller(self, controller_id: str) -> Pending:
        return mapped(call(f"{self._manager}/switch_controller", SwitchController, wait=5.0,
                           controller_id=controller_id), lambda r: r.controller_type)

    def apply_profile(self, profile: str) -> Pending:
        return mapped(call(f"{self._manager}/feedback/apply_profile", FeedbackSelect, wait=5.0, names=[profile],
                           reason=""), lambda r: None)

    def profile_settled(self, profile: str) -> tuple[bool, str]:
        message = self._cascade.message
        if message is None:
            return False, f"{self._manager}/feedback/status has never been published; is the robot node running?"
        if message.profile != profile:
            return False, f"profile '{message.profile}' is in force"
        busy = [f"{c.name} is {c.activity}" for c in message.controllers if not c.enabled and c.activity != "off"]
        return not busy, ", ".join(busy)

    def execute_dmp(self, request: DmpRequest) -> Pending:
        self._started_at = time.monotonic()
        fields = _dmp_fields(request)
        pending = call(f"{self._manager}/dmp/execute_dmp", ExecuteDmp, wait=5.0, initial_state=0,
                       initial_position=Point(), goal_frame=request.goal_frame, **fields)

        def accepted(response: Any) -> None:
            self._started_at = time.monotonic()

        return mapped(pending, accepted)

    def switch_dmp(self, request: DmpRequest) -> Pending:
        return mapped(call(f"{self._manager}/dmp/switch_dmp", SwitchDmp, wait=1.0, **_dmp_fields(request)),
                      lambda r: None)

    def dmp_progress(self) -> DmpProgress:
        message = self._feedback.message
        if message is None or self._feedback.stamp < self._started_at:
            return DmpProgress("running" if self._started_at else "idle")
        return DmpProgress(message.state, message.reason, message.primitive_id, message.phase,
                           message.remaining_distance)

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        with self._lock:
            self._finished.clear()
        added = call(f"{self._manager}/ptp/add_ptp", AddPtp, wait=5.0, position=list(position),
                     max_vel=list(max_velocity), max_acc=[])

        def finished() -> bool:
            if not added.done():
                return False
            response = added.result()
            with self._lock:
                if response.ptp_id in self._finished:
                    return True
            status = self._status.message
            if status is not None and status.state == "fault":
                raise PortError("the point-to-point motion ended in a fault of the controller manager",
                                (status.reason,))
            allowed, why = self.motion_allowed()
            if not allowed:
                raise PortError("the arm does not follow any more", (why,))
            return False

        return Polled(finished, lambda: None)

    def joint_positions(self) -> tuple[float, ...] | None:
        message = self._joints.message
        if message is None or self._joints.age() > 0.5:
            return None
        by_name = dict(zip(message.name, message.position, strict=False))
        return tuple(by_name[name] for name in JOINTS) if all(name in by_name for name in JOINTS) else None

    def hold(self, reason: str) -> Pending:
        return self.lwr_command("hold")


def _dmp_fields(request: DmpRequest) -> dict[str, Any]:
    orientation = request.target_orientation
    return {"primitive_id": request.primitive_id, "dmp_ratio": request.dmp_ratio,
            "goal_offset": Point(*request.goal_offset), "orientation_control": orientation is not None,
            "target_orientation": Quaternion(*(orientation if orientation is not None else (0, 0, 0, 0)))}
