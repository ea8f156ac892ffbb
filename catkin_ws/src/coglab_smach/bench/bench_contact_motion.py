#!/usr/bin/python3
"""Bench of contact found while the arm moves: pushes in the physics during reaches of the shipped plug-in.

Definitions (issue 15). Reach, push and what is drawn: see moving_reaches.py. The detector is armed
``contact_in_motion`` when the motion starts and gets what the robot measures (and touch, where the row says so),
nothing else; its thresholds are those that are shipped, learnt on other seeds. Delay: stamp of the event less the
time from which the true force is 1 N or more; found: an event within 80 ms of it; an event before it is a false
alarm, and that push counts as not found. A reach that is refused or ends before its push is replaced by the next seed
and counted. With touch: the person's hand comes toward the robot's empty hand and touches fingers or palm; what it
does there in the physics is also felt by touch sensors with ``TOUCH_NOISE`` N of noise in each component, 200 times a
second. Its force rises as it does; how fast is printed.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator

import coglab_controllers as cc
import numpy as np
from coglab_py.packages import package_path
from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.contact.fused_detector import IN_MOTION, FusedDetector
from coglab_smach.contact.motion_thresholds import Thresholds
from coglab_smach.contact.moving_contact import MovingContact
from coglab_smach.kinematics.reachability import default_arm, position_jacobian
from coglab_smach.ports.interfaces import ContactEvent
from moving_reaches import DT, MovingReach, Recording, wrong_urdf

LONG = os.environ.get("COGLAB_LONG") == "1"
QUIET, ACROSS, TOWARD = (500, 200, 100) if LONG else (12, 12, 6)
"""reaches without a push, with one across and with one toward the robot"""
SEEDS = {"": 60000, "across": 71000, "toward": 72000, "hand": 73000}
WITHIN = 0.080
TOUCH_NOISE = 0.05
BEFORE = 0.6
"""s of rest before the motion that the detector sees"""


def row(figure, value, unit, goal="", ok=True):
    """One row of the bench table."""
    return {
        "bench": "contact_motion",
        "figure": figure,
        "value": round(float(value), 4),
        "unit": unit,
        "goal": goal,
        "peer": None,
        "peer_value": None,
        "ok": bool(ok),
    }


def detector(seed: int, thresholds: Thresholds) -> FusedDetector:
    """As the node makes it; its model of the arm is wrong in its own way."""

    def jacobian(q):
        return position_jacobian(default_arm(), q)

    moving = MovingContact(thresholds, cc.ArmDynamics(wrong_urdf(seed)), jacobian, DT)
    return FusedDetector(ContactDetector(DetectorSettings(), jacobian), moving)


def watch(record: Recording, thresholds: Thresholds, touch: bool = False) -> tuple[ContactEvent | None, float, float]:
    """(event, its time (s), processor time of a sample (s)) of one reach as recorded."""
    fused = detector(record.seed, thresholds)
    fused.set_payload(*record.payload)
    noise = np.random.default_rng([record.seed, 61])
    armed, spent, samples = False, 0.0, 0
    for k in range(int(np.searchsorted(record.stamp, record.begun - BEFORE)), len(record.stamp)):
        now = record.stamp[k]
        if not armed and now >= record.begun:
            fused.arm(IN_MOTION, now, 30.0)
            armed = True
        begun = time.process_time()
        event = fused.feed_measured(now, record.position[k], record.torque[k])
        event = event or fused.feed(now, record.external[k], record.position[k], record.velocity[k])
        spent, samples = spent + time.process_time() - begun, samples + 1
        if touch and event is None:
            forces = [force + noise.normal(0.0, TOUCH_NOISE, 3) for force in record.touch[k].values()]
            event = fused.feed_touch(now, forces, TOUCH_NOISE)
        if event is not None:
            return event, now, spent / samples
    return None, float("inf"), spent / max(1, samples)


def reaches(push: str, number: int, skipped: list[str]) -> Iterator[Recording]:
    """So many reaches; what was refused or ended before its push is in ``skipped``."""
    seed, done = SEEDS[push], 0
    while done < number:
        try:
            record = MovingReach(seed, push).run()
            if push and record.one_newton is None:
                raise RuntimeError(f"seed {seed}: the reach ended before its push")
            done += 1
            yield record
        except RuntimeError as error:
            skipped.append(str(error))
        seed += 1


def push_rows(records, thresholds: Thresholds, what: str, touch: bool, goal: bool) -> list[dict]:
    """Share found, delays, false alarms, speeds; nothing is left out of a percentile, a miss is infinite."""
    delays, speeds, early = [], [], 0
    for record in records:
        event, when, _ = watch(record, thresholds, touch)
        delay = when - record.one_newton
        if event is not None and delay <= 0.0:
            early, delay = early + 1, float("inf")
        delays.append(delay)
        speeds.append(record.speed)
    share = float(np.mean(np.array(delays) <= WITHIN + 1e-9))
    median, p95 = (1000.0 * float(np.percentile(delays, p, method="higher")) for p in (50, 95))
    held = (">= 0.9", share >= 0.9) if goal else ("", True)
    return [
        row(f"{what}: found within 80 ms of true 1 N, of {len(delays)} pushes", share, "share", *held),
        row(f"{what}: delay from true 1 N, median", min(median, 1e6), "ms"),
        row(f"{what}: delay from true 1 N, p95 (1000000: not found)", min(p95, 1e6), "ms"),
        row(f"{what}: events before the push", early, "pushes"),
        row(f"{what}: speed of the palm at the push, median", np.median(speeds), "m/s"),
    ]


def quiet_rows(records, thresholds: Thresholds) -> list[dict]:
    """False alarms and the cost of a sample."""
    alarms, spent = [], []
    for record in records:
        event, _, each = watch(record, thresholds)
        spent.append(each)
        if event is not None:
            alarms.append((record.seed, event))
            print(f"seed {record.seed}: false alarm: {event.source}: {event.message}", file=sys.stderr)
    cost = 1e6 * float(np.median(spent))
    return [
        row(
            f"moving reaches without contact, {len(spent)}: false alarms",
            len(alarms),
            "reaches",
            "<= 1 of 500",
            len(alarms) <= max(1, len(spent) // 500),
        ),
        row("time per sample, both detectors, processor, median", cost, "us", "<= 1000", cost <= 1000),
    ]


def main() -> int:
    """Print the rows."""
    thresholds = Thresholds.load(package_path("coglab_smach", "config", "contact_thresholds.yaml"))
    skipped: list[str] = []
    rows = quiet_rows(reaches("", QUIET, skipped), thresholds)
    across = list(reaches("across", ACROSS, skipped))
    toward = list(reaches("toward", TOWARD, skipped))
    rows += push_rows(across, thresholds, "3 N across the line robot-person", False, True)
    rows += push_rows(toward, thresholds, "3 N toward the robot, torques alone", False, False)
    hand = list(reaches("hand", TOWARD, skipped))
    rows += push_rows(hand, thresholds, "the person's hand comes, torques alone", False, False)
    rows += push_rows(hand, thresholds, "the person's hand comes, with touch", True, True)
    rises = [record.three_newton - record.one_newton if record.three_newton else np.inf for record in hand]
    quick = float(np.mean(np.array(rises) <= 0.06))
    rows.append(row("the person's hand comes: true force from 1 to 3 N within 60 ms", quick, "share"))
    rows.append(row("reaches that were refused or ended before their push, replaced", len(skipped), "reaches"))
    for why in skipped:
        print(why, file=sys.stderr)
    print(json.dumps(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
