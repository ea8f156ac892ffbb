"""Time series of one trial, of a running system or of a World, and the phases in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass
class Series:
    """Time series of one trial. Each row begins with its time t (s; of the steady clock for a running system)."""

    joints: list[tuple] = field(default_factory=list)  # (t, position[7], velocity[7])
    external_torques: list[tuple] = field(default_factory=list)  # (t, torque[7]) in Nm
    truth: list[tuple] = field(default_factory=list)  # (t, robot xyz, human xyz, object xyz, force on the robot's hand)
    poses: list[tuple] = field(default_factory=list)  # (t, palm, person's hand, object): true Poses in world
    fingers: list[tuple] = field(default_factory=list)  # (t, position[5])
    feedback: list[tuple] = field(default_factory=list)  # (t, state, remaining distance)
    transitions: list[tuple] = field(default_factory=list)  # (t, path, from, outcome, to, reason, code)
    contacts: list[tuple] = field(default_factory=list)  # (t, contact, margin, text of the detector)
    fri_lost: list[tuple] = field(default_factory=list)  # (t, FRI packets lost so far), from the bridge's diagnostics


def state_intervals(transitions: Sequence[tuple], end: float) -> dict[str, list[tuple[float, float, str]]]:
    """For each container: start, end and name of its states, from the transitions. Active states end at `end` (s)."""
    intervals: dict[str, list[tuple[float, float, str]]] = {}
    entered: dict[tuple[str, str], float] = {}  # (container, state) -> time
    begun: dict[str, float] = {}  # container -> time
    left = {(path, from_state) for _, path, from_state, *_ in transitions}
    for t, path, from_state, outcome, to_state, *_ in transitions:
        above = path  # a child of a concurrence begins with its container, without a transition
        while above and above not in begun:
            above = above.rpartition("/")[0]
        since = entered.pop((path, from_state), begun.get(above, transitions[0][0]))
        intervals.setdefault(path, []).append((since, t, from_state))
        # `to_state` is a sibling, not an outcome of the container: it is left later, or its name is not the outcome's
        if (path, to_state) in left or to_state != outcome:
            entered[path, to_state] = t
            begun[f"{path}/{to_state}"] = t
    for (path, state), since in entered.items():
        intervals.setdefault(path, []).append((since, end, state))
    return intervals
