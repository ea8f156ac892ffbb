"""What the phases of the virtual human share: the state that VirtualHuman makes, and how a phase ends."""

from __future__ import annotations

import numpy as np

from .participant import Participant
from .scene import Scene


class Phases:
    """Attributes of VirtualHuman that its phases use, and the two ways out of a phase (implemented there)."""

    participant: Participant
    scene: Scene
    phase: str
    _task: str
    _since: float
    _hand: np.ndarray
    _velocity: np.ndarray
    _grip: float
    _load_since: float | None
    _felt_since: float | None
    _travelled: float
    _height_in_palm: float

    def _go(self, phase: str, t: float) -> None:
        raise NotImplementedError

    def _retreat(self, t: float) -> None:
        raise NotImplementedError
