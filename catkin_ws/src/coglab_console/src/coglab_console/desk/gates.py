"""Reasons why a control is disabled, and the two steps after a stop: acknowledge the cause, then press and hold.

The state machine decides which actions it accepts (MasterState.actions); this module only repeats that. It adds the
conditions of the console: an acknowledged stop, a held button, a running action or trial.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .commands import COMMANDS, STARTS
from .words import action_of, button, phase, without_advice

CALIBRATIONS = ("calibrate", "calibrate_complete", "calibrate_forced")
STANDSTILL = ("stopped", "fault")
HOLD_TIME = 0.8  # s that a button must be held
LONGEST_GAP = 0.25  # s between two messages of a held button
LONGEST = 28  # characters of the arm's reason below a button; the status column shows all of it
SECOND_THOUGHT = ("feedback", "feedback_order", "contact_learn", "contact_arm", "objects_reload")
"""Commands that need a held button, because nobody sees their effect at once. They change limits, gains or thresholds
(object files hold some, too), so they are refused while an action or a trial is under way."""
NEEDS = {  # field of Standing that must be true for a command, and the reason if it is false
    "feedback": ("manager_alive", "the controllers are not there, or silent"),
    "feedback_order": ("manager_alive", "the controllers are not there, or silent"),
    "speed_scale": ("manager_alive", "no motion control"),  # the page has one short line for it
    "contact_learn": ("detector_alive", "the contact detector is not there, or silent"),
    "contact_arm": ("detector_alive", "the contact detector is not there, or silent"),
    "objects_reload": ("database_alive", "the object database is not there"),
}


@dataclass
class MotionGuard:
    """After a stop, no motion starts until the cause is acknowledged. The first motion then needs a held button."""

    real: bool = False
    cause: str = ""
    unacknowledged: bool = False
    lifted: bool = False
    """The stop is over but was not acknowledged: somebody has reset the robot without the page."""
    needs_hold: bool = field(default=False)
    stops: int = 0
    """Number of stops so far. A motion requested before the newest stop is not the first one after it."""
    _was_stopped: bool = False
    _standstills: int = 0

    def __post_init__(self) -> None:
        self.needs_hold = self.real

    def stop(self, cause: str) -> None:
        """Registers a stop, whatever its source. Its number is `stops`."""
        self.cause, self.unacknowledged, self.needs_hold, self.lifted = cause, True, True, False
        self.stops += 1

    def told(self) -> str:
        """Text of the page about the newest stop."""
        if not self.lifted:
            return self.cause
        return f"This stop is over, it was lifted without this page: {without_advice(self.cause) or 'no reason given'}"

    def observe(self, stopped: bool, cause: str, standstills: int = 0) -> bool:
        """Call this several times a second. `stopped`: the robot stands after a stop or fault; `standstills`: see
        Standstills.

        Returns True if a stop has begun since the last call, even right after another one without a motion between."""
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
        """The operator has read the cause of the stop of this number. Returns why that is refused, or an empty text.

        An acknowledgement of an old stop is refused: it must not lift a newer one."""
        if stop != self.stops:
            return (
                f"expected an answer to stop {self.stops}, the newest ({self.cause or 'no reason given'}), "
                f"got one to stop {stop}; read its cause, then acknowledge it"
            )
        self.unacknowledged = False
        return ""

    def moved(self, stops: int) -> None:
        """A motion has begun with a held button. `stops`: number of stops when it was requested."""
        self.needs_hold = self.needs_hold and stops != self.stops

    def guarded(self, name: str, arguments: dict) -> bool:
        """True if this command needs a held button now.

        Calibrations that open the hand even with an object always need it, and so do the commands of SECOND_THOUGHT.
        Switching the contact detector off never does."""
        if name == "calibrate" and (arguments.get("force") or arguments.get("mode") == "complete"):
            return True
        if name in SECOND_THOUGHT:
            return not (name == "contact_arm" and arguments.get("mode") == "off")
        return COMMANDS[name].motion and self.needs_hold


class Standstills:
    """Counts the standstills of the robot after a stop or a fault. It gets every message, so that a short stop counts,
    too."""

    def __init__(self) -> None:
        self.count = 0
        self._leaf = ""
        self._held = False

    def machine(self, state: str) -> None:
        """Gets the path of the machine's active state. If it stops because the arm is held, both are one stop."""
        before, self._leaf = self._leaf, state.rsplit("/", 1)[-1]
        if self._leaf in STANDSTILL and self._leaf != before:
            self.count += self._leaf != "stopped" or not self._held

    def arm(self, held: bool) -> None:
        """Gets whether the arm is held until a reset."""
        self.count += held and not self._held
        self._held = held


@dataclass
class Standing:
    """State of the robot that the reasons depend on. `…_alive`: the node runs, and its last message is recent."""

    master_there: bool = False
    """True also if the brain has been silent for a moment, because its action may go on."""
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
    """Identifiers of the objects in the database."""
    study: str = ""
    """Name of the study that `./coglab study run --live` runs now."""

    @property
    def leaf(self) -> str:
        """Label of the innermost active state."""
        return self.state.rsplit("/", 1)[-1]

    @property
    def under_way(self) -> bool:
        """Whether the machine is in an action."""
        return self.master_there and not self.in_hub


def _leads_on(now: Standing) -> str:
    return f"{now.leaf}: press {' or '.join(map(button, now.actions))} to continue"


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
    short = re.split(r":|;| because ", now.arm_reason)[0] or "no reason given"
    return f"the arm may not move: {short if len(short) <= LONGEST else short[: LONGEST - 1] + '…'}"


def _motion_reason(name: str, now: Standing) -> str:
    if name in CALIBRATIONS:
        return _calibrate_reason(now, name == "calibrate_forced")
    return _home_reason(now) if name == "home" else _start_reason(name, now)


def reasons(
    now: Standing, guard: MotionGuard, session: Mapping[str, str] | None = None, asked: Sequence[str] = ()
) -> dict[str, str]:
    """Reason by control, empty if the control may be used. `session`: reasons of the session and its trials. `asked`:
    further actions that need a reason, such as one that the machine does not have.

    Each browser checks by itself whether it is the operator."""
    found = {name: _motion_reason(name, now) for name in (*STARTS, *now.actions, *CALIBRATIONS, "home", *asked)}
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
    """Name of the control of a command, as in `reasons`."""
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
        """Gets one message of a held button. True exactly once, when `what` was held for long enough without a gap."""
        now = self._now()
        if what != self._what or now - self._last > LONGEST_GAP:
            self._what, self._since = what, now
        self._last = now
        if now - self._since >= HOLD_TIME:
            self._since = float("inf")  # until the button is released
            return True
        return False

    def unfinished(self) -> Any:
        """The command whose button is held down and that has not begun yet, or None."""
        return self._what if self._since != float("inf") else None
