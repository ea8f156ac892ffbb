"""Ports without ROS: a kinematic cell in which the machines run in virtual time, for tests and quick trials.

The arm moves its palm with minimum-jerk timing, the hand takes fixed times, the partner follows a small script. Faults
are attributes that a test sets at any time. Physics belongs to coglab_sim; here only order, timing and outcomes matter.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .clock import Clock
from .object_database import ObjectDatabase, ObjectError
from .pending import Pending, PortError, Ready
from .ports import ContactEvent, DmpProgress, DmpRequest, HandState, Located, Recognition
from .pose import Pose
from .simulated_cell import SimulatedCell


class SimulatedArm:
    """ArmPort of the kinematic cell."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self._request: DmpRequest | None = None

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        return self.cell.answer("arm", "load_controller", 0.1,
                                lambda: self.cell.loaded.__setitem__(controller_id, controller_type))

    def load_dmps(self, filename: str) -> Pending:
        return self.cell.answer("arm", "load_dmps", 0.1, lambda: len(self.cell.primitives))

    def lwr_command(self, event: str) -> Pending:
        def apply() -> str:
            if event == "start" and not self.cell.held:
                self.cell.enabled = True
            if event == "hold":
                self.cell.held, self.cell.motion_started = True, None
            if event == "reset":
                self.cell.held = False
            return event

        return self.cell.answer("arm", f"lwr {event}", 0.05, apply)

    def motion_allowed(self) -> tuple[bool, str]:
        if "arm" in self.cell.faults.dead:
            return False, "/lwr/state is silent"
        if self.cell.faults.arm_disabled:
            return False, self.cell.faults.arm_disabled
        if self.cell.held:
            return False, "hold is latched; reset first"
        return self.cell.enabled, "" if self.cell.enabled else "command mode was not asked for"

    def switch_controller(self, controller_id: str) -> Pending:
        def apply() -> str:
            if controller_id not in self.cell.loaded:
                raise PortError(f"controller '{controller_id}' is not loaded")
            self.cell.active = controller_id
            self.cell.motion_started = None
            # As the controller manager does: the profile of the motion controller's name comes with it.
            self.cell.profile, self.cell.profile_since = controller_id, self.cell.clock.now()
            return self.cell.loaded[controller_id]

        return self.cell.answer("arm", f"switch {controller_id}", 0.02, apply)

    def apply_profile(self, profile: str) -> Pending:
        def apply() -> None:
            self.cell.profile, self.cell.profile_since = profile, self.cell.clock.now()

        return self.cell.answer("arm", f"profile {profile}", 0.01, apply)

    def profile_settled(self, profile: str) -> tuple[bool, str]:
        cell = self.cell
        if cell.profile != profile:
            return False, f"profile '{cell.profile}' is in force"
        faded = cell.clock.now() - cell.profile_since >= cell.fade_time
        return faded, "" if faded else "ee_admittance is stopping"

    def execute_dmp(self, request: DmpRequest) -> Pending:
        def apply() -> None:
            self._check(request)
            self._request = request
            self.cell.motion_started, self.cell.reached_at = self.cell.clock.now(), None

        return self.cell.answer("arm", "execute_dmp", 0.02, apply)

    def _check(self, request: DmpRequest) -> None:
        if self.cell.active != "dmp":
            raise PortError(f"execute_dmp refused: '{self.cell.active}' is the active controller")
        if request.primitive_id not in self.cell.primitives:
            raise PortError(f"primitive '{request.primitive_id}' does not exist; loaded: "
                            f"{', '.join(sorted(self.cell.primitives))}")

    def switch_dmp(self, request: DmpRequest) -> Pending:
        def apply() -> None:
            self._check(request)
            self._request = request

        return self.cell.answer("arm", f"switch_dmp {request.primitive_id}", 0.02, apply)

    def dmp_progress(self) -> DmpProgress:
        cell = self.cell
        if cell.motion_started is None or self._request is None:
            return DmpProgress("idle")
        t = cell.clock.now() - cell.motion_started
        if cell.faults.abort_dmp_after and t >= cell.faults.abort_dmp_after:
            return DmpProgress("aborted", cell.faults.abort_reason, self._request.primitive_id)
        if t >= cell.reach_time * self._request.dmp_ratio:
            cell.reached_at = cell.reached_at or cell.clock.now()
            return DmpProgress("reached", "", self._request.primitive_id)
        return DmpProgress("running", "", self._request.primitive_id, 1.0 - t / cell.reach_time)

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        cell = self.cell
        if cell.active != "ptp":
            return Ready(error=PortError(f"add_ptp refused: '{cell.active}' is the active controller"))

        def arrive() -> None:
            if not self.motion_allowed()[0]:
                raise PortError("the arm does not follow any more", (self.motion_allowed()[1],))
            cell.joints = tuple(position)

        return cell.answer("arm", "move_ptp", cell.ptp_time, arrive)

    def joint_positions(self) -> tuple[float, ...] | None:
        return None if "arm" in self.cell.faults.dead else self.cell.joints

    def hold(self, reason: str) -> Pending:
        self.cell.held, self.cell.motion_started = True, None
        return self.cell.answer("arm", "hold", 0.0, lambda: "held")


