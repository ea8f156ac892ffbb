"""Which of an object's grasps the robot takes it by, from a person: pure geometry, tested without any machine.

Each part of a grasp's cost is a number from 0 (nothing against it) to about 1, and all weigh the same. Whether the arm
has a posture for a grasp is asked by the caller, in the order that is answered here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from coglab_smach.kinematics.goals import palm_at_grasp

WHOLE_HAND = "cylindrical"
"""mode in which palm and all fingers hold; the others hold with fingertips, and want the object placed exactly"""
ROOM = 0.12  # m between palm and the person's hand from which on they do not meet
CLOSE_ENOUGH = 0.2  # cost by which another grasp has to be better before it replaces the one that was chosen


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
