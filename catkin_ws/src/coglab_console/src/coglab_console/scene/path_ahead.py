"""The predicted path of the arm, from the controllers: of the running motion, or of the next action's motion. A picture
for people; nothing in control reads it. Lengths m."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

ROLES = {
    "exchange_human_to_robot": "receive",
    "exchange_robot_to_human": "give",
    "take": "take",
}
LONGEST = 160  # characters of a reason
UNSEEN = re.compile(r"goal frame '(?:object_(\w+)|human_hand)' is not known")


def aim(action: str, entry: Mapping[str, Any], hand_frame: str) -> dict[str, Any] | None:
    """Fields of predict_dmp for the reach of this action, as the brain would request it; None if the entry lacks them.

    `entry`: entry of the object database; `hand_frame`: tf2 frame of the person's hand.
    """
    try:
        role = ROLES[action]
        grasp = entry["grasps"][entry["default_grasp"]]
        palm = Pose.from_dict(grasp["pose"])
        if role == "give":
            delivery = entry["deliveries"][entry["default_delivery"]]
            frame, palm = hand_frame, Pose.from_dict(delivery["pose"]) * palm
        else:
            frame, palm = str(entry["frame"]), drawn_back(palm, grasp.get("approach", {}))
        return {
            "primitive_id": str(entry["dmp"][role]),
            "dmp_ratio": float(entry["dmp"].get("dmp_ratio", 1.0)),
            "goal_frame": frame,
            "goal_offset": [float(value) for value in palm.position],
            "orientation_control": True,
            "target_orientation": [float(value) for value in palm.orientation],
        }
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        return None


def drawn_back(palm: Pose, approach: Mapping[str, Any]) -> Pose:
    """The palm before it closes in on the object, in the same frame."""
    distance = float(approach.get("distance", 0.0))
    if distance == 0.0:
        return palm
    axis = np.asarray(approach.get("axis", palm.axis(0)), dtype=float)
    return Pose(palm.position - distance * axis / np.linalg.norm(axis), palm.orientation)


def document(kind: str, path: Any, base: np.ndarray) -> dict:
    """Document for the page: kind `ahead` or `running`, points in the world, and their times (s after `stamp`).

    `path`: coglab_msgs/PredictedPath with poses; `base`: 4 x 4, pose of its frame in the world.
    """
    places = np.array([(pose.position.x, pose.position.y, pose.position.z) for pose in path.poses])
    points = np.round(places @ base[:3, :3].T + base[:3, 3], 4).tolist()
    return {
        "kind": kind,
        "motion": path.motion[:60],
        "stamp": round(path.header.stamp.to_sec(), 3),
        "goal": points[-1],
        "points": points,
        "times": [round(float(time), 3) for time in path.times],
    }


def refused(reason: str) -> dict:
    """Document for the page: the next motion would be refused. An unknown goal frame is shown as an unseen thing."""
    unknown = UNSEEN.match(reason)
    words = f"{unknown[1] or 'the hand of the person'} is not seen" if unknown else reason.split(";")[0][:LONGEST]
    return {"kind": "refused", "reason": words, "points": []}
