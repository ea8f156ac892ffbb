"""For tests: an arm with analytic motion and measurements, synthetic torques of an arm at rest, detectors."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_contact.detector import ContactDetector, DetectorSettings
from coglab_contact.evidence import ContactEvent
from coglab_contact.fused_detector import FusedDetector
from coglab_contact.motion_thresholds import Thresholds
from coglab_contact.moving_contact import MovingContact
from coglab_py.packages import package_path

DT = 0.005

URDF = package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8")

SHIPPED = package_path("coglab_contact", "config", "contact_thresholds.yaml")

ARM = cc.Chain(URDF)
HOME = np.array([-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782])
SWING = np.array([0.30, 0.25, -0.30, 0.35, 0.20, -0.20, 0.15])
"""rad, amplitude of the motion about the home posture"""


class Arm:
    """Samples of an arm that swings about home from ``begin`` s on, with forces on it; exact torques plus noise."""

    def __init__(self, rate=2.5, begin=0.6, sigma=0.0, seed=1, mass=0.0):
        self.rate, self.begin, self.sigma = rate, begin, sigma
        self.rng = np.random.default_rng([seed, 71])
        self.true = cc.ArmDynamics(URDF)
        self.true.set_payload(mass, [0.04, 0.0, 0.0])

    def at(self, t, force=(0.0, 0.0, 0.0), torque=None):
        """Position, velocity and measured torque at t (s) under a force on the palm (N) or a torque on the joints (Nm);
        the torque is the mean over the period that ends there."""
        q, v, _ = self.state(t)
        middle, speed, a = self.state(t - DT / 2)
        terms = self.true.evaluate(middle, speed)
        outside = jacobian(q).T @ np.asarray(force) if torque is None else np.asarray(torque)
        noise = self.rng.normal(0.0, self.sigma, 7) if self.sigma else 0.0
        return q, v, terms.mass @ a + terms.coriolis + terms.gravity - outside + noise

    def state(self, t):
        """Position, velocity and acceleration at t."""
        phase = self.rate * max(0.0, t - self.begin)
        # From rest without a step of the acceleration: sin^3.
        q = HOME + SWING * np.sin(phase) ** 3
        v = SWING * 3 * np.sin(phase) ** 2 * np.cos(phase) * self.rate
        a = SWING * (6 * np.sin(phase) * np.cos(phase) ** 2 - 3 * np.sin(phase) ** 3) * self.rate**2
        return q, v, a


def jacobian(q):
    """Jacobian of the palm, 3 x 7."""
    return ARM.jacobian(np.asarray(q))[:3]


def fused():
    """The detector as in the node, with the shipped thresholds."""
    moving = MovingContact(Thresholds.load(SHIPPED), cc.ArmDynamics(URDF), jacobian)
    return FusedDetector(ContactDetector(DetectorSettings(), jacobian), moving)


def feed(detector, arm, begin, end, force=lambda t: (0.0, 0.0, 0.0), shift=0.0):
    """Feed both inputs of the robot from ``begin`` to ``end`` s, stamps shifted: (event, its time) or (None, end)."""
    for k in range(round(begin / DT), round(end / DT)):
        t = k * DT
        outside = np.asarray(force(t))
        q, v, tau = arm.at(t, outside)
        event = detector.feed_measured(t + shift, q, tau)
        event = event or detector.feed(t + shift, jacobian(q).T @ outside, q, v)
        if event is not None:
            return event, t
    return None, end


def ramp(direction, begin, newton=3.0):
    """A force that rises to ``newton`` within 60 ms from ``begin`` s on."""
    return lambda t: np.asarray(direction) * newton * min(1.0, max(0.0, (t - begin) / 0.06))


class ArmAsMeasured(Arm):
    """Torques like those of the cell's sensors: noise that lasts 10 ms and grows with the fastest joint, and a lag."""

    def __init__(self, lag=0.0, sigma=0.05, **rest):
        super().__init__(**rest)
        self.lag, self.noisy, self.noise = lag, sigma, np.zeros(7)

    def at(self, t, force=(0.0, 0.0, 0.0), torque=None):
        """As Arm.at."""
        q, v, _ = super().at(t, force, torque)
        tau = super().at(t - self.lag, force, torque)[2]
        keep = np.exp(-DT / 0.01)
        spread = self.noisy * (1.0 + 7.0 * np.abs(v).max()) * np.sqrt(1.0 - keep**2)
        self.noise = keep * self.noise + self.rng.normal(0.0, 1.0, 7) * spread
        return q, v, tau + self.noise


