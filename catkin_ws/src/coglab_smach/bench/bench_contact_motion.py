#!/usr/bin/python3
"""Bench of contact found while the arm moves: pushes in the physics during reaches of the shipped plug-in.

Definitions. Reach, push and what is drawn: see moving_reaches.py; seeds come from SHA-256 of the commit's hash. The
detector is armed ``contact_in_motion`` when the motion starts; its thresholds are those that are shipped, learnt on
other seeds. Pushes: it gets the torques (and touch, where the row says so) and nothing else. Delay: stamp of the event
less the time from which the true force is 1 N or more; found: an event within 80 ms of it; an event before it is a
false alarm, and that push counts as not found. A reach that is refused or ends before its push is replaced by the next
seed and counted. Reaches without contact: it gets all that its node gets, so that each source may be wrong: torques,
the motors of the hand as its node reads them (5 times a second while the hand does nothing), what is seen of the object
beside its grasp (of an empty hand), and in a second row touch sensors too. The fingers keep their shape, empty or
closed on what they hold. Touch: what palm and phalanges feel in the physics, with ``TOUCH_NOISE`` N of noise in each
component, 200 times a second. With touch: the person's hand comes toward the robot's empty hand and touches fingers or
palm; its force rises as it does; how fast is printed. Fewer reaches than 500 without contact, 200 pushes across and 100
of each other kind, as without --long, are a sample, which meets no goal.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator

import coglab_controllers as cc
import numpy as np
from coglab_objects.database import objects_folder, read_object
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.contact.fused_detector import IN_MOTION, FusedDetector
from coglab_smach.contact.grip_and_load import GripAndLoad
from coglab_smach.contact.motion_thresholds import Thresholds
from coglab_smach.contact.moving_contact import MovingContact
from coglab_smach.kinematics.reachability import default_arm, position_jacobian
from coglab_smach.ports.interfaces import ContactEvent
from coglab_smach.simulated.world_ports import OLDEST_SIGHT
from moving_reaches import DT, FRAME, MovingReach, Recording, wrong_urdf
from partner_rows import seeds_of, too_few
from trial_file import commit_of_sources

LONG = os.environ.get("COGLAB_LONG") == "1"
ASKED = {"": 500, "across": 200, "toward": 100, "hand": 100}
"""reaches without a push, with one across and toward the robot, and in which the person's hand comes"""
COUNTS = ASKED if LONG else {"": 12, "across": 12, "toward": 6, "hand": 6}
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


def judged(figure: str, value: float, unit: str, goal: str, good: bool, push: str) -> dict:
    """A row with a goal, which a sample of the reaches of this kind does not meet."""
    done, asked = COUNTS[push], ASKED[push]
    enough = done >= asked
    return row(figure + ("" if enough else too_few(done, done, asked)), value, unit, goal, good and enough)


def detector(seed: int, thresholds: Thresholds) -> FusedDetector:
    """As the node makes it; its model of the arm is wrong in its own way."""

    def jacobian(q):
        return position_jacobian(default_arm(), q)

    def turn(q):
        return Pose(*default_arm().fk(np.asarray(q, dtype=float))).rotation.as_matrix()

    moving = MovingContact(thresholds, cc.ArmDynamics(wrong_urdf(seed)), jacobian, DT)
    return FusedDetector(ContactDetector(DetectorSettings(), jacobian), moving, held=GripAndLoad(turn))


def grasp_of(frame: str) -> Pose:
    """The palm in the frame of the object that is reached for, at the object's own grasp."""
    thing, _ = read_object(objects_folder() / f"{frame.removeprefix('object_')}.yaml")
    pose = thing["grasps"][thing["default_grasp"]]["pose"]
    return Pose(np.array(pose["xyz"]), np.array(pose["quaternion"]))


def look_and_feel(fused: FusedDetector, record: Recording, k: int, grasp: Pose) -> ContactEvent | None:
    """What the node hears of the hand's motors, where they were read anew, and of the object's sights, in sample k."""
    now, event = record.stamp[k], None
    if record.hand[k] and (k == 0 or record.hand[k] is not record.hand[k - 1]):
        event = fused.feed_hand(now, record.hand[k])
    seen = record.sight[k]
    # Who gives what the hand holds is not looked at: then no object is named on arming.
    if event is None and not fused.holds and seen is not None and now - seen[0] <= OLDEST_SIGHT:
        distance, angle = Pose(*default_arm().fk(record.position[k])).distance(seen[1] * grasp)
        speed = float(np.linalg.norm(position_jacobian(default_arm(), record.position[k]) @ record.velocity[k]))
        event = fused.feed_sight(now, distance, angle, speed)
    return event


