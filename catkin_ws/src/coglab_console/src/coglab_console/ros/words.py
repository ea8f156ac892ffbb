"""Phases in words. What is waited for, and how long still, the machine tells itself (MasterState)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

PHASES = {
    "wait_without_object": "ready, the hand is empty",
    "wait_with_object": "ready, holds an object",
    "wait_trigger": "waits for initialise",
    "stopped": "stopped",
    "fault": "fault",
    "set_dmp_goal": "sets the goal",
    "query_database": "looks the object up",
    "execute_dmp": "reaches",
    "wait_stop": "reaches",
    "hand_preshape": "shapes the hand",
    "hand_close": "closes the hand",
    "hand_tighten": "holds it firmly",
    "hand_open": "opens the hand",
    "hand_calibration": "calibrates the hand",
    "coglab_home_robot": "goes home",
    "move_to_board": "goes to the board",
    "leave_board": "leaves the board",
    "locate_object": "looks for the object",
    "free_places": "looks for a free place",
    "switch_to_dmp": "switches to the primitive",
    "switch_to_ptp": "switches to point-to-point",
    "end_motion": "ends the motion",
    "secure_hand": "secures the hand",
    "what_is_held": "finds out what it holds",
    "check_stop": "looks whether a stop is latched",
    "coglab_init_vision": "starts perception",
    "load_controllers": "loads the controllers",
    "load_dmps": "loads the primitives",
    "configure_lwr": "configures the arm",
}
IN_ACTION = {  # where the same state means something else in another action
    ("exchange_human_to_robot", "set_dmp_goal"): "waits until it is offered",
    ("exchange_robot_to_human", "set_dmp_goal"): "waits for the person's hand",
    ("exchange_human_to_robot", "wait_stop"): "reaches and receives",
    ("exchange_robot_to_human", "wait_stop"): "reaches and gives",
    ("exchange_robot_to_human", "hand_open"): "lets the person have it",
}


def phase(state: str) -> str:
    """Words for the path of a state."""
    labels = state.split("/")
    leaf = labels[-1]
    for action in labels:
        if (action, leaf) in IN_ACTION:
            return IN_ACTION[action, leaf]
    return PHASES.get(leaf, leaf.replace("_", " ")) or "no state"


def lookup(values: Mapping[str, Any], name: str) -> Any:
    """`a.b.c` in nested mappings; None if it is not there."""
    node: Any = values
    for part in name.split("."):
        if not isinstance(node, Mapping) or part not in node:
            return None
        node = node[part]
    return node
