"""Words for the experimenter instead of names of states, actions and commands. The brain itself publishes the
condition of a wait and the time left (MasterState)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

BUTTONS = {
    "initialise": "Initialise",
    "calibrate": "Calibrate hand",
    "home": "Home",
    "exchange_human_to_robot": "Receive",
    "exchange_robot_to_human": "Give",
    "take": "Take",
    "put": "Put",
    "reset": "Go on",
}
"""Words on the buttons of the page, by action of the state machine or command"""
PHASES = {
    "wait_without_object": "ready, the hand is empty",
    "wait_with_object": "ready, holds an object",
    "wait_trigger": "waits for Initialise",
    "stopped": "stopped",
    "fault": "fault",
    "set_dmp_goal": "sets the goal",
    "query_database": "looks the object up",
    "execute_dmp": "reaches",
    "monitor_dmp": "watches where the person reaches",
    "arm_motion": "reaches",
    "approach": "reaches",
    "approach_board": "goes to the place on the board",
    "precise_motion": "goes the last centimetres",
    "wait_stop": "reaches",
    "hand_preshape": "shapes the hand",
    "hand_close": "closes the hand",
    "hand_tighten": "holds it firmly",
    "tighten_at_home": "holds it firmly",
    "hand_open": "opens the hand",
    "open_again": "gives the object back",
    "open_to_regrasp": "opens the hand to grasp again",
    "regrasp": "moves to the better grasp",
    "open_at_home": "opens the hand at home",
    "take_weight": "takes the weight",
    "give_load": "gives the weight to the person",
    "hand_calibration": "calibrates the hand",
    "calibrate_and_home": "calibrates the hand and goes home",
    "coglab_home_robot": "goes home",
    "move_to_board": "goes to the board",
    "leave_board": "leaves the board",
    "locate_object": "looks for the object",
    "free_places": "looks for a free place",
    "switch_to_dmp": "prepares the reach",
    "switch_to_ptp": "prepares a motion to a posture",
    "end_motion": "ends the motion",
    "secure_hand": "secures the hand",
    "what_is_held": "finds out what it holds",
    "which_hub": "finds out what it holds",
    "check_stop": "looks whether it was stopped",
    "recover": "recovers",
    "coglab_init_system": "initialises",
    "coglab_init_robot": "initialises the robot",
    "coglab_init_vision": "starts perception",
    "load_controllers": "loads the controllers",
    "load_dmps": "loads the primitives",
    "configure_lwr": "configures the arm",
    "exchange_human_to_robot": "receives",
    "exchange_robot_to_human": "gives",
    "take": "takes from the board",
    "put": "puts on the board",
}
IN_ACTION = {  # words of a state that depend on the action
    ("exchange_human_to_robot", "set_dmp_goal"): "waits until it is offered",
    ("exchange_robot_to_human", "set_dmp_goal"): "waits for the person's hand",
    ("exchange_human_to_robot", "wait_stop"): "reaches and receives",
    ("exchange_robot_to_human", "wait_stop"): "reaches and gives",
    ("exchange_robot_to_human", "hand_open"): "lets the person have it",
}
SUPERVISOR = {
    "disconnected": "no connection to the robot controller",
    "monitor": "only watched",
    "starting": "starting",
    "command": "ready to move",
    "holding": "holds still",
    "stopping": "stopping",
    "stopped": "stopped",
}
"""States of the arm's interface."""
OUTCOMES = {
    "succeeded": "done",
    "failed": "failed",
    "failed_empty": "failed, the hand is empty",
    "failed_holding": "failed, the hand holds the object",
    "preempted": "broken off",
    "refused": "refused",
}
# Names without "_" are ordinary words, unless they stand in quotation marks.
_LONG = sorted((name for name in PHASES if "_" in name), reverse=True)
_NAMES = re.compile(rf"(?<![\w/])'?({'|'.join(_LONG)})'?(?![\w/])|'({'|'.join(BUTTONS)})'")


def phase(state: str) -> str:
    """Words for the path of a state."""
    labels = state.split("/")
    leaf = labels[-1]
    for action in labels:
        if (action, leaf) in IN_ACTION:
            return IN_ACTION[action, leaf]
    return PHASES.get(leaf, leaf.replace("_", " ")) or "no state"


def button(name: str) -> str:
    """Words on the button of an action."""
    return BUTTONS.get(name, name.replace("_", " "))


def action_of(state: str) -> str:
    """Words on the button of the action in the path of a state; empty if there is none."""
    return next((BUTTONS[label] for label in state.split("/") if label in BUTTONS), "")


def supervisor(name: str) -> str:
    """Words for a state of the arm's interface."""
    return SUPERVISOR.get(name, name)


def outcome(name: str) -> str:
    """Words for the outcome of a state, or for an action of the journal."""
    words = OUTCOMES.get(name) or BUTTONS.get(name) or PHASES.get(name)
    return words or name.replace("_", " ")


def plain(sentence: str) -> str:
    """A sentence of the brain or of the arm with the page's words for states and actions."""
    return _NAMES.sub(lambda found: BUTTONS.get(found[1] or found[2]) or f"'{PHASES[found[1]]}'", sentence)


def transition(path: str, before: str, how: str, after: str, reason: str = "") -> str:
    """One transition of the state machine as a sentence, which begins with the reason if there is one. A state that
    succeeded is not named, because the event has its phase."""
    ended, now = phase(f"{path}/{before}"), phase(f"{path}/{after}")
    if after in OUTCOMES or (how == after and how not in BUTTONS) or now == ended:
        step = f"{ended}: {outcome(how)}"
    elif how == "succeeded":
        step = f"now: {now}"
    else:
        step = f"{ended}: {outcome(how)}; now: {now}"
    return f"{reason} ({step})" if reason else step


def command(name: str, arguments: Mapping[str, Any]) -> str:
    """A command of the page in words, for the event log."""
    given = dict(arguments)
    if name == "start":
        words = button(given.pop("action"))
    elif name == "calibrate":
        forced = "forced " if given.pop("force", False) else ""
        words = f"{forced}{given.pop('mode')} calibration of the hand"
    elif name == "acknowledge":
        return "Acknowledge"
    elif name == "answer":
        words = "Questionnaire"
        given.pop("of", None)
        given.pop("answers", None)  # the answers of a participant are confidential
    else:
        words = COMMANDS.get(name) or button(name)
    rest = (" ".join(map(str, value)) if isinstance(value, list) else str(value) for value in given.values() if value)
    return " ".join([words, *rest])


COMMANDS = {
    "speed_scale": "Speed",
    "session_begin": "Begin the session",
    "session_end": "End the session",
    "trial_begin": "Begin the trial",
    "trial_end": "Trial",
    "take_over": "Take over",
    "keep": "Keep the control",
    "invite": "Link for one more browser",
    "contact_learn": "Learn the noise of the torques",
    "contact_arm": "Contact detector",
    "preview": "Preview of the primitive",
    "objects_reload": "Read the object files again",
    "feedback": "Feedback controller",
    "feedback_order": "Order of the feedback controllers",
}
