"""Types of the compiled module. Shapes in brackets, units SI, world axes."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from coglab_perception.reach_bank import ReachSettings

Array: TypeAlias = npt.NDArray[np.float64]

class Prediction:
    """Where and when the hand comes to rest, from the motions toward a handover."""

    @property
    def end(self) -> Array:
        """m (3,)."""
    @property
    def covariance(self) -> Array:
        """m^2 (3, 3), of the end."""
    @property
    def arrival(self) -> float:
        """s, stamp."""
    @property
    def arrival_deviation(self) -> float:
        """s."""
    @property
    def onset(self) -> float:
        """s, stamp at which the motion began."""

class ReachBank:
    """Hypotheses for one hand. Call step() with each observation, in the order of stamps."""

    def __init__(self, stamp: float, position: npt.ArrayLike, settings: ReachSettings) -> None:
        """Begins with a hand seen at `position` (m, (3,)) at `stamp` (s). ValueError if they are not finite."""
    def step(self, stamp: float, position: npt.ArrayLike) -> bool:
        """Processes an observation. False if it does not show this hand or is impossible for a hand; then only the
        prediction to the stamp is done. ValueError if it is not finite."""
    def forget(self) -> None:
        """Counts every motion toward a handover as another motion from now on."""
    def position(self) -> Array:
        """Expected current position (m, (3,)), without the tracker's error."""
    def velocity(self) -> Array:
        """Expected current velocity (m/s, (3,))."""
    def prediction(self) -> Prediction | None:
        """Prediction of the handover; None if no hypothesis of a motion toward one is left."""
    @property
    def handover(self) -> float:
        """Probability that the hand moves toward a handover or waits at one, 0..1."""
    @property
    def stamp(self) -> float:
        """s, of the newest observation."""
    def __len__(self) -> int:
        """Number of hypotheses."""

def transition(remaining: float, step: float) -> Array:
    """(3, 4): position, velocity and acceleration (m, m/s, m/s^2) after `step` s of a minimum-jerk motion, from
    position, velocity, acceleration and end (m), `remaining` s before the end. A motion that ends within the step rests
    at its end. A step <= 0 changes nothing."""
