"""Goals of the DMP from database entries: pure geometry, tested without any machine.

A goal travels in user data as plain types: ``{frame, offset [m], orientation [x y z w], primitive, dmp_ratio}``; offset
and orientation are the pose of ``ih2_palm`` relative to ``frame``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

WHOLE_HAND = "cylindrical"  # mode in which palm and all fingers hold; others hold with fingertips
ROOM = 0.12  # m between palm and the person's hand from which on they do not meet
CLOSE_ENOUGH = 0.2  # cost by which another grasp has to be better before it replaces the one that was chosen


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
    """Palm in the object frame at the grasp, drawn back by ``standoff`` m against the approach axis
    (default: as stored)."""
    palm = Pose.from_dict(grasp["pose"])
    approach = grasp.get("approach", {})
    distance = float(approach.get("distance", 0.0)) if standoff is None else standoff
    if distance == 0.0:
        return palm
    axis = np.asarray(approach.get("axis", palm.axis(0)), dtype=float)
    return Pose(palm.position - distance * axis / np.linalg.norm(axis), palm.orientation)


def approach_of(grasp: Mapping[str, Any], length: float) -> list[float]:
    """m, object frame: the last ``length`` m of the way to the grasp, along its approach axis."""
    axis = np.asarray(grasp.get("approach", {}).get("axis", Pose.from_dict(grasp["pose"]).axis(0)), dtype=float)
    way: list[float] = (length * axis / np.linalg.norm(axis)).tolist()
    return way


def grasp_goal(
    entry: Mapping[str, Any], grasp: Mapping[str, Any], frame: str, role: str, standoff: float | None = None
) -> dict[str, Any]:
    """Goal at the grasp pose relative to the object's tracked frame. ``role`` names the primitive."""
    return _goal(frame, palm_at_grasp(grasp, standoff), entry, role)


def delivery_goal(
    entry: Mapping[str, Any], grasp: Mapping[str, Any], delivery: Mapping[str, Any], frame: str
) -> dict[str, Any]:
    """Goal that offers the held object in its delivery pose relative to the human hand frame."""
    return _goal(frame, Pose.from_dict(delivery["pose"]) * palm_at_grasp(grasp, 0.0), entry, "give")


def place_goal(
    entry: Mapping[str, Any], grasp: Mapping[str, Any], place: Mapping[str, Any], role: str, clearance: float = 0.0
) -> dict[str, Any]:
    """Goal on the board: the palm at the grasp of an object whose pose in the board frame is ``place``.

    ``role`` take: the object is there; put: it is held and is to be set down there. ``clearance`` (m) keeps
    the palm off.
    """
    return _goal(place["frame"], Pose.from_dict(place) * palm_at_grasp(grasp, clearance), entry, role)


def cost(grasp: Mapping[str, Any], seen: Pose, person: np.ndarray | None, start: np.ndarray | None) -> float:
    """Of taking an object ``seen`` in the base frame by this grasp.

    Fingertips instead of the whole hand; too little room beside the person's hand (``person``: m, None where it is not
    seen); a palm that turns away from the way to the object (``start``: m, where the palm is now, None: not known).
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
    """Names of the object's grasps, best first. ``chosen``: stays first while none is clearly better, so that noise
    does not change the hand's shape to and fro."""
    costs = {name: cost(grasp, seen, person, start) for name, grasp in entry["grasps"].items()}
    if chosen in costs:
        costs[chosen] -= CLOSE_ENOUGH
    return sorted(costs, key=lambda name: costs[name])
