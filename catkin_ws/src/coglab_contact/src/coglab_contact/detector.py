"""Detects contact and release in the estimated external joint torques (D4.10 section 3.2).

Contact: the change of the low-passed torque within a short window, so that the bias of the estimate cancels. It is
compared with a threshold learnt at rest, on the joints that are sensitive to forces across the line from person to
robot. Load and release: the vertical force that explains the change of torque is compared with a share of the object's
weight. Load counts from the torque before the contact, release from the torque on arming.

The detector works only while the arm stands still, and checks that itself.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from coglab_msgs.msg import ReasonCode

from coglab_contact.evidence import ContactEvent

JOLT = 0.02  # rad, largest joint motion when somebody pushes a resting arm, or releases it
REMEMBERED = 0.25  # s, average time of the torque at rest, at any sample period: a push of this length is not forgotten

Joints = Sequence[float] | np.ndarray
"""seven numbers, one per joint in wire order"""

GRAVITY = 9.81  # m/s^2
MAD_TO_SIGMA = 1.4826  # ratio of standard deviation to median absolute deviation, for normal noise
LARGEST = 1e4  # Nm, rad, rad/s: larger values cannot come from an arm
LONGEST_STEP = 1.0  # s, longest time between two consecutive samples


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


def sensitive_joints(jacobian: np.ndarray, user_direction: Sequence[float], share: float) -> list[int]:
    """Returns the indices of the joints whose torque is most sensitive to forces across the line from person to robot.

    ``jacobian``: 3 x n (m/rad). The lever of joint j is the norm of its column without the part along
    ``user_direction``.
    """
    d = np.asarray(user_direction, dtype=float)
    d = d / np.linalg.norm(d)
    across = jacobian - np.outer(d, d @ jacobian)
    lever = np.linalg.norm(across, axis=0)
    return [int(j) for j in np.flatnonzero(lever >= share * lever.max())]


def confidence(deviations: float) -> float:
    """Probability (0..1) that a signal is over its threshold if it was measured ``deviations`` standard deviations
    above it, for normal noise."""
    return 0.5 * (1.0 + math.erf(deviations / math.sqrt(2.0)))


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


@dataclass
class _Armed:
    mode: str
    until: float
    k: float
    joints: list[int] | None
    mass: float
    load_share: float
    carries: bool = False
    baseline: np.ndarray | None = None
    before: np.ndarray | None = None
    """baseline before somebody jolted the arm"""
    watched: list[int] = field(default_factory=list)
    threshold: np.ndarray | None = None
    over: int = 0
    gone_since: float | None = None

    def stir(self, travels: bool) -> None:
        """The arm does not rest any more: take a new baseline later."""
        self.before = None if travels else self.baseline if self.before is None else self.before
        self.baseline, self.over = None, 0


class RestTorque:
    """Joint torques (Nm) at rest. Pushing a resting arm and releasing it is a jolt, not a motion. The torque during a
    jolt does not count as rest without touch."""

    def __init__(self) -> None:
        self.before_motion: np.ndarray | None = None
        """torque at the last rest before a motion larger than a jolt; None: there was none"""
        self._here: np.ndarray | None = None
        self._left: np.ndarray | None = None
        self._travelled: np.ndarray | None = None  # rad, travel since the last rest; None: at rest

    def move(self, gap: float, velocity: Sequence[float] | np.ndarray) -> None:
        """The arm moves with ``velocity`` (rad/s), ``gap`` s after the previous sample."""
        if self._travelled is None:
            self._left, self._travelled = self._here, np.zeros(7)
        self._travelled = self._travelled + gap * np.asarray(velocity)
        if self._left is not None and self.travels:
            self.before_motion = self._left

    @property
    def travels(self) -> bool:
        """True during a motion that is larger than a jolt."""
        return self._travelled is not None and bool(np.abs(self._travelled).max() > JOLT)

    def stand(self) -> None:
        """The arm has just stopped."""
        self._here = self._travelled = None

    def learn(self, torque: np.ndarray, gap: float) -> None:
        """Add a torque (Nm) of an arm that has stood for a while, ``gap`` s after the previous sample."""
        share = min(1.0, gap / REMEMBERED)
        self._here = torque if self._here is None else self._here + share * (torque - self._here)


class ContactDetector:
    """Processes every torque sample. Returns at most one event per arming. Times in s on one clock."""

    def __init__(self, settings: DetectorSettings, jacobian: Callable[[Joints], np.ndarray]) -> None:
        self.settings = settings
        self._jacobian = jacobian
        self._armed: _Armed | None = None
        self._filtered: np.ndarray | None = None
        self._history: deque[tuple[float, np.ndarray]] = deque()
        self._rest_differences: deque[np.ndarray] = deque(maxlen=400)
        self._last_stamp: float | None = None
        self._odd_stamp: float | None = None  # stamp of the last sample that did not follow the previous one
        self._still_since: float | None = None
        self._rest, self._gap = RestTorque(), 0.0  # gap: s between the last two samples
        self._unloaded: np.ndarray | None = None
        self.margin = 0.0
        self._largest: np.ndarray = np.zeros(7)

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
        if mode not in ("contact", "load", "release"):
            raise ValueError(f"mode is contact, load, release or off, got '{mode}'")
        if not timeout > 0.0:
            raise ValueError(f"timeout must be a positive time in s, got {timeout}")
        if mode != "contact" and not mass > 0.0:
            raise ValueError(f"{mode} needs the mass of the object in kg, got {mass}")
        if mode == "load" and self._unloaded is None:
            raise ValueError("load is counted from the torque before the contact: arm for contact first")
        if any(not 1 <= j <= 7 for j in joints):
            raise ValueError(f"joints are numbered 1..7, got {list(joints)}")
        self._armed = _Armed(
            mode,
            now + timeout,
            k if k > 0.0 else self.settings.k,
            [j - 1 for j in joints] or None,
            mass,
            load_share if load_share > 0.0 else self.settings.load_share,
            carries,
        )

    def disarm(self) -> None:
        """Stop watching."""
        self._armed = None

    def learn(self) -> str:
        """Delete the noise at rest and learn it again from now on. Returns a sentence. ValueError if the arm moves or
        the detector is armed: the samples would not be noise."""
        if self._armed is not None:
            raise ValueError(f"armed for {self._armed.mode}; the noise is learnt between actions, send mode off first")
        if not self.still():
            raise ValueError("the arm moves, or no torques come; the noise is learnt at rest")
        self._rest_differences.clear()
        return f"learning from the next {self.settings.learn_samples} samples; leave the arm alone"

    def look(self) -> Signal:
        """Returns the present state. The largest change is reset."""
        armed, change = self._armed, self._largest
        self._largest = np.zeros(7)
        k = armed.k if armed is not None else self.settings.k
        watched = armed.watched if armed is not None and armed.watched else range(7)
        watching = self.state() == "watching"
        return Signal(
            self.state(),
            armed.mode if armed is not None else "",
            tuple(map(float, change)),
            tuple(map(float, k * self.sigma())),
            tuple(j in watched for j in range(7)),
            k,
            self.margin if watching else 0.0,
            len(self._rest_differences),
        )

    def state(self) -> str:
        """Returns off, waiting (armed, but the arm moves or the rest was too short) or watching."""
        if self._armed is None:
            return "off"
        return "watching" if self._armed.baseline is not None else "waiting"

    def still(self) -> bool:
        """True if the arm has stood still for ``settings.settle`` s."""
        return (
            self._still_since is not None
            and self._last_stamp is not None
            and self._last_stamp - self._still_since >= self.settings.settle
        )

    def feed(self, stamp: float, torque: Joints, position: Joints, velocity: Joints) -> ContactEvent | None:
        """Process one sample: torque (Nm), position (rad), velocity (rad/s), seven joints each. An impossible sample
        (not finite, beyond LARGEST, wrong length) is ignored."""
        tau = np.asarray(torque, dtype=float)
        for values in (tau, np.asarray(position), np.asarray(velocity)):
            if values.shape != (7,) or not np.abs(values).max() <= LARGEST:
                return None
        if not self._in_time(stamp):
            return None
        self._follow_motion(stamp, velocity)
        difference = self._filter(stamp, tau)
        if difference is not None:
            self._largest = np.where(np.abs(difference) > np.abs(self._largest), difference, self._largest)
        if self._armed is not None and stamp > self._armed.until:
            self._armed = None
        if not self.still() or difference is None:
            if self._armed is not None:
                self._armed.stir(self._rest.travels)
            return None
        if self._armed is None:
            self._learn(difference)
            return None
        return self._watch(stamp, difference, position)

    def _in_time(self, stamp: float) -> bool:
        """Returns whether a sample follows the previous one. A single odd sample is ignored. Two consecutive ones mean
        that the clock was set, or that samples were missing for long. Then an arming keeps its remaining time, and the
        arm must be seen still again."""
        last, odd, self._odd_stamp = self._last_stamp, self._odd_stamp, None
        if last is None or 0.0 < stamp - last <= LONGEST_STEP:
            return True
        if odd is None or not 0.0 < stamp - odd <= LONGEST_STEP:
            self._odd_stamp = stamp
            return False
        if self._armed is not None:
            self._armed.until += stamp - last
            self._armed.gone_since = None
        self._last_stamp = self._still_since = None
        return True

    def _follow_motion(self, stamp: float, velocity: Joints) -> None:
        moving = np.abs(velocity).max() > self.settings.still_speed
        if moving:
            self._rest.move(stamp - self._last_stamp if self._last_stamp is not None else 0.0, velocity)
            self._still_since = None
        elif self._still_since is None:
            self._still_since = stamp
            self._history.clear()
            self._filtered = None
            self._rest.stand()

    def _filter(self, stamp: float, tau: np.ndarray) -> np.ndarray | None:
        """Low-pass and store a sample. Returns the difference over the window; None until the window is full."""
        dt = stamp - self._last_stamp if self._last_stamp is not None else 0.005
        self._last_stamp, self._gap = stamp, dt
        if self._filtered is None or dt > 0.1:
            self._filtered = tau.copy()
            self._history.clear()
        blend = 1.0 - np.exp(-2.0 * np.pi * self.settings.cutoff * dt)
        filtered = self._filtered + blend * (tau - self._filtered)
        self._filtered = filtered
        self._history.append((stamp, filtered))
        while len(self._history) > 1 and self._history[1][0] <= stamp - self.settings.window + 1e-9:
            self._history.popleft()
        first_stamp, first = self._history[0]
        if first_stamp > stamp - self.settings.window + 1e-9:
            return None
        return filtered - first

    def _learn(self, difference: np.ndarray) -> None:
        assert self._filtered is not None
        self._rest_differences.append(difference)
        self._rest.learn(self._filtered, self._gap)

    def sigma(self) -> np.ndarray:
        """Returns the robust standard deviation (Nm) of the difference at rest, per joint; without data, the floor."""
        if len(self._rest_differences) < 2:
            return np.full(7, self.settings.floor)
        values = np.array(self._rest_differences)
        mad = np.median(np.abs(values - np.median(values, axis=0)), axis=0)
        return np.maximum(MAD_TO_SIGMA * mad, self.settings.floor)

    def _watch(self, stamp: float, difference: np.ndarray, position: Joints) -> ContactEvent | None:
        armed = self._armed
        assert armed is not None and self._filtered is not None
        if len(self._rest_differences) < self.settings.learn_samples:
            self._learn(difference)
            return None
        if armed.baseline is None:
            armed.baseline = self._filtered.copy()
            armed.watched = armed.joints or sensitive_joints(
                self._jacobian(position), self.settings.user_direction, self.settings.sensitivity_share
            )
            armed.threshold = armed.k * self.sigma()[armed.watched]
            if armed.mode == "contact":
                self._unloaded = armed.baseline
            return self._check_offset(armed)
        if armed.mode != "contact":
            return self._watch_weight(stamp, armed, position)
        assert armed.threshold is not None
        self.margin = float((np.abs(difference[armed.watched]) / armed.threshold).max())
        armed.over = armed.over + 1 if self.margin > 1.0 else 0
        if armed.over < self.settings.confirm:
            return None
        # In standard deviations, the threshold is k and the signal is margin times k.
        return self._event(
            True,
            "joint_torque",
            self.margin,
            confidence((self.margin - 1.0) * armed.k),
            ReasonCode.CONTACT_FOUND,
            f"torque of joints {[j + 1 for j in armed.watched]} changed by {self.margin:.1f} x its "
            f"threshold within {self.settings.window * 1000:.0f} ms",
        )

    def _check_offset(self, armed: _Armed) -> ContactEvent | None:
        """Check the offset once at each rest. An early touch leaves an offset against the last rest before the motion.
        A touch that jolted the arm leaves one against the torque before the jolt."""
        before_motion = None if armed.carries else self._rest.before_motion
        reference = before_motion if armed.before is None else armed.before
        if armed.mode != "contact" or reference is None or armed.baseline is None:
            return None
        offset = np.abs(armed.baseline - reference)[armed.watched]
        largest = int(np.argmax(offset))
        ratio = float(offset[largest]) / self.settings.offset_threshold
        if ratio <= 1.0:
            return None
        self._unloaded = reference
        over = float(offset[largest]) - self.settings.offset_threshold
        early = armed.before is None
        return self._event(
            True,
            "torque_offset",
            ratio,
            confidence(over / float(self.sigma()[armed.watched][largest])),
            ReasonCode.CONTACT_CAME_EARLY if early else ReasonCode.CONTACT_FOUND,
            f"torque offset {float(offset[largest]):.2f} Nm "
            + ("on arming: the object was there already" if early else "after a jolt"),
        )

    def _watch_weight(self, stamp: float, armed: _Armed, position: Joints) -> ContactEvent | None:
        """Check whether the weight has arrived (load) or gone (release)."""
        reference = self._unloaded if armed.mode == "load" else armed.baseline
        assert reference is not None and self._filtered is not None
        lever = self._jacobian(position)[2][armed.watched]
        change = (self._filtered - reference)[armed.watched]
        # Least squares with one unknown: the vertical force (N, positive upward) that explains the change of torque.
        lifted = float(lever @ change) / float(lever @ lever)
        force = -lifted if armed.mode == "load" else lifted
        needed = armed.load_share * armed.mass * GRAVITY
        self.margin = force / needed
        if self.margin < 1.0:
            armed.gone_since = None
            return None
        if armed.gone_since is None:
            armed.gone_since = stamp
        confirm = self.settings.load_confirm if armed.mode == "load" else self.settings.release_confirm
        if stamp - armed.gone_since < confirm:
            return None
        verb = "carried now" if armed.mode == "load" else "of the load are gone"
        deviation = float(np.linalg.norm(lever * self.sigma()[armed.watched])) / float(lever @ lever)
        return self._event(
            armed.mode == "load",
            "joint_torque",
            self.margin,
            confidence((force - needed) / deviation),
            ReasonCode.LOAD_CARRIED if armed.mode == "load" else ReasonCode.LOAD_RELEASED,
            f"{force:.1f} N {verb} (needed {needed:.1f} N)",
        )

    def _event(self, contact: bool, source: str, margin: float, sure: float, code: int, message: str) -> ContactEvent:
        self._armed = None
        return ContactEvent(contact, source, margin, message, sure, code)
