"""Types of the compiled module. Shapes in brackets, units SI, joints in wire order."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import coglab_controllers as cc
import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
ArrayLike: TypeAlias = npt.ArrayLike
Jacobian: TypeAlias = cc.Chain | Callable[[Array], Array]
"""The chain to the palm, or a function from joint positions [7] (rad) to the palm's [3, 7] matrix (m/rad, base)."""

DECIDED: float
"""Probability that counts as a contact; one source at its threshold is sufficient."""
VARIANCE_FLOOR: float
"""Nm^2, lower limit of the variance of a change: in a noise-free simulation, rounding must not trigger."""

def probability(margin: float) -> float:
    """Probability of a contact from a margin (signal over threshold): 0.99 at 1."""

class Evidence:
    """Evidence of one source at one time (s), valid until ``until`` (s)."""

    def __init__(self, source: str, stamp: float, until: float, margin: float, message: str = "") -> None: ...
    @property
    def source(self) -> str: ...
    @property
    def stamp(self) -> float: ...
    @property
    def until(self) -> float: ...
    @property
    def margin(self) -> float:
        """Signal over threshold."""
    @property
    def message(self) -> str: ...
    @property
    def probability(self) -> float:
        """Probability of a contact from this source alone."""

class ContactEvent:
    """Contact detected (contact) or load released (not contact); fields of coglab_msgs/Contact."""

    def __init__(
        self, contact: bool, source: str, margin: float, message: str = "", confidence: float = 1.0, code: int = 0
    ) -> None: ...
    @property
    def contact(self) -> bool: ...
    @property
    def source(self) -> str: ...
    @property
    def margin(self) -> float:
        """Signal over threshold."""
    @property
    def message(self) -> str: ...
    @property
    def confidence(self) -> float:
        """Probability (0..1) that the signal is over its threshold, given the noise of the sensor."""
    @property
    def code(self) -> int:
        """ReasonCode of the message."""
    def __eq__(self, other: object) -> bool: ...

