"""The contact trigger of the kinematic cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.interfaces import ContactEvent
from coglab_smach.ports.pending import Pending, PortError

from coglab_trials.scripted.cell import SimulatedCell

TOUCH = 1.0
"""N, a contact"""
AROUND = 150
"""counts at which the middle finger of the closed hand begins to squeeze what it holds"""
STIFFNESS = 200.0
"""N/m, of the hand of who takes the object"""
EVENTS = {
    "contact": ReasonCode.CONTACT_FOUND,
    "contact_in_motion": ReasonCode.CONTACT_FOUND,
    "lift": ReasonCode.LOAD_CARRIED,
    "load": ReasonCode.LOAD_CARRIED,
    "release": ReasonCode.LOAD_RELEASED,
}

TOUCHES = ("contact", "contact_in_motion")
AT_REST = ("contact", "load")
"""modes in which nothing is found while the arm moves"""


class SimulatedContact:
    """ContactPort of the kinematic cell: the partner's script decides, once the arm stands still."""

    def __init__(self, cell: SimulatedCell) -> None:
        self.cell = cell
        self._mode = ""
        self._until = 0.0
        self._due: float | None = None
        self._event: ContactEvent | None = None
        self._touched = self._early = False
        """somebody has watched for a contact; what is felt now came while the arm moved"""
        self._touches: tuple[str, Pose] | None = None
        """what the person brings to the palm, and the palm relative to it"""
        self._lifted_before = self._needed = self._weight = 0.0
        self._taken_at: float | None = None
        """m, height of the palm where the script's person began to carry what it holds"""
        self.armed_while_moving = False
        self.armed_with_profile: list[str] = []
        """profile in force at each arming, with ' fading' while another one's correction was not gone"""

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        cell = self.cell
        self._event, self._mode, self._early, self._taken_at = None, "", False, None

        def apply() -> None:
            partner = cell.partner
            mass, refused = float(settings.get("mass", 0.0)), ""
            if mode not in EVENTS:
                refused = f"mode is {', '.join(EVENTS)}, got '{mode}'"
            elif not time_limit > 0.0:
                refused = f"timeout must be a positive time in s, got {time_limit}"
            elif mode not in TOUCHES and not mass > 0.0:
                refused = f"{mode} needs the mass of the object in kg"
            elif mode == "load" and not self._touched:
                refused = "load is counted from the torque before the contact: arm for contact first"
            if refused:
                raise PortError(f"arm refused: {refused}", code=ReasonCode.INVALID_ARGUMENT)
            if mode != "load":  # load counts from the torque before the contact
                self._lifted_before = cell.lifted
            self._weight = mass * 9.81
            self._needed = TOUCH if mode in TOUCHES else float(settings.get("load_share", 0.5)) * self._weight
            touch, carried = partner.touch_after, partner.let_go_after
            after = {"load": carried, "lift": carried, "release": partner.take_after}.get(mode, touch)
            now = cell.clock.now()
            self._touched = self._touched or mode in TOUCHES
            grasped = str(settings.get("frame", "")).removeprefix("object_")
            self._touches = (grasped, Pose.from_dict(settings["grasp"])) if grasped else None
            self._mode, self._until, self._due = mode, now + time_limit, None if after is None else now + after
            moving = mode not in ("contact_in_motion", "lift", "release") and not cell.arm.standing()
            self.armed_while_moving = self.armed_while_moving or moving
            fading = now - cell.profile_since < cell.fade_time
            self.armed_with_profile.append(cell.profile + (" fading" if fading else ""))

        return cell.answer("contact", f"arm {mode}", 0.01, apply)

    def disarm(self) -> None:
        if self._mode:
            self.event()
            self.cell.note("disarm")
            self._mode = ""

    def event(self) -> ContactEvent | None:
        self.cell.advance()
        now = self.cell.clock.now()
        happens = self._is_due() or (now <= self._until and self._pushed())
        if self._mode in AT_REST and not self.cell.arm.standing():
            self._early = happens
            return self._event
        if self._event is None and self._mode and happens and "contact" not in self.cell.faults.dead:
            why = f"{self._mode} by the partner's script"
            early = self._early and self._mode == "contact"
            code = ReasonCode.CONTACT_CAME_EARLY if early else EVENTS[self._mode]
            self._event = ContactEvent(self._mode != "release", "simulated", 2.0, why, code=code)
            if self._touches is not None and happens and not self._pushed():
                self.cell.bring(*self._touches)
            if self._mode == "lift":
                self.cell.let_go()
        return self._event

    def share_gone(self) -> float | None:
        if self._mode != "release" or "contact" in self.cell.faults.dead:
            return None
        lifts = self.cell.lifted - self._lifted_before
        if self.event() is not None and self._is_due():
            # Who takes it holds it where it is: a hand that sinks is lifted more.
            self._taken_at = self._height() if self._taken_at is None else self._taken_at
            lifts += self._weight + STIFFNESS * (self._taken_at - self._height())
        return lifts / self._weight

    def force(self) -> tuple[float, float, float] | None:
        """What the script pulls and lifts with."""
        if "contact" in self.cell.faults.dead or self.cell.pulled is None:
            return None
        x, y, z = self.cell.pulled
        return (x, y, z + self.cell.lifted)

    def grip(self) -> float | None:
        if self.cell.touch is None or "contact" in self.cell.faults.dead:
            return None
        return self.cell.touch * max(0, self.cell.fingers()[2] - AROUND)

    def _height(self) -> float:
        """m, of the palm, base frame."""
        return float(default_arm().fk(np.asarray(self.cell.arm.position()))[0][2])

    def _is_due(self) -> bool:
        """Whether the script's moment has come, while somebody watches."""
        return self._due is not None and self._due <= min(self.cell.clock.now(), self._until)

    def _pushed(self) -> bool:
        lifted = self.cell.lifted - self._lifted_before
        felt = {"load": -lifted, "lift": -lifted, "release": lifted}.get(self._mode, abs(lifted) if self._mode else 0.0)
        return felt >= self._needed > 0.0
