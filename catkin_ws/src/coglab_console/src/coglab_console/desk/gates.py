"""Why a control is disabled, and the two acts after a stop: acknowledge the cause, then press and hold.

What the state machine takes is its own decision (MasterState.actions); here only its words are repeated, and what
belongs to the console alone is added: who is the operator, what was not acknowledged yet.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from .commands import COMMANDS, STARTS
from .words import action_of, button, phase, without_advice

CALIBRATIONS = ("calibrate", "calibrate_complete", "calibrate_forced")
STANDSTILL = ("stopped", "fault")
HOLD_TIME = 0.8  # s that a button must be held
LONGEST_GAP = 0.25  # s between two messages of a held button
LONGEST = 28
"""characters of the arm's reason below a button, which has room for three lines; the status column has all of it"""
SECOND_THOUGHT = ("feedback", "feedback_order", "contact_learn", "contact_arm", "objects_reload")
"""commands that are held down, not clicked: nobody sees at once what they have changed; they change limits, gains or
thresholds, which object files hold, too, and therefore wait until no action and no trial is under way"""
NEEDS = {  # what must be there
    "feedback": ("manager_alive", "the controllers are not there, or silent"),
    "feedback_order": ("manager_alive", "the controllers are not there, or silent"),
    # There is one short line for it.
    "speed_scale": ("manager_alive", "no motion control"),
    "contact_learn": ("detector_alive", "the contact detector is not there, or silent"),
    "contact_arm": ("detector_alive", "the contact detector is not there, or silent"),
    "objects_reload": ("database_alive", "the object database is not there"),
}


