"""Interface between the person and the physics of the simulated cell: view of the world in, motion of the hand out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from coglab_py.pose import Pose

from coglab_sim.person.scene import HandSample, WorldView


def pose_of_truth(pose: Mapping[str, Any]) -> Pose:
    """Converts a pose of the cell's truth."""
    return Pose(np.asarray(pose["position"]), np.asarray(pose["rotation"]))


def view_of(truth: Mapping[str, Any]) -> WorldView:
    """Returns the person's view of the cell's truth. The felt load is the force on the person's own grip, even while
    the robot holds the object as well."""
    return WorldView(
        pose_of_truth(truth["robot_hand"]),
        float(truth["hand_closure"]),
        pose_of_truth(truth["object"]),
        np.asarray(truth["human_force"]),
    )


def move_person(cell: Any, hand: HandSample) -> None:
    """Moves the person's hand in the cell."""
    cell.set_human(hand.frame.position, hand.frame.orientation, hand.velocity, hand.spin, hand.grip, hand.grip_force)