class Residual:
    """Result of the observer for one sample. Nm, rad, rad/s, rad/s^2; [7] each."""

    @property
    def stamp(self) -> float: ...
    @property
    def torque(self) -> Array:
        """Estimate of the external torque."""
    @property
    def position(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def acceleration(self) -> Array:
        """Low-passed like the estimate."""
    @property
    def rate(self) -> Array:
        """Derivative of the measured torque, Nm/s, low-passed; a lag of 1 s more subtracts it from the estimate."""
    @property
    def fresh(self) -> bool:
        """The observer has restarted: earlier estimates do not count."""

class MomentumObserver:
    """Processes consecutive samples. A sample that is not finite is left out. After a long gap or a set clock, a new
    estimate starts at zero: the torque that acts then counts as the arm's own."""

    def __init__(self, dynamics: Any, gain: float = 40.0, period: float = 0.0) -> None:
        """``dynamics``: see coglab_contact.momentum_observer.Dynamics. ``gain``: K, 1/s. ``period``: of the robot's
        measurements, s; the time between samples is a multiple of it. 0: the stamps are exact."""
    @property
    def gain(self) -> float: ...
    period: float
    lag: float
    """s by which the torques lag behind the positions of the same sample"""
    def reset(self) -> None:
        """Delete all past samples."""
    def set_payload(self, mass: float, centre: ArrayLike) -> None:
        """Set the payload (kg, m in the palm). The estimate restarts. ValueError: invalid mass."""
    def feed(self, stamp: float, position: ArrayLike, torque: ArrayLike, made: float | None = None) -> Residual | None:
        """Process one sample: s, rad, Nm. None until enough consecutive samples have come. ``made``: the robot's time
        (s) of the measurement, if known; then the stamp, which is late on a busy computer, is not used."""

class Change:
    """Change of the residual at one sample, Nm; the terms of its variance; the joint positions, rad."""

    def __init__(
        self,
        stamp: float,
        torque: ArrayLike,
        features: ArrayLike,
        rate: ArrayLike,
        position: ArrayLike,
        jacobian: ArrayLike,
    ) -> None: ...
    @property
    def stamp(self) -> float: ...
    @property
    def torque(self) -> Array: ...
    @property
    def features(self) -> Array:
        """[7, 6], see coglab_contact.motion_thresholds.FEATURES."""
    @property
    def rate(self) -> Array:
        """Nm/s, derivative of this change with respect to the lag: the torque's rate."""
    @property
    def position(self) -> Array: ...
    @property
    def jacobian(self) -> Array:
        """[3, 7] of the palm at this position."""

class Offset:
    """Residual at rest after a motion minus that before it, Nm [7], with the palm's Jacobian [3, 7] there."""

    def __init__(self, torque: ArrayLike, jacobian: ArrayLike) -> None: ...
    @property
    def torque(self) -> Array: ...
    @property
    def jacobian(self) -> Array: ...

def explained(torque: ArrayLike, deviation: ArrayLike, jacobian: ArrayLike) -> tuple[Array, float]:
    """Returns the force on the palm (N) [3] that explains joint torques (Nm), and its length in standard deviations."""

class MovingContact:
    """See coglab_contact.moving_contact.MovingContact, which adds the learnt thresholds."""

    def __init__(self, dynamics: Any, jacobian: Jacobian, period: float = 0.0) -> None: ...
    def set_thresholds(
        self, variance: ArrayLike, limit: float, steady: ArrayLike, steady_limit: float, lag: float
    ) -> None:
        """Use these values; see coglab_contact.motion_thresholds.Thresholds."""
    @property
    def observer(self) -> MomentumObserver: ...
    @property
    def load(self) -> float:
        """kg, set payload."""
    @property
    def residual(self) -> Residual | None:
        """Newest residual; None if the last sample was left out."""
    @property
    def change(self) -> Change | None:
        """Newest change."""
    def set_payload(self, mass: float, centre: ArrayLike = ...) -> None:
        """Set a payload of ``mass`` kg at ``centre`` (m, ih2_palm; default: its origin). The past is deleted, so that
        the arrival of the load is no contact. ValueError: invalid mass."""
    def feed(self, stamp: float, position: ArrayLike, torque: ArrayLike, made: float | None = None) -> None:
        """Process one measured sample: s, rad, Nm. ``made``: see MomentumObserver.feed."""
    def evidence(self) -> Evidence | None:
        """Returns the evidence of the newest samples. None without a reference mean, or if the last sample was left
        out."""
    def steady(self) -> Evidence | None:
        """Returns the evidence from the offset: an early touch leaves an offset before the detector was armed."""
    def still(self) -> bool:
        """True if the arm has stood still for 0.25 s."""
    def slow(self) -> bool:
        """True if the arm moves so slowly that errors of the model's inertia do not matter."""
    def offset(self) -> Offset | None:
        """Returns the recent mean residual minus that of the last rest before the motion; None without such a rest."""
    def offset_of_motion(self) -> Offset | None:
        """Returns the residual of this rest minus that of the rest before the motion; None while the arm moves."""
    def before_motion(self) -> Array | None:
        """Returns the mean residual (Nm) of the last rest before the present or last motion, or of this rest if the arm
        has not moved yet; None without such a rest."""
    def weight(self, residual: ArrayLike, position: ArrayLike) -> float:
        """Returns the weight (N) on the palm for a residual (Nm) at a position (rad): the downward part of the force
        that explains it best. A sideways pull is no weight."""
    def weight_since(self, before: ArrayLike) -> float:
        """Returns the weight (N) that has come to the palm since the residual was ``before`` (Nm), moving or not."""
    def weight_before_motion(self) -> float | None:
        """Returns the load (N) on the palm at the last rest before the present or last motion; None if unknown."""
    def force_since(self, before: ArrayLike) -> Array | None:
        """Returns the force (N) [3] on the palm in the base frame, relative to the residual ``before`` (Nm),
        extrapolated by 0.03 s. None before the first measurement."""

class RestTorque:
    """Joint torques (Nm) at rest. Pushing a resting arm and releasing it is a jolt, not a motion. The torque during a
    jolt does not count as rest without touch."""

    def __init__(self) -> None: ...
    @property
    def before_motion(self) -> Array | None:
        """Torque at the last rest before a motion larger than a jolt; None: there was none."""
    @property
    def travels(self) -> bool:
        """True during a motion that is larger than a jolt."""
    def move(self, gap: float, velocity: ArrayLike) -> None:
        """The arm moves with ``velocity`` (rad/s), ``gap`` s after the previous sample."""
    def stand(self) -> None:
        """The arm has just stopped."""
    def learn(self, torque: ArrayLike, gap: float) -> None:
        """Add a torque (Nm) of an arm that has stood for a while, ``gap`` s after the previous sample."""

class ContactDetector:
    """See coglab_contact.detector.ContactDetector, which adds look()."""

    def __init__(self, settings: Any, jacobian: Jacobian) -> None:
        """``settings``: coglab_contact.detector.DetectorSettings, read once."""
    def arm(
        self,
        mode: str,
        now: float,
        timeout: float,
        k: float = 0.0,
        joints: Sequence[int] = (),
        mass: float = 0.0,
        load_share: float = 0.0,
        carries: bool = False,
    ) -> None:
        """Watch for 'contact', 'load' or 'release' for ``timeout`` s, as soon as the arm stands still. ``joints``:
        1..7. ``carries``: the arm carries an object. After each motion its torque differs, so the offset against the
        previous rest is not checked. ValueError: invalid request."""
    def tune(self, settings: object) -> None:
        """Use these DetectorSettings from the next sample on; cutoff, window and learn_samples stay as they were."""
    def disarm(self) -> None:
        """Stop watching."""
    def learn(self) -> str:
        """Delete the noise at rest and learn it again from now on. Returns a sentence. ValueError if the arm moves or
        the detector is armed: the samples would not be noise."""
    def feed(self, stamp: float, torque: ArrayLike, position: ArrayLike, velocity: ArrayLike) -> ContactEvent | None:
        """Process one sample: torque (Nm), position (rad), velocity (rad/s), seven joints each. An impossible sample
        (not finite, too large, wrong length) is ignored."""
    def state(self) -> str:
        """Returns off, waiting (armed, but the arm moves or the rest was too short) or watching."""
    def still(self) -> bool:
        """True if the arm has stood still for ``settings.settle`` s."""
    def sigma(self) -> Array:
        """Returns the robust standard deviation (Nm) of the difference at rest, per joint; without data, the floor."""
    def take_largest(self) -> Array:
        """Returns the signed largest change (Nm) within the window since the last call."""
    @property
    def mode(self) -> str:
        """Mode for which it is armed; empty while it is off."""
    @property
    def margin(self) -> float: ...
    @property
    def k(self) -> float: ...
    @property
    def watched(self) -> list[int]:
        """Indices of the watched joints; empty while nothing is watched."""
    @property
    def rest_samples(self) -> int: ...
