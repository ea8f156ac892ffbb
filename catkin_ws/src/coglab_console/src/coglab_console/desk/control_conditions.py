"""Reasons why a control is disabled.

The state machine decides which actions it accepts (MasterState.actions); this module only repeats that. It adds the
conditions of the console: an acknowledged stop, a running action or trial.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from coglab_py.actions import WAYS_OUT

from .commands import STARTS
from .motion_guard import SECOND_THOUGHT, STANDSTILL, MotionGuard
from .words import action_of, button, phase

CALIBRATIONS = ("calibrate", "calibrate_complete", "calibrate_forced")
LONGEST = 28  # characters of the arm's reason below a button; the status column shows all of it
NEEDS = {  # field of Standing that must be true for a command, and the reason if it is false
    "feedback": ("manager_alive", "the controllers are not there, or silent"),
    "feedback_order": ("manager_alive", "the controllers are not there, or silent"),
    "speed_scale": ("manager_alive", "no motion control"),  # the page has one short line for it
    "contact_learn": ("detector_alive", "the contact detector is not there, or silent"),
    "contact_arm": ("detector_alive", "the contact detector is not there, or silent"),
    "objects_reload": ("database_alive", "the object database is not there"),
}


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
    if action in WAYS_OUT:
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
