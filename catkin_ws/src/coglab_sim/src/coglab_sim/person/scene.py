"""Plain data of the virtual human: scene, view of the world and state of the hand. Frames in world, SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from coglab_objects.database import objects_folder, read_object
from coglab_py.pose import IDENTITY, Pose

FROM_HAND = 0.04  # m between the middle of the person's palm and the surface of the held object
HANDOVER = np.array([0.78, 0.03, 0.44])  # m, nominal position of the object's middle at a handover
BOX = np.array([[0.72, -0.12, 0.34], [0.81, 0.16, 0.51]])
"""m, opposite corners of the handover region (object's middle) of people with the profiles patient and accustomed"""


def shipped(object_id: str) -> dict[str, Any]:
    """Returns the entry of an object in the shipped database."""
    return read_object(objects_folder() / f"{object_id}.yaml")[0]


@dataclass
class Scene:
    """Places and the object of a handover.

    The hand frame is parallel to world at rest. In it the person holds an object at ``object_in_hand`` and takes one at
    ``taken_in_hand`` (m). The object frame lies in the middle of the underside.
    """

    rest: np.ndarray = field(default_factory=lambda: np.array([1.30, 0.20, 0.15]))
    handover_object: np.ndarray = field(default_factory=lambda: np.array([0.78, 0.03, 0.39]))
    """nominal position of the object at a handover"""
    region_low: np.ndarray = field(default_factory=lambda: BOX[0] - [0, 0, 0.05])
    region_high: np.ndarray = field(default_factory=lambda: BOX[1] - [0, 0, 0.05])
    object_in_hand: np.ndarray = field(default_factory=lambda: np.array([-0.08, 0.0, -0.05]))
    object_turn: np.ndarray = field(default_factory=lambda: np.array(IDENTITY))
    """quaternion of the held object in the hand"""
    taken_in_hand: np.ndarray = field(default_factory=lambda: np.array([-0.08, 0.0, -0.05]))
    object_mass: float = 0.31
    """kg"""
    object_friction: float = 0.6
    object_size: np.ndarray = field(default_factory=lambda: np.array([0.08, 0.08, 0.10]))
    """m, along the axes of the object frame"""
    other_side: float = -0.16
    """m, lateral shift of the handover point with the behaviour `change_side`"""

    @property
    def object_middle(self) -> np.ndarray:
        """m, middle of the object in its own frame"""
        return np.array([0.0, 0.0, self.object_size[2] / 2])

    @staticmethod
    def of(entry: Mapping[str, Any], mass: float = 1.0, friction: float = 1.0) -> Scene:
        """Returns the scene with an object of the database; ``mass`` and ``friction`` are factors on its values.

        People hold an object at its middle and take it at the part that the entry's default delivery leaves free.
        """
        size = np.array([float(v) for v in entry["size"]])
        half = size[2] / 2
        away = -(float(size[0]) / 2 + FROM_HAND)
        free = float(entry["deliveries"][entry["default_delivery"]]["pose"]["xyz"][2])
        return Scene(
            handover_object=HANDOVER - [0, 0, half],
            region_low=BOX[0] - [0, 0, half],
            region_high=BOX[1] - [0, 0, half],
            object_in_hand=np.array([away, 0.0, -half]),
            taken_in_hand=np.array([away, 0.0, free]),
            object_mass=mass * float(entry["mass"]),
            object_friction=friction * float(entry["friction"]),
            object_size=size,
        )


@dataclass(frozen=True)
class WorldView:
    """True state of the world at one moment. senses.Senses converts it into the person's percept."""

    robot_hand: Pose = field(default_factory=Pose)
    hand_closure: float = 0.0
    """closure of the robot's fingers by their joint angles, 0 open .. 1 closed"""
    object: Pose = field(default_factory=Pose)
    load: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """N, force of the held object on the person's hand, world axes"""


@dataclass
class HandSample:
    """State of the person's hand: frame, velocity (m/s), spin (rad/s), grip 0..1, force at full grip (N), phase."""

    frame: Pose
    velocity: np.ndarray
    grip: float
    grip_force: float
    phase: str
    spin: np.ndarray = field(default_factory=lambda: np.zeros(3))
