"""Phases in words, and the time limit of what the machine waits for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

PHASES = {
    "wait_without_object": "ready, the hand is empty",
    "wait_with_object": "ready, holds an object",
    "wait_trigger": "waits for initialise",
    "stopped": "stopped",
    "fault": "fault",
    "set_dmp_goal": "waits until it is offered",
    "query_database": "looks the object up",
    "execute_dmp": "reaches",
    "wait_stop": "waits for contact",
    "hand_preshape": "shapes the hand",
    "hand_close": "closes the hand, waits for the load",
    "hand_open": "waits for the person to take it",
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
_LIMITS = {  # names in the configuration of the machines
    "set_dmp_goal": "handover.offer_timeout",
    "wait_stop": "contact_timeout",
    "hand_open": "release_timeout",
    "hand_close": "hand.load_timeout",
    "wait_trigger": "trigger_timeout",
    "locate_object": "perception.locate_timeout",
    "free_places": "perception.locate_timeout",
}


def phase(state: str) -> str:
    """Words for the path of a state."""
    leaf = state.rsplit("/", 1)[-1]
    return PHASES.get(leaf, leaf.replace("_", " ")) or "no state"


def lookup(values: Mapping[str, Any], name: str) -> Any:
    """`a.b.c` in nested mappings; None if it is not there."""
    node: Any = values
    for part in name.split("."):
        if not isinstance(node, Mapping) or part not in node:
            return None
        node = node[part]
    return node


def time_limit(state: str, config: Mapping[str, Any], entry: Mapping[str, Any]) -> float | None:
    """s that the machine waits in this state, from its configuration and the object's entry; None if it is not told."""
    leaf = state.rsplit("/", 1)[-1]
    own = lookup(config, f"time_limits.{leaf}")
    if leaf == "wait_stop":
        own = lookup(entry, "contact.timeout") or own
    if leaf == "hand_open":
        own = lookup(entry, f"deliveries.{entry.get('default_delivery', '')}.release.timeout") or own
    value = own if own is not None else lookup(config, _LIMITS.get(leaf, "?"))
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None
