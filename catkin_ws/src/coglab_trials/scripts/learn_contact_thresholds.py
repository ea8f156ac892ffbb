#!/usr/bin/python3
"""Learns the shipped thresholds of the moving arm from simulated reaches without contact: [NUMBER] [FILE].

Seeds from 50000 on, which no test and no benchmark uses. On a robot the service /contact_detector/learn_motion does the
same, and also learns the offsets between two rests. Here these are not learnt: the simulated offsets do not depend on
the posture, and with limits from them the offsets of a real arm would count as contact.
"""

import sys
from pathlib import Path
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_contact.motion_thresholds import FEATURES, Change, Thresholds, learn
from coglab_contact.moving_contact import MotionRecorder, MovingContact
from coglab_smach.kinematics.reachability import default_arm, position_jacobian
from moving_reaches import DT, MovingReach, wrong_urdf

FIRST = 50000
BEFORE = 0.6
"""s, rest before the motion"""


def jacobian(q: Any) -> np.ndarray:
    """Returns the Jacobian of the palm's position, shape (3, 7)."""
    return position_jacobian(default_arm(), q)


def main() -> int:
    """Learn the thresholds and write the file."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    file = Path(sys.argv[2] if len(sys.argv) > 2 else "contact_thresholds.yaml")
    none = Thresholds(np.ones((7, len(FEATURES))), 1.0, np.ones(7), 1.0)
    reaches: list[list[Change]] = []
    for seed in range(FIRST, FIRST + number):
        try:
            record = MovingReach(seed).run()
        except RuntimeError as error:
            print(error, file=sys.stderr)
            continue
        moving = MovingContact(none, cc.ArmDynamics(wrong_urdf(seed)), jacobian, DT)
        moving.set_payload(*record.payload)
        recorder = MotionRecorder(moving)
        for k in range(int(np.searchsorted(record.stamp, record.begun - BEFORE)), len(record.stamp)):
            moving.feed(record.stamp[k], record.position[k], record.torque[k])
            recorder.look()
        recorder.end()
        reaches += recorder.reaches
    learn(reaches).save(file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
