"""Scripted hand, perception, database and contact, and the Context of the state machines on them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import ObjectDatabase, ObjectError
from coglab_py.pose import Pose
from coglab_smach.clocks.clock import Clock
from coglab_smach.context.config import Config
from coglab_smach.context.context import Context
from coglab_smach.context.journal import Journal
from coglab_smach.ports.interfaces import Ahead, ContactEvent, HandState, Located, Recognition
from coglab_smach.ports.pending import Pending, Polled, PortError, Ready

from coglab_trials.scripted.cell import ScriptedCell

CALIBRATION = 1.7  # s
AROUND = 150  # counts of the middle finger at which the closing hand starts to squeeze the object
TAKER_STIFFNESS = 200.0  # N/m, stiffness of the hand of the person who takes the object
TOUCH = 1.0  # N, force that counts as contact


class ScriptedHand:
    """HandPort of a ScriptedCell. One order at a time: a new order ends the old one."""

    def __init__(self, cell: ScriptedCell) -> None:
        self._cell = cell
        self._order = 0
        self._calibrated_at = 0.0
        self._opening: tuple[float, float, tuple[int, ...]] | None = None
        """opening fingers: (start in s, duration of the whole path in s, start positions in counts)"""

    def calibrate(self, mode: str) -> Pending:
        if "hand" not in self._cell.faults.dead:
            self._calibrated_at = self._cell.clock.now() + CALIBRATION

        def act() -> None:
            self._cell.calibrated, self._cell.hand_positions = True, (0, 0, 0, 0, 0)

        return self._cell.answer("hand", f"calibrate {mode}", CALIBRATION, act)

    def positions(self) -> tuple[int, ...]:
        """Returns the finger positions (counts), also while the fingers open."""
        if self._opening is None or self._cell.hand_positions != self._opening[2]:
            return self._cell.hand_positions
        begun, duration, start = self._opening
        left = max(0.0, 1.0 - (self._cell.clock.now() - begun) / duration)
        return tuple(round(left * position) for position in start)

    def _stand(self) -> None:
        """Stop the fingers where they are."""
        self._cell.hand_positions, self._opening = self.positions(), None

    def _move(self, name: str, after: float, positions: Callable[[], tuple[int, ...]]) -> Pending:
        """Start an action. It moves the fingers after ``after`` s, unless it is cancelled or replaced before."""
        if self._calibrating():
            return Ready(error=PortError(f"{name} refused: the hand calibrates", code=ReasonCode.HAND_CALIBRATING))
        self._stand()
        self._order += 1
        order = self._order
        cancelled: list[bool] = []

        def act() -> None:
            if not self._cell.calibrated and name != "open":
                raise PortError(f"{name} refused: the hand is not calibrated", code=ReasonCode.HAND_NOT_CALIBRATED)
            if cancelled or order != self._order:
                code = ReasonCode.CANCELLED if cancelled else ReasonCode.SUPERSEDED
                raise PortError(f"{name} ended PREEMPTED", code=code)
            self._cell.hand_positions, self._opening = positions(), None

        asked = self._cell.answer("hand", name, after, act)

        def cancel() -> None:
            if order == self._order and "hand" not in self._cell.faults.dead:
                self._stand()
            cancelled.append(True)
            asked.cancel()

        return Polled(asked.done, asked.result, cancel)

    def preshape(self, mode: str, level: str) -> Pending:
        def positions() -> tuple[int, ...]:
            self._cell.at_palm = None
            return (200, 40, 40, 40, 40)

        return self._move(f"preshape {mode}", 0.8, positions)

    def _closed(self) -> tuple[int, ...]:
        """Returns the closed positions (counts): around the touched object, which is then in the hand, or past it."""
        if self._cell.faults.empty_grasp:
            return (200, 254, 254, 254, 254)
        self._cell.at_palm = self._cell.at_palm or self._cell.touched
        return (200, 150, 160, 155, 170)

    def close_on_object(self) -> Pending:
        return self._move("close", 1.0, self._closed)

    def close(self, speed: int) -> Pending:
        return self._move("close", 0.8, self._closed)

    def open(self, speed: int) -> Pending:
        def positions() -> tuple[int, ...]:
            self._cell.at_palm = self._cell.touched = None
            return (0, 0, 0, 0, 0)

        duration = 0.8 * max(1.0, 400 / speed)
        moving = self._move("open", duration, positions)
        faults = self._cell.faults
        if not self._calibrating() and "hand" not in faults.dead and "open" not in faults.refuse:
            self._opening = (self._cell.clock.now(), duration, self._cell.hand_positions)
        return moving

    def _calibrating(self) -> bool:
        return self._cell.clock.now() < self._calibrated_at

    def state(self) -> HandState:
        self._cell.advance()
        if "hand" in self._cell.faults.dead:
            return HandState(message="hand_status is silent", event=ReasonCode.NODE_SILENT)
        positions, calibrating = self.positions(), self._calibrating()
        holding = positions[2] > 100 and not self._cell.faults.empty_grasp
        calibrated = self._cell.calibrated and not calibrating
        return HandState(True, calibrated, calibrating, holding, "", () if calibrating else positions)


class ScriptedPerception:
    """PerceptionPort of a ScriptedCell."""

    def __init__(self, cell: ScriptedCell) -> None:
        self._cell = cell
        self.places = [Pose(np.array([0.0, 0.0, 0.05]))]
        """free places on the board, in the frame `board`"""

    def init_vision(self, time_limit: float) -> Pending:
        return self._cell.answer("perception", "init_vision", 0.5, lambda: "ready")

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        unseen = object_id in self._cell.faults.not_seen or object_id not in self._cell.objects

        def act() -> Located:
            if unseen:
                raise PortError(f"'{object_id}' was not seen in {time_limit:.1f} s", code=ReasonCode.OBJECT_NOT_SEEN)
            frame = object_id if object_id in ("human_hand", "board") else f"object_{object_id}"
            return _located(frame, "world", self._cell.pose(object_id))

        return self._cell.answer("perception", f"locate {object_id}", time_limit if unseen else 0.05, act)

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        places = [_located("", "board", place) for place in self.places]
        return self._cell.answer("perception", "free_places", 0.1, lambda: places)

    def _blind(self) -> bool:
        return "perception" in self._cell.faults.dead or "human_hand" in self._cell.faults.not_seen

    def ahead(self) -> Ahead:
        partner = self._cell.partner
        if self._blind():
            return Ahead()
        return Ahead(partner.offer, partner.request, "mug" if partner.offer > 0.0 else "")

    def recognition(self) -> Recognition:
        partner, started = self._cell.partner, self._cell.arm.motion_started
        if self._blind() or started is None or self._cell.clock.now() - started < partner.pattern_at:
            return Recognition()
        return Recognition(partner.pattern, 0.95, partner.pattern != "unknown")


def _located(frame: str, parent: str, pose: Pose) -> Located:
    x, y, z = map(float, pose.position)
    qx, qy, qz, qw = map(float, pose.orientation)
    return Located(frame, parent, (x, y, z), (qx, qy, qz, qw), 0.05)


class ScriptedDatabase:
    """DatabasePort on the real object files."""

    def __init__(self, cell: ScriptedCell, database: ObjectDatabase) -> None:
        self._cell, self.database = cell, database

    def get_object(self, object_id: str) -> Pending:
        def act() -> dict[str, Any]:
            try:
                return self.database.get(object_id)
            except ObjectError as error:
                raise PortError(str(error), code=ReasonCode.OBJECT_UNKNOWN) from None

        return self._cell.answer("database", f"get {object_id}", 0.02, act)

    def list_objects(self) -> Pending:
        return self._cell.answer("database", "list", 0.02, self.database.ids)


class ScriptedContact:
    """ContactPort of a ScriptedCell. The partner's script decides, once the arm stands still."""

    EVENTS = {
        "contact": ReasonCode.CONTACT_FOUND,
        "contact_in_motion": ReasonCode.CONTACT_FOUND,
        "lift": ReasonCode.LOAD_CARRIED,
        "load": ReasonCode.LOAD_CARRIED,
        "release": ReasonCode.LOAD_RELEASED,
    }

    def __init__(self, cell: ScriptedCell, positions: Callable[[], tuple[int, ...]]) -> None:
        self._cell, self._positions = cell, positions
        self._mode = ""
        self._until = 0.0
        self._due: float | None = None
        self._event: ContactEvent | None = None
        self._early = False
        """the present contact began while the arm moved"""
        self._brings: tuple[str, Pose] | None = None
        """(object that the person brings to the palm, pose of the palm relative to it)"""
        self._lifted_before = self._needed = self._weight = 0.0
        self._taken_at: float | None = None
        """height (m) of the palm when the person began to carry the object"""
        self.armed_while_moving = False
        self.armed_with_profile: list[str] = []
        """profile in force at each arming, with ' fading' while the previous profile's correction fades out"""

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        cell = self._cell
        self._event, self._mode, self._early, self._taken_at = None, "", False, None

        def act() -> None:
            partner, touch = cell.partner, mode in ("contact", "contact_in_motion")
            if mode != "load":  # mode load counts from the torque before the contact
                self._lifted_before = cell.lifted
            self._weight = float(settings.get("mass", 0.0)) * 9.81
            self._needed = TOUCH if touch else float(settings.get("load_share", 0.5)) * self._weight
            carried = {"load": partner.let_go_after, "lift": partner.let_go_after, "release": partner.take_after}
            after, now = carried.get(mode, partner.touch_after), cell.clock.now()
            grasped = str(settings.get("frame", "")).removeprefix("object_")
            self._brings = (grasped, Pose.from_dict(settings["grasp"])) if grasped else None
            self._mode, self._until, self._due = mode, now + time_limit, None if after is None else now + after
            if mode in ("contact", "load") and not cell.arm.standing().ok:
                self.armed_while_moving = True
            self.armed_with_profile.append(cell.arm.profile + (" fading" if cell.arm.fading() else ""))

        return cell.answer("contact", f"arm {mode}", 0.01, act)

    def disarm(self) -> None:
        if self._mode:
            self.event()
            self._cell.note("disarm")
            self._mode = ""

    def event(self) -> ContactEvent | None:
        self._cell.advance()
        pushed = self._cell.clock.now() <= self._until and self._pushed()
        happens = self._is_due() or pushed
        if self._mode in ("contact", "load") and not self._cell.arm.standing().ok:
            self._early = happens
            return self._event
        if self._event is None and self._mode and happens and "contact" not in self._cell.faults.dead:
            early = self._early and self._mode == "contact"
            code = ReasonCode.CONTACT_CAME_EARLY if early else self.EVENTS[self._mode]
            self._event = ContactEvent(self._mode != "release", "scripted", 2.0, f"{self._mode} by script", code=code)
            if self._brings is not None and not self._pushed():
                self._cell.bring(*self._brings)
            if self._mode == "lift":
                self._cell.let_go()
        return self._event

    def share_gone(self) -> float | None:
        if self._mode != "release" or "contact" in self._cell.faults.dead:
            return None
        lifts = self._cell.lifted - self._lifted_before
        if self.event() is not None and self._is_due():
            # The person holds the object in place: if the robot's hand sinks, they carry more of the load.
            height = float(self._cell.palm().position[2])
            self._taken_at = height if self._taken_at is None else self._taken_at
            lifts += self._weight + TAKER_STIFFNESS * (self._taken_at - height)
        return lifts / self._weight

    def force(self) -> tuple[float, float, float] | None:
        if "contact" in self._cell.faults.dead or self._cell.pulled is None:
            return None
        x, y, z = self._cell.pulled
        return (x, y, z + self._cell.lifted)

    def grip(self) -> float | None:
        if self._cell.touch is None or "contact" in self._cell.faults.dead:
            return None
        return self._cell.touch * max(0, self._positions()[2] - AROUND)

    def _is_due(self) -> bool:
        """True if the script's time has come before the time limit."""
        return self._due is not None and self._due <= min(self._cell.clock.now(), self._until)

    def _pushed(self) -> bool:
        lifted = self._cell.lifted - self._lifted_before
        felt = {"load": -lifted, "lift": -lifted, "release": lifted}.get(self._mode, abs(lifted) if self._mode else 0.0)
        return felt >= self._needed > 0.0


def scripted_context(clock: Clock, database: ObjectDatabase, config: Config) -> tuple[Context, ScriptedCell]:
    """Returns a complete Context of the state machines on scripted ports, and its cell."""
    cell = ScriptedCell(clock)
    hand = ScriptedHand(cell)
    ctx = Context(
        clock=clock,
        arm=cell.arm,
        hand=hand,
        perception=ScriptedPerception(cell),
        database=ScriptedDatabase(cell, database),
        contact=ScriptedContact(cell, hand.positions),
        config=config,
        journal=Journal(clock.now),
    )
    return ctx, cell
