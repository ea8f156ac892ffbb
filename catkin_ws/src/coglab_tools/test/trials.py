"""Invented trials for tests, with known figures."""

from pathlib import Path

import numpy as np
from coglab.results import Exchange
from coglab.series import Series
from coglab_tools.trial.read import Measured
from coglab_tools.trial.record import Outcome, TrialRecord

MASTER = "/coglab_master"
ACTION = "exchange_human_to_robot"


def record(**changes):
    values = dict(
        id="20261128T100000Z_exchange_human_to_robot_mug", started="2026-11-28T10:00:00.000+00:00", duration_s=10.0,
        action=ACTION, object="mug", outcome=Outcome(True), seed=7, simulated=True,
        marks=({"name": "motion_started", "time_s": 3.0}, {"name": "contact", "time_s": 5.0}),
    )  # fmt: skip
    return TrialRecord(**{**values, **changes})


def reach(times, begin, duration, distance):
    """Minimum-jerk path along x, m."""
    s = np.clip((times - begin) / duration, 0.0, 1.0)
    return np.outer(distance * (10 * s**3 - 15 * s**4 + 6 * s**5), [1.0, 0.0, 0.0])


def measured(rate=200.0):
    """The person moves at 0.5 m/s from 1 to 3 s, the robot reaches from 3 to 5 s; 6 N from 5 to 7 s; 10 s in all."""
    times = np.arange(0.0, 10.0 + 0.5 / rate, 1.0 / rate)
    person = np.outer(np.clip(times - 1.0, 0.0, 2.0) * 0.5, [0.0, 1.0, 0.0]) + [1.0, 0.0, 0.0]
    palm = reach(times, 3.0, 2.0, 0.6)
    force = np.where((times >= 5.0) & (times < 7.0), 6.0, 0.0)
    series = Series(
        truth=[(t, list(a), list(b), list(b), f) for t, a, b, f in zip(times, palm, person, force, strict=True)],
        contacts=[(5.12, True, 1.5, "joint_torque: contact")],
        transitions=[
            (0.0, MASTER, "wait_without_object", "start", ACTION, "asked", 0),
            (5.2, f"{MASTER}/{ACTION}", "approach", "contact", "close", "contact found", 0),
            (10.0, MASTER, ACTION, "succeeded", "wait_with_object", "done", 0),
        ],
        external_torques=[(t, (0.0,) * 7) for t in times],
    )
    marks = {"offered": 2.5, "motion_started": 3.0, "contact": 5.0, "released": 7.0}
    result = Exchange("receive", True, 0, "", (), 0.0, 10.0, "mug", "succeeded", marks)
    shared = [(float(t), float(f)) for t, f in zip(times, force, strict=True)]
    return Measured(record(), 0.0, 10.0, series, (result,), [], shared, true_hands=True)


def write(folder: Path, trial: TrialRecord) -> Path:
    place = folder / trial.id
    place.mkdir(parents=True)
    trial.save(place)
    return place
