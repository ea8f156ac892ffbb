"""The person in the simulated cell: what the cell gives eyes and hand, and what the hand does there.

This is all that person and physics know of each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from coglab_sim.person.scene import HandSample, WorldView

GRAVITY = 9.81


def pose_of_truth(pose: Mapping[str, Any]) -> Pose:
    """A pose of the cell's truth."""
    return Pose(np.asarray(pose["position"]), np.asarray(pose["rotation"]))


def load_on_hand(in_hand: bool, palm_force: Sequence[float], mass: float) -> np.ndarray:
    """N, world axes: weight of what the person holds, and what the robot's hand does to it.

    ``palm_force``: of the object on the robot's hand. What the object does to one hand and to the other and its weight
    add up to nothing where it is not thrown about.
    """
    return -np.asarray(palm_force, dtype=float) - [0.0, 0.0, mass * GRAVITY] if in_hand else np.zeros(3)


def view_of(truth: Mapping[str, Any], mass: float) -> WorldView:
    """What there is to be seen and felt in the cell's truth; ``mass`` of the object."""
    in_hand = truth["held_by"] in ("human", "both")
    return WorldView(
        pose_of_truth(truth["robot_hand"]),
        float(truth["hand_closure"]),
        pose_of_truth(truth["object"]),
        load_on_hand(in_hand, truth["palm_force"], mass),
    )


def move_person(cell: Any, hand: HandSample) -> None:
    """The person's hand, for the cell."""
    cell.set_human(hand.frame.position, hand.frame.orientation, hand.velocity, hand.spin, hand.grip, hand.grip_force)
