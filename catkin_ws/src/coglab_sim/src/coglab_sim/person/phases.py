"""What the phases of the virtual human share: the state that VirtualHuman makes, and how a phase ends."""

from __future__ import annotations

import numpy as np
from coglab_py.pose import Pose, length
from scipy.spatial.transform import Rotation

from coglab_sim.person.grip import GripForce
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene
from coglab_sim.person.senses import Percept

NEAR = 0.10
"""m below which the robot's hand is taken as arrived: between palm and offered object, or between the object in it and
the hand that is to take it"""
STILL = 0.02
"""m/s below which the robot's hand looks still"""
REGRIPS = 0.10
"""s in which fingers that had begun to open hold fast again"""


class Phases:
    """Attributes of VirtualHuman that its phases use, and the two ways out of a phase (implemented there)."""

    participant: Participant
    scene: Scene
    phase: str
    grip_force: GripForce
    _task: str
    _since: float
    _hand: np.ndarray
    _turn: Rotation
    _velocity: np.ndarray
    _grip: float
    _still_since: float | None
    _felt_since: float | None
    _sure_since: float | None
    _told: int
    _travelled: float
    _sunk: float
    _tries: int
    _held_load: np.ndarray
    _touched: np.ndarray
    _checked: bool
    _closure: float

    def _go(self, phase: str, t: float) -> None:
        raise NotImplementedError

    def _retreat(self, t: float) -> None:
        raise NotImplementedError

    def _middle(self) -> np.ndarray:
        """Where the middle of the object is that the hand holds: the person knows it without looking."""
        turned = Rotation.from_quat(self.scene.object_turn).apply(self.scene.object_middle)
        middle: np.ndarray = self._hand + self._turn.apply(self.scene.object_in_hand + turned)
        return middle

    def _gap(self, palm: Pose, place: Pose) -> float:
        """m between the robot's palm and the surface of the object at ``place``."""
        half = self.scene.object_size / 2
        beyond = np.abs(place.rotation.inv().apply(palm.position - place.position) - self.scene.object_middle) - half
        return length(np.maximum(beyond, 0.0))

    def _way_to(self, place: Pose) -> float:
        """m that the object at ``place`` is from where the hand would take it."""
        return length(place.position - self._turn.apply(self.scene.taken_in_hand) - self._hand)

    def _weight(self) -> float:
        """N, what the person knows the object to weigh."""
        return max(1e-3, self.grip_force.expected)

    def _load_share(self, seen: Percept) -> float:
        """Share of the weight that the person's hand carries as felt."""
        return float(-seen.load[2]) / self._weight()
