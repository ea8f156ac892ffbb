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


def seen_in(cell: Any) -> tuple[WorldView, Pose]:
    """Returns the person's view of a cell, and the true pose of the person's hand. The felt load is the force on the
    person's own grip, even while the robot holds the object as well."""
    place, turn, closure, object_place, object_turn, force, hand, hand_turn = cell.view()
    return WorldView(Pose(place, turn), closure, Pose(object_place, object_turn), force), Pose(hand, hand_turn)


def move_person(cell: Any, hand: HandSample) -> None:
    """Moves the person's hand in the cell."""
    cell.set_human(hand.frame.position, hand.frame.orientation, hand.velocity, hand.spin, hand.grip, hand.grip_force)
