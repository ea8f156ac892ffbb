"""Ports without ROS: a kinematic cell in which the machines run in virtual time, for tests and quick trials.

The arm (scripted.arm) is a model that moves and brakes, the hand takes fixed times, the partner follows a
script. Faults are attributes that a test sets at any time. Physics belongs to coglab_sim; here only order, timing and
outcomes matter.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import ObjectDatabase, ObjectError
from coglab_py.pose import Pose
from coglab_smach.clocks.clock import Clock
from coglab_smach.ports.interfaces import Ahead, HandState, Located, Recognition
from coglab_smach.ports.pending import Pending, Polled, PortError, Ready

from coglab_trials.scripted.arm import SimulatedArm
from coglab_trials.scripted.cell import SimulatedCell
from coglab_trials.scripted.contact import SimulatedContact

CALIBRATION = 1.7
"""s"""
MODES = ("cylindrical", "lateral", "tridigit", "bidigit", "tridigit2", "bidigit2")
"""preshapes of the hand"""


class SimulatedHand:
    """HandPort of the kinematic cell; the hand is calibrated from the first calibration on. One order at a time: a
    newer one ends the older."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self._order = 0
        self._at_work: tuple[float, float, tuple[int, ...]] | None = None
        """since when the fingers move at a speed, s for the whole way, and from where"""
        cell.fingers = self._positions

    def calibrate(self, mode: str) -> Pending:
        words = mode.split(" ")
        refused = ""
        if words[0] not in ("fast", "complete") or words[1:] not in ([], ["force"]):
            refused = "no such order"
        elif self.cell.calibrated and len(words) == 1:
            refused = "the hand is calibrated already"
        if not refused and "hand" not in self.cell.faults.dead:
            self.cell.calibrating_until = self.cell.clock.now() + CALIBRATION

        def apply() -> None:
            if refused:
                raise PortError(
                    f"the hand does not calibrate after the order '{mode}'", (refused,), ReasonCode.HAND_REFUSED
                )
            self.cell.calibrated, self.cell.hand_positions = True, (0, 0, 0, 0, 0)

        return self.cell.answer("hand", f"calibrate {mode}", CALIBRATION, apply)

    def _calibrating(self) -> bool:
        return self.cell.clock.now() < self.cell.calibrating_until

    def _move(self, name: str, after: float, positions: Callable[[], tuple[int, ...]], preshaped: bool) -> Pending:
        """An action: it moves the fingers unless it was cancelled, or replaced, before its time had come."""
        if self._calibrating():
            return Ready(error=PortError(f"{name} refused: the hand calibrates", code=ReasonCode.HAND_CALIBRATING))
        self._stand()
        self._order += 1
        order = self._order
        cancelled: list[bool] = []

        def apply() -> None:
            if not self.cell.calibrated and name != "open":
                raise PortError(f"{name} refused: the hand is not calibrated", code=ReasonCode.HAND_NOT_CALIBRATED)
            if cancelled or order != self._order:
                code = ReasonCode.CANCELLED if cancelled else ReasonCode.SUPERSEDED
                raise PortError(f"{name} ended PREEMPTED", code=code)
            self.cell.hand_positions, self.cell.preshaped = positions(), preshaped
            self._at_work = None

        call = self.cell.answer("hand", name, after, apply)

        def cancel() -> None:
            if order == self._order and "hand" not in self.cell.faults.dead:
                self._stand()
            cancelled.append(True)
            call.cancel()

        return Polled(call.done, call.result, cancel)

    def _positions(self) -> tuple[int, ...]:
        """Where the fingers are: those that open are on the way."""
        if self._at_work is None or self.cell.hand_positions != self._at_work[2]:
            return self.cell.hand_positions
        begun, duration, start = self._at_work
        left = max(0.0, 1.0 - (self.cell.clock.now() - begun) / duration)
        return tuple(round(left * position) for position in start)

    def _stand(self) -> None:
        """What moves stands where it is."""
        self.cell.hand_positions, self._at_work = self._positions(), None

    def preshape(self, mode: str, level: str) -> Pending:
        if mode not in MODES:
            return Ready(
                error=PortError(
                    f"preshape refused: no mode '{mode}'; there are: {', '.join(MODES)}", code=ReasonCode.UNKNOWN_NAME
                )
            )

        def positions() -> tuple[int, ...]:
            self.cell.at_palm = None
            return (200, 40, 40, 40, 40)

        return self._move(f"preshape {mode}", 0.8, positions, True)

    def _closed(self) -> tuple[int, ...]:
        """Around what was touched, which goes with them from then on, or past it."""
        if self.cell.faults.empty_grasp:
            return (200, 254, 254, 254, 254)
        self.cell.at_palm = self.cell.at_palm or self.cell.touched
        return (200, 150, 160, 155, 170)

    def close_on_object(self) -> Pending:
        def positions() -> tuple[int, ...]:
            if not self.cell.preshaped:
                raise PortError("hand_preshape_close without a preshape", code=ReasonCode.HAND_REFUSED)
            return self._closed()

        return self._move("close", 1.0, positions, True)

    def close(self, speed: int) -> Pending:
        def positions() -> tuple[int, ...]:
            return self._closed()

        return self._at_speed("close", speed, positions)

    def open(self, speed: int) -> Pending:
        def positions() -> tuple[int, ...]:
            self.cell.at_palm = self.cell.touched = None
            return (0, 0, 0, 0, 0)

        return self._at_speed("open", speed, positions)

    def _at_speed(self, name: str, speed: int, positions: Callable[[], tuple[int, ...]]) -> Pending:
        if not 1 <= speed <= 511:
            return Ready(
                error=PortError(f"{name} refused: speed is {speed}, expected 1..511", code=ReasonCode.OUT_OF_RANGE)
            )
        duration = 0.8 * max(1.0, 400 / speed) if name == "open" else 0.8
        moving = self._move(name, duration, positions, False)
        broken = "hand" in self.cell.faults.dead or name in self.cell.faults.refuse
        if name == "open" and not self._calibrating() and not broken:
            self._at_work = (self.cell.clock.now(), duration, self.cell.hand_positions)
        return moving

    def state(self) -> HandState:
        self.cell.advance()
        if "hand" in self.cell.faults.dead:
            return HandState(message="hand_status is silent", event=ReasonCode.NODE_SILENT)
        closed = self._positions()[2] > 100 and not self.cell.faults.empty_grasp
        calibrating = self._calibrating()
        calibrated = self.cell.calibrated and not calibrating
        return HandState(True, calibrated, calibrating, closed, "", () if calibrating else self._positions())


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
                raise PortError(
                    f"'{object_id}' was not seen within {time_limit:.1f} s", code=ReasonCode.OBJECT_NOT_SEEN
                )
            return _located(self.cell.pose(object_id), object_id)

        return self.cell.answer("perception", f"locate {object_id}", time_limit if unseen else 0.05, value)

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        return self.cell.answer(
            "perception", "free_places", 0.1, lambda: [_located(place, "", parent="board") for place in self.places]
        )

    def _knows_nothing(self) -> bool:
        """The node is silent, or does not see the hand."""
        return "perception" in self.cell.faults.dead or "human_hand" in self.cell.faults.not_seen

    def ahead(self) -> Ahead:
        partner = self.cell.partner
        if self._knows_nothing():
            return Ahead()
        return Ahead(partner.offer, partner.request, "mug" if partner.offer > 0.0 else "")

    def recognition(self) -> Recognition:
        cell, partner = self.cell, self.cell.partner
        started = cell.arm.motion_started
        if self._knows_nothing() or started is None or cell.clock.now() - started < partner.pattern_at:
            return Recognition()
        return Recognition(partner.pattern, 0.95, partner.pattern != "unknown")


