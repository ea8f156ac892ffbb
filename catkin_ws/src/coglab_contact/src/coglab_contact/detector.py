"""Detects contact and release in the estimated external joint torques (D4.10 section 3.2).

Contact: the change of the low-passed torque within a short window, so that the bias of the estimate cancels. It is
compared with a threshold learnt at rest, on the joints that are sensitive to forces across the line from person to
robot. Load and release: the vertical force that explains the change of torque is compared with a share of the object's
weight. Load counts from the torque before the contact, release from the torque on arming.

It works only while the arm stands still, and checks that itself. It is C++: see
include/coglab_contact/contact_detector.hpp.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import coglab_controllers as cc
import numpy as np

from coglab_contact import _core
from coglab_contact._core import RestTorque

__all__ = ["ContactDetector", "DetectorSettings", "Joints", "RestTorque", "Signal"]

Joints = Sequence[float] | np.ndarray
"""seven numbers, one per joint in wire order"""


@dataclass
class DetectorSettings:
    """Settings. The defaults reach the sensitivities in the documentation for 0.05 Nm sensor noise."""

    cutoff: float = 20.0
    """Hz, low-pass before the difference"""
    window: float = 0.04
    """s, length of the window of the difference"""
    still_speed: float = 0.02
    """rad/s; the arm moves if a joint is faster"""
    settle: float = 0.25
    """s of standstill before detection starts: the vibration of the stop must decay"""
    k: float = 6.0
    """threshold in robust standard deviations, learnt at rest"""
    confirm: int = 3
    """number of consecutive samples over the threshold"""
    learn_samples: int = 100
    """number of samples at rest before arming takes effect"""
    floor: float = 0.02
    """Nm, lower limit of the standard deviation: in a noise-free simulation, rounding must not trigger"""
    offset_threshold: float = 1.2
    """Nm, offset against the last rest before the motion; a larger offset on arming is an early contact"""
    sensitivity_share: float = 0.5
    """joints with at least this share of the most sensitive joint's lever are watched"""
    load_share: float = 0.5
    """default share of the weight whose arrival counts as load and whose loss counts as release"""
    release_confirm: float = 0.05
    """s for which the load must be gone"""
    load_confirm: float = 0.3
    """s for which the load must be present: a holding hand presses down now and then"""
    user_direction: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """direction from the robot to the person, base frame"""


TUNABLE = {
    "k": (2.0, 20.0, "threshold in robust standard deviations, learnt at rest"),
    "floor": (0.001, 0.5, "Nm, lower limit of the standard deviation"),
    "still_speed": (0.001, 0.2, "rad/s; the arm moves if a joint is faster"),
    "settle": (0.0, 2.0, "s of standstill before detection starts"),
    "offset_threshold": (0.1, 10.0, "Nm, offset against the last rest that counts as an early contact"),
    "sensitivity_share": (0.0, 1.0, "joints with this share of the largest lever are watched"),
    "load_share": (0.05, 1.0, "share of the weight whose arrival counts as load and whose loss counts as release"),
    "release_confirm": (0.0, 1.0, "s for which the load must be gone"),
    "load_confirm": (0.0, 2.0, "s for which the load must be present"),
}
"""settings that may change at run time: smallest and largest value, meaning"""


@dataclass(frozen=True)
class Signal:
    """State of the detector, for tuning. Joints in wire order."""

    state: str
    mode: str
    """mode for which it is armed; empty while it is off"""
    change: tuple[float, ...]
    """Nm, signed largest change within the window since the last look()"""
    threshold: tuple[float, ...]
    """Nm"""
    watched: tuple[bool, ...]
    k: float
    margin: float
    rest_samples: int


class ContactDetector(_core.ContactDetector):
    """Processes every torque sample. Returns at most one event per arming. Times in s on one clock."""

    def __init__(self, settings: DetectorSettings, jacobian: cc.Chain | Callable[[np.ndarray], np.ndarray]) -> None:
        """``jacobian``: the chain to the palm, or a function from joint positions (rad) to the palm's 3 x 7 matrix."""
        super().__init__(settings, jacobian)
        self.settings = settings

    def use(self, settings: DetectorSettings) -> None:
        """Use these settings from the next sample on. `cutoff`, `window` and `learn_samples` stay as they were."""
        self.tune(settings)
        self.settings = settings

    def look(self) -> Signal:
        """Returns the present state. The largest change is reset."""
        watched, state = self.watched or range(7), self.state()
        return Signal(
            state,
            self.mode,
            tuple(map(float, self.take_largest())),
            tuple(map(float, self.k * self.sigma())),
            tuple(j in watched for j in range(7)),
            self.k,
            self.margin if state == "watching" else 0.0,
            self.rest_samples,
        )