@dataclass
class MotionGuard:
    """After a stop nothing moves before its cause was acknowledged, and the first motion needs a held button."""

    real: bool = False
    cause: str = ""
    unacknowledged: bool = False
    lifted: bool = False
    """the robot stands no more though the stop was not acknowledged: somebody has reset it without the page"""
    needs_hold: bool = field(default=False)
    stops: int = 0
    """how many there were: a motion that was asked for before the newest one is not the first after it"""
    _was_stopped: bool = False
    _standstills: int = 0

    def __post_init__(self) -> None:
        self.needs_hold = self.real

    def stop(self, cause: str) -> None:
        """A stop, by whomever. Its number is `stops`."""
        self.cause, self.unacknowledged, self.needs_hold, self.lifted = cause, True, True, False
        self.stops += 1

    def told(self) -> str:
        """What the page says of the newest stop."""
        if not self.lifted:
            return self.cause
        return (
            f"This stop is over, it was lifted without this page: {without_advice(self.cause) or 'no reason was told'}"
        )

    def observe(self, stopped: bool, cause: str, standstills: int = 0) -> bool:
        """How the robot stands, several times a second, and how often it has come to stand (Standstills); True where a
        stop has begun since the last look, also one that followed another without a motion between them."""
        begun = (stopped and not self._was_stopped) or standstills > self._standstills
        ended = self._was_stopped and not stopped
        self._was_stopped, self._standstills = stopped, standstills
        if begun:
            self.stop(cause or self.cause)
            self.lifted = not stopped
        elif ended:
            self.lifted = self.unacknowledged
        elif stopped and cause:
            self.cause = cause
        return begun

    def acknowledge(self, stop: int) -> str:
        """The operator has read the cause of the stop of this number. Why that is refused: an answer to an old stop
        lifts no newer one. Empty where it is taken."""
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
        what changes how the arm yields or is watched. Switching the watch off never does."""
        if name == "calibrate" and (arguments.get("force") or arguments.get("mode") == "complete"):
            return True
        if name in SECOND_THOUGHT:
            return not (name == "contact_arm" and arguments.get("mode") == "off")
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
    """What the reasons depend on; the node fills it in. `…_alive`: it is there and was heard a moment ago."""

    master_there: bool = False
    """also where it has been silent for a moment: what it was doing may go on"""
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
    calibrated: bool = False
    holding: bool = False
    manager_alive: bool = False
    detector_alive: bool = False
    database_alive: bool = False
    objects: tuple[str, ...] = ()
    """objects of the database"""

    @property
    def leaf(self) -> str:
        """Label of the innermost active state."""
        return self.state.rsplit("/", 1)[-1]

    @property
    def under_way(self) -> bool:
        """Whether the machine is in an action."""
        return self.master_there and not self.in_hub


def _leads_on(now: Standing) -> str:
    return f"{now.leaf}: only {' or '.join(map(button, now.actions))} leads on"


def _start_reason(action: str, now: Standing) -> str:
    if not now.master_alive:
        return "the brain is not there, or silent"
    if action in now.actions:
        return ""
    if not now.in_hub:
        action = action_of(now.state)
        return f"{action} is under way" if action else f"busy: it {phase(now.state)}" if now.state else "not begun yet"
    if now.leaf in STANDSTILL:
        return _leads_on(now)
    if action in ("exchange_robot_to_human", "put") and not now.object_id:
        return "the hand is empty"
    if action in ("exchange_human_to_robot", "take") and now.object_id:
        return f"the hand holds {now.object_id}"
    if action in ("initialise", "reset"):
        return "nothing is stopped" if action == "reset" else "it is initialised"
    words = [button(name) for name in now.actions]
    return f"now only {' or '.join(words)}" if words else f"the phase '{phase(now.state)}' takes nothing"


def _calibrate_reason(now: Standing, forced: bool) -> str:
    if not now.hand_alive:
        return "the hand is not there, or silent"
    if not now.hand_connected:
        return "the hand does not answer"
    if now.calibrating:
        return "the hand calibrates"
    if now.under_way:
        return "an action is under way"
    if not forced and now.holding:
        return "the hand may hold something; see Health"
    return "it is calibrated; again: see Health" if now.calibrated and not forced else ""


def _home_reason(now: Standing) -> str:
    if not now.arm_alive:
        return "the arm is not there, or silent"
    if now.under_way:
        return "an action is under way"
    if now.master_there and now.leaf in STANDSTILL:
        return _leads_on(now)
    if now.motion_allowed:
        return ""
    short = re.split(r":|;| because ", now.arm_reason)[0] or "no reason told"
    return f"the arm may not move: {short if len(short) <= LONGEST else short[: LONGEST - 1] + '…'}"


def _motion_reason(name: str, now: Standing) -> str:
    if name in CALIBRATIONS:
        return _calibrate_reason(now, name == "calibrate_forced")
    return _home_reason(now) if name == "home" else _start_reason(name, now)


def reasons(now: Standing, guard: MotionGuard, session: Mapping[str, str] | None = None) -> dict[str, str]:
    """Reason by control, empty where it may be used; `session` has those of the session and its trials. Whether one is
    the operator is each browser's own matter."""
    found = {name: _motion_reason(name, now) for name in (*STARTS, *CALIBRATIONS, "home")}
    for name, reason in found.items():
        if not reason and guard.unacknowledged:
            found[name] = "acknowledge the stop first"
    given = session or {}
    trial = not given.get("trial_end", "no trial is under way")
    for name, (needed, missing) in NEEDS.items():
        found[name] = "" if getattr(now, needed) else missing
        if name in SECOND_THOUGHT and (now.under_way or trial):
            found[name] = "not while an action or a trial is under way"
    found["acknowledge"] = "" if guard.unacknowledged else "no stop waits to be acknowledged"
    return {**found, **{name: found.get(name) or reason for name, reason in given.items()}}


def control(name: str, arguments: Mapping[str, Any]) -> str:
    """The control that stands for a command, by which `reasons` knows it."""
    if name == "start":
        return str(arguments["action"])
    if name == "calibrate" and arguments.get("force"):
        return "calibrate_forced"
    if name == "calibrate" and arguments.get("mode") == "complete":
        return "calibrate_complete"
    return "trial_done" if name == "trial_end" and arguments["outcome"] == "done" else name


class HeldButton:
    """The held button of one browser: a motion begins only after its button was held for HOLD_TIME.

    The page sends a message ten times a second while the button is down. So nothing begins if the browser dies or loses
    its connection. Times in s of the steady clock."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._what: object = None
        self._since = self._last = 0.0

    def held(self, what: object) -> bool:
        """One message of a held button; True exactly once, when `what` was held for long enough without a gap."""
        now = self._now()
        if what != self._what or now - self._last > LONGEST_GAP:
            self._what, self._since = what, now
        self._last = now
        if now - self._since >= HOLD_TIME:
            self._since = float("inf")  # until it was released
            return True
        return False

    def unfinished(self) -> Any:
        """What is held down and has not begun yet; None where nothing is."""
        return self._what if self._since != float("inf") else None