class SimulatedHand:
    """HandPort of the kinematic cell; the hand is calibrated from the first calibration on."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self._calibrated = False

    def calibrate(self, mode: str) -> Pending:
        return self.cell.answer("hand", f"calibrate {mode}", 2.0, lambda: setattr(self, "_calibrated", True))

    def preshape(self, mode: str, level: str) -> Pending:
        def apply() -> None:
            self.cell.preshaped, self.cell.hand_positions = True, (200, 40, 40, 40, 40)

        return self.cell.answer("hand", f"preshape {mode}", 0.8, apply)

    def close_on_object(self) -> Pending:
        def apply() -> None:
            if not self.cell.preshaped:
                raise PortError("hand_preshape_close without a preshape")
            empty = self.cell.faults.empty_grasp
            self.cell.hand_positions = (200, 254, 254, 254, 254) if empty else (200, 150, 160, 155, 170)

        return self.cell.answer("hand", "close", 1.0, apply)

    def open(self, speed: int) -> Pending:
        def apply() -> None:
            self.cell.preshaped, self.cell.hand_positions = False, (0, 0, 0, 0, 0)

        return self.cell.answer("hand", "open", 0.8, apply)

    def state(self) -> HandState:
        if "hand" in self.cell.faults.dead:
            return HandState(message="hand_status is silent")
        closed = self.cell.hand_positions[2] > 100 and not self.cell.faults.empty_grasp
        return HandState(True, self._calibrated, False, closed, "", self.cell.hand_positions)


class SimulatedPerception:
    """PerceptionPort of the kinematic cell."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self.places = [Pose(np.array([0.0, 0.0, 0.05]))]

    def init_vision(self, time_limit: float) -> Pending:
        return self.cell.answer("perception", "init_vision", 0.5, lambda: "ready")

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        unseen = object_id in self.cell.faults.not_seen or object_id not in self.cell.objects

        def value() -> Located:
            if unseen:
                raise PortError(f"'{object_id}' was not seen within {time_limit:.1f} s")
            return _located(self.cell.objects[object_id], object_id)

        return self.cell.answer("perception", f"locate {object_id}", time_limit if unseen else 0.05, value)

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        return self.cell.answer("perception", "free_places", 0.1,
                                lambda: [_located(place, "", parent="board") for place in self.places])

    def recognition(self) -> Recognition:
        cell, partner = self.cell, self.cell.partner
        if cell.motion_started is None or cell.clock.now() - cell.motion_started < partner.pattern_at:
            return Recognition()
        return Recognition(partner.pattern, 0.95, partner.pattern != "unknown")


def _located(pose: Pose, object_id: str, parent: str = "world") -> Located:
    frame = object_id if object_id in ("", "human_hand", "board") else f"object_{object_id}"
    d = pose.to_dict()
    return Located(frame, parent, tuple(d["xyz"]), tuple(d["quaternion"]), 0.05)


class SimulatedDatabase:
    """DatabasePort over the real object files."""

    def __init__(self, cell: SimulatedCell, database: ObjectDatabase) -> None:
        self.cell = cell
        self.database = database

    def get_object(self, object_id: str) -> Pending:
        def value() -> dict[str, Any]:
            try:
                return self.database.get(object_id)
            except ObjectError as error:
                raise PortError(str(error)) from None

        return self.cell.answer("database", f"get {object_id}", 0.02, value)


class SimulatedContact:
    """ContactPort of the kinematic cell: the partner's script decides."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self._mode = ""
        self._due: float | None = None
        self.armed_while_moving = False
        self.armed_with_profile: list[str] = []
        """profile in force at each arming, with ' fading' while another one's correction was not gone"""

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        cell = self.cell
        partner = cell.partner
        after = {"contact": partner.touch_after, "load": partner.let_go_after, "release": partner.take_after}[mode]
        self._mode, self._due = mode, None if after is None else cell.clock.now() + after
        if cell.motion_started is not None and cell.reached_at is None:
            self.armed_while_moving = True
        fading = cell.clock.now() - cell.profile_since < cell.fade_time
        self.armed_with_profile.append(cell.profile + (" fading" if fading else ""))
        return cell.answer("contact", f"arm {mode}", 0.01, lambda: None)

    def disarm(self) -> None:
        if self._mode:
            self.cell.note("disarm")
            self._mode = ""

    def event(self) -> ContactEvent | None:
        if self._due is None or self.cell.clock.now() < self._due or "contact" in self.cell.faults.dead:
            return None
        return ContactEvent(self._mode != "release", "simulated", 2.0,
                            f"{self._mode or 'event'} by the partner's script")


def simulated_context(clock: Clock, database: ObjectDatabase, config: Any) -> tuple[Any, SimulatedCell]:
    """A complete context on simulated ports, and the cell behind them."""
    from .context import Context
    from .journal import Journal
    cell = SimulatedCell(clock)
    ctx = Context(clock=clock, arm=SimulatedArm(cell), hand=SimulatedHand(cell), perception=SimulatedPerception(cell),
                  database=SimulatedDatabase(cell, database), contact=SimulatedContact(cell), config=config,
                  journal=Journal(clock.now))
    return ctx, cell
