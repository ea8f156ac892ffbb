"""External joint torques of a moving arm without accelerations: a momentum observer (De Luca, Haddadin).

The observer is C++: its equation and its source are in include/coglab_contact/momentum_observer.hpp. A model of the arm
is a coglab_controllers.ArmDynamics, or an object in Python with the same two methods.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from coglab_contact._core import MomentumObserver, Residual

__all__ = ["Dynamics", "Joints", "MomentumObserver", "Residual", "Terms"]

Joints = Sequence[float] | np.ndarray
"""seven numbers, one per joint in wire order"""


class Terms(Protocol):
    """Rigid-body terms at one posture and velocity; see coglab_controllers.DynamicTerms."""

    @property
    def momentum(self) -> np.ndarray:
        """M q', kg m^2/s."""

    @property
    def transposed(self) -> np.ndarray:
        """C^T q', Nm."""

    @property
    def gravity(self) -> np.ndarray:
        """g, Nm."""


class Dynamics(Protocol):
    """Model of the arm; see coglab_controllers.ArmDynamics."""

    def evaluate(self, q: np.ndarray, velocity: np.ndarray) -> Terms:
        """Returns the terms at q (rad) and velocity (rad/s)."""

    def set_payload(self, mass: float, centre: np.ndarray) -> None:
        """Set a point mass of ``mass`` kg at ``centre`` (m, frame of the palm)."""
