"""Computes goals of the DMP from database entries; pure geometry, tested without any machine.

In user data, a goal consists of plain types: ``{frame, offset [m], orientation [x y z w], primitive, dmp_ratio}``.
Offset and orientation are the pose of ``ih2_palm`` relative to ``frame``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

WHOLE_HAND = "cylindrical"  # mode in which palm and all fingers hold; the other modes use the fingertips
ROOM = 0.12  # m, distance between palm and the person's hand from which on there is enough room
CLOSE_ENOUGH = 0.2  # cost, advantage that another grasp needs to replace the chosen one


def _goal(frame: str, palm: Pose, entry: Mapping[str, Any], role: str) -> dict[str, Any]:
    dmp = entry["dmp"]
    return {
        "frame": frame,
        "offset": palm.to_dict()["xyz"],
        "orientation": palm.to_dict()["quaternion"],
        "primitive": dmp[role],
        "dmp_ratio": float(dmp.get("dmp_ratio", 1.0)),
    }


def palm_at_grasp(grasp: Mapping[str, Any], standoff: float | None = None) -> Pose:
    """Returns the palm at the grasp in the object frame, moved back by ``standoff`` m against the approach axis
    (default: the stored distance)."""
    palm = Pose.from_dict(grasp["pose"])
    approach = grasp.get("approach", {})
    distance = float(approach.get("distance", 0.0)) if standoff is None else standoff
    if distance == 0.0:
        return palm
    axis = np.asarray(approach.get("axis", palm.axis(0)), dtype=float)
    return Pose(palm.position - distance * axis / np.linalg.norm(axis), palm.orientation)


def approach_of(grasp: Mapping[str, Any], length: float) -> list[float]:
    """Returns the last ``length`` m of the path to the grasp, along its approach axis (m, object frame)."""
    axis = np.asarray(grasp.get("approach", {}).get("axis", Pose.from_dict(grasp["pose"]).axis(0)), dtype=float)
    return [float(value) for value in length * axis / np.linalg.norm(axis)]


def grasp_goal(
    entry: Mapping[str, Any], grasp: Mapping[str, Any], frame: str, role: str, standoff: float | None = None
) -> dict[str, Any]:
    """Returns the goal at the grasp pose relative to the object's tracked frame. ``role`` selects the primitive."""
    return _goal(frame, palm_at_grasp(grasp, standoff), entry, role)


def delivery_goal(
    entry: Mapping[str, Any], grasp: Mapping[str, Any], delivery: Mapping[str, Any], frame: str
) -> dict[str, Any]:
    """Returns the goal that offers the held object in its delivery pose relative to the frame of the person's hand."""
    return _goal(frame, Pose.from_dict(delivery["pose"]) * palm_at_grasp(grasp, 0.0), entry, "give")


def place_goal(
    entry: Mapping[str, Any], grasp: Mapping[str, Any], place: Mapping[str, Any], role: str, clearance: float = 0.0
) -> dict[str, Any]:
    """Returns the goal on the board: the palm at the grasp of an object with the pose ``place`` in the board frame.

    ``role`` take: the object is there; put: the held object is to be placed there. ``clearance`` (m): distance of
    the palm from the grasp.
    """
    return _goal(place["frame"], Pose.from_dict(place) * palm_at_grasp(grasp, clearance), entry, role)


def cost(grasp: Mapping[str, Any], seen: Pose, person: np.ndarray | None, start: np.ndarray | None) -> float:
    """Returns the cost of a grasp for an object at pose ``seen`` in the base frame.

    The cost counts: fingertips instead of the whole hand; too little room beside the person's hand (``person``: m, None
    if not seen); a palm that points away from its path to the object (``start``: m, present palm; None if unknown).
    """
    palm = seen * palm_at_grasp(grasp, 0.0)
    total = 0.0 if grasp["hand"]["mode"] == WHOLE_HAND else 1.0
    if person is not None:
        total += max(0.0, 1.0 - float(np.linalg.norm(palm.position - person)) / ROOM)
    if start is not None:
        way = palm.position - start
        facing = float(palm.axis(0) @ way) / max(1e-9, float(np.linalg.norm(way)))
        total += float(np.arccos(np.clip(facing, -1.0, 1.0))) / np.pi
    return total


def ranked(
    entry: Mapping[str, Any], seen: Pose, person: np.ndarray | None, start: np.ndarray | None, chosen: str = ""
) -> list[str]:
    """Returns the names of the object's grasps, best first. ``chosen`` stays first unless another grasp is clearly
    better: otherwise noise would switch the hand between two shapes."""
    costs = {name: cost(grasp, seen, person, start) for name, grasp in entry["grasps"].items()}
    if chosen in costs:
        costs[chosen] -= CLOSE_ENOUGH
    return sorted(costs, key=lambda name: costs[name])