def watch(
    record: Recording, thresholds: Thresholds, touch: bool = False, everything: bool = False
) -> tuple[ContactEvent | None, float, float]:
    """(event, its time (s), processor time of a sample (s)) of one reach as recorded. ``everything``: the hand's motors
    and sights of the object besides the torques, and ``touch``."""
    fused, grasp = detector(record.seed, thresholds), grasp_of(FRAME)
    fused.set_payload(*record.payload)
    fused.holds = record.payload[0] > 0.0
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
        if everything and event is None:
            event = look_and_feel(fused, record, k, grasp)
        spent, samples = spent + time.process_time() - begun, samples + 1
        if touch and event is None:
            forces = [force + noise.normal(0.0, TOUCH_NOISE, 3) for force in record.touch[k].values()]
            event = fused.feed_touch(now, forces, TOUCH_NOISE)
        if event is not None:
            return event, now, spent / samples
    return None, float("inf"), spent / max(1, samples)


def reaches(push: str, commit: str, skipped: list[str]) -> Iterator[Recording]:
    """The reaches of this kind; what was refused or ended before its push is in ``skipped``, and replaced, at most as
    often as there are reaches."""
    number, done = COUNTS[push], 0
    for seed in seeds_of(commit, f"contact in motion, {push or 'none'}", 2 * number):
        try:
            record = MovingReach(seed, push).run()
            if push and record.one_newton is None:
                raise RuntimeError(f"seed {seed}: the reach ended before its push")
        except RuntimeError as error:
            skipped.append(str(error))
            continue
        yield record
        done += 1
        if done == number:
            return
    raise RuntimeError(f"{done} of {number} reaches of kind '{push}' could be run: {skipped[-1]}")


def push_rows(records, thresholds: Thresholds, what: str, push: str, touch: bool, goal: bool) -> list[dict]:
    """Share found, delays, false alarms, speeds; nothing is left out of a percentile, a miss is infinite."""
    delays, speeds, early = [], [], 0
    for record in records:
        event, when, _ = watch(record, thresholds, touch)
        delay = when - record.one_newton
        if event is not None and delay < 0.0:
            early, delay = early + 1, float("inf")
        delays.append(delay)
        speeds.append(record.speed)
    share = float(np.mean(np.array(delays) <= WITHIN + 1e-9))
    median, p95 = (1000.0 * float(np.percentile(delays, p, method="higher")) for p in (50, 95))
    found = f"{what}: found within 80 ms of true 1 N, of {len(delays)} pushes"
    return [
        judged(found, share, "share", ">= 0.9", share >= 0.9, push) if goal else row(found, share, "share"),
        row(f"{what}: delay from true 1 N, median", min(median, 1e6), "ms"),
        row(f"{what}: delay from true 1 N, p95 (1000000: not found)", min(p95, 1e6), "ms"),
        row(f"{what}: events before the push", early, "pushes"),
        row(f"{what}: speed of the palm at the push, median", np.median(speeds), "m/s"),
    ]


def quiet_rows(records, thresholds: Thresholds) -> list[dict]:
    """False alarms of all that may be wrong together, without and with touch, and the cost of a sample."""
    kinds = {"torques, fingers and sight": False, "torques, fingers, sight and touch": True}
    alarms, spent = dict.fromkeys(kinds, 0), []
    for record in records:
        for what, touch in kinds.items():
            event, _, each = watch(record, thresholds, touch, everything=True)
            spent.append(each)
            if event is not None:
                alarms[what] += 1
                print(f"seed {record.seed}: {what}: false alarm: {event.source}: {event.message}", file=sys.stderr)
    cost, number = 1e6 * float(np.median(spent)), COUNTS[""]
    rows = []
    for what, count in alarms.items():
        figure = f"moving reaches without contact, {number}, {what}: false alarms"
        rows.append(judged(figure, count, "reaches", "<= 1 of 500", count <= max(1, number // 500), ""))
    return [*rows, row("time per sample, all detectors, processor, median", cost, "us", "<= 1000", cost <= 1000)]


def main() -> int:
    """Print the rows."""
    thresholds = Thresholds.load(package_path("coglab_smach", "config", "contact_thresholds.yaml"))
    skipped: list[str] = []
    commit = commit_of_sources()
    rows = quiet_rows(reaches("", commit, skipped), thresholds)
    across = list(reaches("across", commit, skipped))
    toward = list(reaches("toward", commit, skipped))
    rows += push_rows(across, thresholds, "3 N across the line robot-person", "across", False, True)
    rows += push_rows(toward, thresholds, "3 N toward the robot, torques alone", "toward", False, False)
    hand = list(reaches("hand", commit, skipped))
    rows += push_rows(hand, thresholds, "the person's hand comes, torques alone", "hand", False, False)
    rows += push_rows(hand, thresholds, "the person's hand comes, with touch", "hand", True, True)
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
