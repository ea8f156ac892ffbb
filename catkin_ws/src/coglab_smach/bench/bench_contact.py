#!/usr/bin/python3
"""Bench of contact detection: sensitivity, delay, false alarms; the peer is an absolute threshold on the same signals.

Pushes: 60 of each kind on synthetic torques; one that is not found is infinitely late. False alarms: 200 still and 50
moving runs. People: 12 drawn ones who give the mug in whole trials, 200 with --long.
"""

import json
import os
import sys
import time

import numpy as np
from campaign import of_asked
from coglab_py.pose import Pose
from coglab_smach.contact.torque_signal import TorqueSignal
from coglab_smach.contact.trials import ContactTrial, found_within, push
from coglab_smach.kinematics.reachability import default_arm, position_jacobian, solve
from world_rows import contact_rows, run_default

ASKED = 200
PEOPLE = ASKED if os.environ.get("COGLAB_LONG") == "1" else 12
"""drawn, who give the mug in whole trials"""
ABSOLUTE = 1.0
"""Nm, threshold of the peer"""


def row(figure, value, unit, goal="", ok=True, peer=None, peer_value=None):
    """One row of the bench table."""
    return {
        "bench": "contact",
        "figure": figure,
        "value": round(float(value), 4),
        "unit": unit,
        "goal": goal,
        "peer": peer,
        "peer_value": peer_value if peer_value is None else round(float(peer_value), 4),
        "ok": bool(ok),
    }


def absolute_alarms(jacobian, trials, samples, force):
    """Share of runs in which some torque exceeds the absolute threshold within ``samples``."""
    alarms = 0
    for seed in range(trials):
        signal = TorqueSignal(seed)
        alarms += any(
            np.max(np.abs(signal.sample(0.005, jacobian, force(k * 0.005), np.zeros(7)))) > ABSOLUTE
            for k in range(samples)
        )
    return alarms / trials


def main() -> int:
    """Print the rows."""
    q = solve(default_arm(), Pose(np.array([0.78, -0.02, 0.44]), np.array([0.5, 0.5, 0.5, 0.5])))
    posture = (q, position_jacobian(default_arm(), q))
    rows = []
    peer = absolute_alarms(posture[1], 60, 12, push((0, 1, 0), 3.0))
    share, delay = found_within(posture, (0, 1, 0), 3.0)
    of = "of 60 pushes"
    rows.append(
        row(f"lateral 3 N found within 60 ms, {of}", share, "share", ">= 0.95", share >= 0.95, "absolute 1 Nm", peer)
    )
    rows.append(row(f"lateral 3 N, median delay, {of}", delay * 1000, "ms", "<= 60", delay <= 0.06))
    for name, direction, newton, sigma in (
        ("down 3 N", (0, 0, -1), 3.0, 0.05),
        ("toward robot 3 N", (-1, 0, 0), 3.0, 0.05),
        ("lateral 3 N, noisy sensors 0.15 Nm", (0, 1, 0), 3.0, 0.15),
    ):
        share, _ = found_within(posture, direction, newton, sigma=sigma)
        rows.append(row(f"{name} found within 60 ms, {of}", share, "share"))
    false = 0
    started, samples = time.perf_counter(), 0
    for seed in range(200):
        trial = ContactTrial(posture, 5000 + seed)
        false += trial.rest_and_arm() is not None or trial.feed(2.0)[0] is not None
        samples += 740
    per_sample = (time.perf_counter() - started) / samples * 1e6
    rows.append(row("false alarms in 200 still runs", false, "runs", "<= 0", false == 0))
    moving = 0
    for seed in range(50):
        trial = ContactTrial(posture, seed)
        trial.feed(1.0)
        trial.detector.arm("contact", trial.t, 30.0)
        for k in range(200):
            v = np.full(7, 0.4 * np.sin(np.pi * (k + 1) / 201) + 0.03)
            event, _ = trial.feed(0.005, push((0, 1, 0), 8.0), lambda t, v=v: v)
            moving += event is not None or trial.detector.state() == "watching"
    rows.append(
        row("watching in 50 runs of 200 samples in which the arm moves", moving, "samples", "<= 0", moving == 0)
    )
    rows.append(
        row("time per sample, signal included, mean of 200 runs", per_sample, "us", "<= 1000", per_sample <= 1000)
    )
    rows += of_asked(contact_rows(row, run_default(PEOPLE)), PEOPLE, ASKED)
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