def _located(pose: Pose, object_id: str, parent: str = "world") -> Located:
    frame = object_id if object_id in ("", "human_hand", "board") else f"object_{object_id}"
    x, y, z = (float(v) for v in pose.position)
    qx, qy, qz, qw = (float(v) for v in pose.orientation)
    return Located(frame, parent, (x, y, z), (qx, qy, qz, qw), 0.05)


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
                raise PortError(str(error), code=ReasonCode.OBJECT_UNKNOWN) from None

        return self.cell.answer("database", f"get {object_id}", 0.02, value)

    def list_objects(self) -> Pending:
        return self.cell.answer("database", "list", 0.02, self.database.ids)


def simulated_context(clock: Clock, database: ObjectDatabase, config: Any) -> tuple[Any, SimulatedCell]:
    """A complete context on simulated ports, and the cell behind them."""
    from coglab_smach.context.context import Context
    from coglab_smach.context.journal import Journal

    cell = SimulatedCell(clock)
    ctx = Context(
        clock=clock,
        arm=SimulatedArm(cell),
        hand=SimulatedHand(cell),
        perception=SimulatedPerception(cell),
        database=SimulatedDatabase(cell, database),
        contact=SimulatedContact(cell),
        config=config,
        journal=Journal(clock.now),
    )
    return ctx, cell
