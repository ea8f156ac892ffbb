"""The path that the arm is going to take: before a motion from what the next action would aim at, during it from the
goal of the motion itself. A picture for people; nothing in control reads it. Lengths m, frames in the world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from .primitives import Primitive

ROLES = {
    "exchange_human_to_robot": "receive",
    "exchange_robot_to_human": "give",
    "take": "take",
}
REACH = 1.5  # m; what lies further away is no goal


def placed(pose: tuple[float, ...]) -> Pose:
    """Of (x, y, z, qx, qy, qz, qw)."""
    return Pose.from_dict({"xyz": pose[:3], "quaternion": pose[3:]})


def aim(
    action: str, entry: Mapping[str, Any], frames: Mapping[str, tuple[float, ...]]
) -> tuple[str, float, np.ndarray] | None:
    """Primitive, its ratio and where the palm would be at the end of the reach of this action; None if nobody knows.

    `entry`: of the object database; `frames`: poses in the world of `human_hand` and of the object's frame.
    """
    try:
        role = ROLES[action]
        grasp = entry["grasps"][entry["default_grasp"]]
        if role == "give":
            delivery = entry["deliveries"][entry["default_delivery"]]
            palm = placed(frames["human_hand"]) * Pose.from_dict(delivery["pose"]) * Pose.from_dict(grasp["pose"])
            goal = palm.position
        else:
            tracked = placed(frames[entry["frame"]])
            approach = grasp.get("approach", {})
            axis = np.asarray(approach.get("axis", [0.0, 0.0, 0.0]), dtype=float)
            back = axis / max(float(np.linalg.norm(axis)), 1e-9) * float(approach.get("distance", 0.0))
            goal = (tracked * Pose.from_dict(grasp["pose"])).position - tracked.rotation.apply(back)
        if not np.all(np.isfinite(goal)) or np.linalg.norm(goal) > REACH:
            return None
        return str(entry["dmp"][role]), float(entry["dmp"].get("dmp_ratio", 1.0)), goal
    except (KeyError, TypeError, ValueError, IndexError):
        return None


def document(kind: str, primitive: Primitive, start: np.ndarray, goal: np.ndarray, ratio: float) -> dict:
    """For the page: kind `ahead` or `running`, points, and when they are reached (s from the start)."""
    times, points = primitive.roll_out(start, goal, ratio)
    step = max(1, len(points) // 40)
    kept = [*range(0, len(points) - 1, step), len(points) - 1]
    return {
        "kind": kind,
        "primitive": primitive.name,
        "goal": [round(float(value), 3) for value in goal],
        "points": [[round(float(value), 3) for value in points[i]] for i in kept],
        "duration": round(float(times[-1]), 2),
    }