STILL = np.zeros(7)

Force = Callable[[float], Sequence[float] | np.ndarray]


@dataclass
class TorqueSignal:
    """Seven joint torques (Nm) at each call of ``sample``; seeded."""

    seed: int
    sigma: float = 0.05
    bias: float = 0.4
    correlation_time: float = 0.01
    motion_gain: float = 8.0
    """factor on the noise per rad/s"""

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng([self.seed, 41])
        self._bias = self._rng.uniform(-self.bias, self.bias, 7)
        self._noise = self.sigma * self._rng.normal(size=7)

    def sample(
        self,
        dt: float,
        jacobian: np.ndarray,
        force: Sequence[float] | np.ndarray,
        velocity: Sequence[float] | np.ndarray,
    ) -> np.ndarray:
        """One sample dt s after the last: ``jacobian`` 3 x 7, ``force`` (N) on the hand, base frame."""
        keep = float(np.exp(-dt / self.correlation_time))
        self._noise = keep * self._noise + np.sqrt(1 - keep**2) * self.sigma * self._rng.normal(size=7)
        speed = np.abs(np.asarray(velocity, dtype=float))
        friction = 0.3 * np.tanh(np.asarray(velocity, dtype=float) / 0.05)
        return jacobian.T @ np.asarray(force) + self._bias + self._noise * (1 + self.motion_gain * speed) + friction


class ContactTrial:
    """A detector fed at 200 Hz with a synthetic arm at ``posture`` (joints (rad), 3 x 7 Jacobian)."""

    def __init__(self, posture: tuple[np.ndarray, np.ndarray], seed: int, sigma: float = 0.05, **settings: Any) -> None:
        self.q, self.jacobian = posture
        self.detector = ContactDetector(DetectorSettings(**settings), lambda q: self.jacobian)
        self.signal = TorqueSignal(seed, sigma)
        self.t = 0.0

    def feed(
        self,
        duration: float,
        force: Force = lambda t: (0.0, 0.0, 0.0),
        velocity: Callable[[float], np.ndarray] = lambda t: STILL,
    ) -> tuple[ContactEvent | None, float]:
        """Feed samples; (event, time since the start of this call) or (None, duration)."""
        start = self.t
        for _ in range(int(round(duration / DT))):
            self.t += DT
            v = velocity(self.t - start)
            tau = self.signal.sample(DT, self.jacobian, force(self.t - start), v)
            event = self.detector.feed(self.t, tau, self.q, v)
            if event is not None:
                return event, self.t - start
        return None, duration

    def rest_and_arm(self, mode: str = "contact", timeout: float = 30.0, **request: Any) -> ContactEvent | None:
        """Learn at rest, arm, and wait until the detector watches; an event here would be a false alarm."""
        self.feed(1.5)
        self.detector.arm(mode, self.t, timeout, **request)
        return self.feed(0.2)[0]


def push(direction: Sequence[float], newton: float, rise: float = 0.06) -> Force:
    """A force that ramps to ``newton`` N in ``rise`` s."""
    d = np.asarray(direction, dtype=float)
    return lambda t: d * newton * min(1.0, t / rise)


def found_within(
    posture: tuple[np.ndarray, np.ndarray],
    direction: Sequence[float],
    newton: float,
    limit: float = 0.06,
    sigma: float = 0.05,
    trials: int = 60,
) -> tuple[float, float]:
    """(share of pushes detected within ``limit`` s, median delay in s). A push that is not detected within 0.2 s, or
    detected too early, has an infinite delay."""
    found, delays = 0, [math.inf] * trials
    for seed in range(trials):
        trial = ContactTrial(posture, seed, sigma)
        if trial.rest_and_arm() is not None:
            continue
        event, delay = trial.feed(0.2, push(direction, newton))
        if event is not None:
            delays[seed] = delay
            found += delay <= limit + 1e-9
    return found / trials, float(np.median(delays))
