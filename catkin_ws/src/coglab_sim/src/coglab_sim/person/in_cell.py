"""The person in the simulated cell: what the cell gives eyes and hand, and what the hand does there.

This is all that person and physics know of each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from coglab_sim.person.scene import HandSample, WorldView


def pose_of_truth(pose: Mapping[str, Any]) -> Pose:
    """A pose of the cell's truth."""
    return Pose(np.asarray(pose["position"]), np.asarray(pose["rotation"]))


def view_of(truth: Mapping[str, Any]) -> WorldView:
    """What there is to be seen and felt in the cell's truth. What is felt of the object is the force that the person's
    own grip carries, even where the robot holds it, too."""
    return WorldView(
        pose_of_truth(truth["robot_hand"]),
        float(truth["hand_closure"]),
        pose_of_truth(truth["object"]),
        np.asarray(truth["human_force"]),
    )


def move_person(cell: Any, hand: HandSample) -> None:
    """The person's hand, for the cell."""
    cell.set_human(hand.frame.position, hand.frame.orientation, hand.velocity, hand.spin, hand.grip, hand.grip_force)
