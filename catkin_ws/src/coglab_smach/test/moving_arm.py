"""An arm that moves by formulas, as the robot measures it, and the detector of the moving arm on it; for tests."""

import coglab_controllers as cc
import numpy as np
from coglab_py.packages import package_path
from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.contact.fused_detector import FusedDetector
from coglab_smach.contact.motion_thresholds import Thresholds
from coglab_smach.contact.moving_contact import MovingContact
from coglab_smach.kinematics.reachability import default_arm, home_posture, position_jacobian

DT = 0.005
URDF = package_path("lwr_description", "urdf", "lwr_ih2.urdf").read_text(encoding="utf-8")
SHIPPED = package_path("coglab_smach", "config", "contact_thresholds.yaml")
SWING = np.array([0.30, 0.25, -0.30, 0.35, 0.20, -0.20, 0.15])
"""rad, amplitude of the motion about the home posture"""


class Arm:
    """Samples of an arm that swings about home from ``begin`` s on, with what acts on it; exact torques and noise."""

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
        outside = position_jacobian(default_arm(), q).T @ np.asarray(force) if torque is None else np.asarray(torque)
        noise = self.rng.normal(0.0, self.sigma, 7) if self.sigma else 0.0
        return q, v, terms.mass @ a + terms.coriolis + terms.gravity - outside + noise

    def state(self, t):
        """Position, velocity and acceleration at t."""
        phase = self.rate * max(0.0, t - self.begin)
        # From rest without a step of the acceleration: sin^3.
        q = home_posture() + SWING * np.sin(phase) ** 3
        v = SWING * 3 * np.sin(phase) ** 2 * np.cos(phase) * self.rate
        a = SWING * (6 * np.sin(phase) * np.cos(phase) ** 2 - 3 * np.sin(phase) ** 3) * self.rate**2
        return q, v, a


def jacobian(q):
    """Of the palm."""
    return position_jacobian(default_arm(), q)


def fused():
    """As the node makes it, with the shipped thresholds."""
    moving = MovingContact(Thresholds.load(SHIPPED), cc.ArmDynamics(URDF), jacobian)
    return FusedDetector(ContactDetector(DetectorSettings(), jacobian), moving)


def feed(detector, arm, begin, end, force=lambda t: (0.0, 0.0, 0.0), shift=0.0):
    """Both inputs of the robot from ``begin`` to ``end`` s, stamps shifted; (event, its time) or (None, end)."""
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
    """3 N within 60 ms from ``begin`` s on."""
    return lambda t: np.asarray(direction) * newton * min(1.0, max(0.0, (t - begin) / 0.06))


class ArmAsMeasured(Arm):
    """Torques as the cell's sensors tell them: noise that lasts 10 ms and grows with the fastest joint, and a lag."""

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
