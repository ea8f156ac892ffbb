"""Why a button is disabled, and the two acts after a stop: acknowledge the cause, then press and hold.

What the state machine takes is its own decision (MasterState.actions); here only its words are repeated, and what
belongs to the console alone is added: who is the operator, what was not acknowledged yet.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from .commands import COMMANDS, STARTS

BUTTONS = (*STARTS, "calibrate", "home")
STANDSTILL = ("stopped", "fault")
LONGEST = 28
"""characters of the arm's reason below a button, which has room for three lines; the status column has all of it"""
SECOND_THOUGHT = ("feedback", "feedback_order", "contact_learn")
"""commands that are held down, not clicked: nobody sees at once what they have changed"""


@dataclass
class MotionGuard:
    """After a stop nothing moves before its cause was acknowledged, and the first motion needs a held button."""

    real: bool = False
    cause: str = ""
    unacknowledged: bool = False
    needs_hold: bool = field(default=False)
    stops: int = 0
    """how many there were: a motion that was asked for before the newest one is not the first after it"""
    _was_stopped: bool = False
    _standstills: int = 0

    def __post_init__(self) -> None:
        self.needs_hold = self.real

    def stop(self, cause: str) -> None:
        """A stop, by whomever. Its number is `stops`."""
        self.cause, self.unacknowledged, self.needs_hold = cause, True, True
        self.stops += 1

    def observe(self, stopped: bool, cause: str, standstills: int = 0) -> bool:
        """How the robot stands, several times a second, and how often it has come to stand (Standstills); True where a
        stop has begun since the last look, also one that followed another without a motion between them."""
        begun = (stopped and not self._was_stopped) or standstills > self._standstills
        self._was_stopped, self._standstills = stopped, standstills
        if begun:
            self.stop(cause or self.cause)
        elif stopped and cause:
            self.cause = cause
        return begun

    def acknowledge(self, stop: int) -> str:
        """The operator has read the cause of the stop of this number. Why that is refused: an answer to an old stop
        lifts no newer one. Empty where it is taken."""
        if not self.stops:
            return "there has been no stop, so that there is nothing to acknowledge"
        if stop != self.stops:
            return (
                f"expected an answer to stop {self.stops}, the newest ({self.cause or 'no reason was told'}), "
                f"got one to stop {stop}; read its cause, then acknowledge it"
            )
        self.unacknowledged = False
        return ""

    def moved(self, stops: int) -> None:
        """A motion was begun with a held button, which was asked for when there had been so many stops."""
        self.needs_hold = self.needs_hold and stops != self.stops

    def guarded(self, name: str, arguments: dict) -> bool:
        """Whether this command needs a held button now. Always: calibrations that open the hand whatever it holds, and
        what changes how the arm yields or is watched."""
        if name == "calibrate" and (arguments.get("force") or arguments.get("mode") == "complete"):
            return True
        if name in SECOND_THOUGHT:
            return True
        return COMMANDS[name].motion and self.needs_hold


class Standstills:
    """Counts how often the robot has come to stand after a stop or a fault. Told of every message, because what is
    over between two looks counts, too."""

    def __init__(self) -> None:
        self.count = 0
        self._leaf = ""
        self._held = False

    def machine(self, state: str) -> None:
        """Path of the machine's active state. Where it stops because the arm is held, that is one stop."""
        before, self._leaf = self._leaf, state.rsplit("/", 1)[-1]
        if self._leaf in STANDSTILL and self._leaf != before:
            self.count += self._leaf != "stopped" or not self._held

    def arm(self, held: bool) -> None:
        """Whether the arm is held until a reset."""
        self.count += held and not self._held
        self._held = held


@dataclass
class Standing:
    """What the reasons depend on; the node fills it in."""

    master_alive: bool = False
    state: str = ""
    in_hub: bool = False
    actions: tuple[str, ...] = ()
    object_id: str = ""
    arm_alive: bool = False
    motion_allowed: bool = False
    arm_reason: str = ""
    hand_alive: bool = False
    hand_connected: bool = False
    calibrating: bool = False

    @property
    def leaf(self) -> str:
        """Label of the innermost active state."""
        return self.state.rsplit("/", 1)[-1]

    @property
    def stopped(self) -> bool:
        """Whether the machine waits for somebody after a stop or a fault."""
        return self.master_alive and self.leaf in STANDSTILL


def _start_reason(action: str, now: Standing) -> str:
    if not now.master_alive:
        return "/coglab is not there"
    if action in now.actions:
        return ""
    if not now.in_hub:
        return (
            f"{now.leaf.replace('_', ' ') or 'the machine'} is under way" if now.state else "the machine has not begun"
        )
    if now.leaf in STANDSTILL:
        return f"{now.leaf}: only {' or '.join(now.actions)} leads on"
    if action in ("exchange_robot_to_human", "put") and not now.object_id:
        return "the hand is empty"
    if action in ("exchange_human_to_robot", "take") and now.object_id:
        return f"the hand holds {now.object_id}"
    if action in ("initialise", "reset"):
        return "nothing is stopped" if action == "reset" else "it is initialised"
    words = [action.replace("_", " ") for action in now.actions]
    return f"now only {' or '.join(words)}" if words else f"{now.leaf.replace('_', ' ')} takes nothing"


def _calibrate_reason(now: Standing) -> str:
    if not now.hand_alive:
        return "the hand's node is not there"
    if not now.hand_connected:
        return "the hand does not answer"
    if now.calibrating:
        return "the hand calibrates"
    return "" if not now.master_alive or now.in_hub else "an action is under way"


def _home_reason(now: Standing) -> str:
    if not now.arm_alive:
        return "the arm's node is not there"
    if now.master_alive and (not now.in_hub or now.leaf in STANDSTILL):
        return f"not in {now.leaf.replace('_', ' ')}" if now.in_hub else "an action is under way"
    if now.motion_allowed:
        return ""
    short = re.split(r":|;| because ", now.arm_reason)[0] or "no reason told"
    return f"the arm may not move: {short if len(short) <= LONGEST else short[: LONGEST - 1] + '…'}"


def reasons(now: Standing, guard: MotionGuard) -> dict[str, str]:
    """Reason by button, empty where it may be pressed; whether one is the operator is each browser's own matter."""
    found = {}
    for button in BUTTONS:
        if button == "calibrate":
            reason = _calibrate_reason(now)
        elif button == "home":
            reason = _home_reason(now)
        else:
            reason = _start_reason(button, now)
        if not reason and guard.unacknowledged:
            reason = "acknowledge the stop first"
        found[button] = reason
    return found
