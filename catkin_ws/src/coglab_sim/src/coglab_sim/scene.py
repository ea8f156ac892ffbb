"""What the virtual human is put into, sees, and shows: plain data. All frames in world, SI units."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from coglab_objects.database import objects_folder, read_object
from coglab_py.pose import Pose


def mass_of(object_id: str) -> float:
    """kg, of an object of the database that is shipped."""
    return float(read_object(objects_folder() / f"{object_id}.yaml")[0]["mass"])


@dataclass
class Scene:
    """Where things are. The hand frame is world-aligned; a held object sits at ``object_in_hand`` in it."""

    rest: np.ndarray = field(default_factory=lambda: np.array([1.30, 0.20, 0.15]))
    handover_object: np.ndarray = field(default_factory=lambda: np.array([0.78, 0.03, 0.39]))
    """nominal position of the object at a handover"""
    region_low: np.ndarray = field(default_factory=lambda: np.array([0.72, -0.12, 0.29]))
    region_high: np.ndarray = field(default_factory=lambda: np.array([0.81, 0.16, 0.46]))
    object_in_hand: np.ndarray = field(default_factory=lambda: np.array([-0.08, 0.0, -0.05]))
    object_mass: float = field(default_factory=lambda: mass_of("mug"))
    """kg, of the object that is handed over"""
    other_side: float = -0.16
    """m, lateral shift of the handover point by a person who changes side"""


@dataclass
class WorldView:
    """What the person perceives at one moment."""

    robot_hand: Pose = field(default_factory=Pose)
    robot_speed: float = 0.0
    object: Pose = field(default_factory=Pose)
    palm_force: float = 0.0
    robot_load_share: float = 0.0
    human_load_share: float = 0.0
    held_by: str = "human"


@dataclass
class HandSample:
    """The person's hand now: frame, velocity (m/s), grip 0..1, grip force at full closure (N), phase."""

    frame: Pose
    velocity: np.ndarray
    grip: float
    grip_force: float
    phase: str
