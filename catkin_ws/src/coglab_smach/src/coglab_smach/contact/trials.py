"""Synthetic trials of the contact detector: one arm posture, torques as D4.10 describes them, pushes from any side.

Used by the tests, by the bench and for tuning a detector before a robot is at hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.contact.torque_signal import TorqueSignal
from coglab_smach.ports.interfaces import ContactEvent

DT = 0.005
STILL = np.zeros(7)
Force = Callable[[float], Sequence[float] | np.ndarray]


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
    """(share of pushes found within ``limit`` s, median delay in s); what is not found within 0.2 s, or alarmed before
    it was pushed, is infinitely late."""
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
