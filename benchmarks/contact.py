#!/usr/bin/python3
"""Contact detection while the arm moves and at rest, in the physics of the virtual world.

A reach: a hand moves into the handover region, seen by the shipped tracker, and the arm reaches for it with the shipped
primitives; moving_reaches.py describes the drawn quantities. Moving push: across the path, 0 to 3 N in 60 ms. It is
found if an event occurs within 80 ms after the force has reached 1 N; an event before the push is a miss. False alarm:
any event in a reach without a push, from torques, fingers, sight or touch. If a reach is refused or ends before its
push, the next seed replaces it. At rest: 3 N to the side on synthetic torques.
"""

from __future__ import annotations

from collections.abc import Iterator

import coglab_controllers as cc
import numpy as np
from coglab_contact.detector import ContactDetector, DetectorSettings
from coglab_contact.fused_detector import IN_MOTION, OLDEST_SIGHT, FusedDetector
from coglab_contact.load import GripAndLoad
from coglab_contact.motion_thresholds import Thresholds
from coglab_contact.moving_contact import MovingContact
from coglab_objects.database import objects_folder, read_object
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm, position_jacobian, solve
from common import Row, in_parallel, main, median, share, shared_module

FIRST_SEED = 300_000  # the shipped thresholds were learnt on seeds from 50 000 on
WITHIN = 0.080  # s
TOUCH_NOISE = 0.05  # N, of each component of the touch sensors
BEFORE = 0.6  # s of rest before the motion that are fed to the detector


def detector(seed: int) -> FusedDetector:
    """A detector as its node makes it, but with a wrong model of the arm, drawn by the seed."""

    def jacobian(q):
        return position_jacobian(default_arm(), q)

    def turn(q):
        return Pose(*default_arm().fk(np.asarray(q, dtype=float))).rotation.as_matrix()

    thresholds = Thresholds.load(package_path("coglab_contact", "config", "contact_thresholds.yaml"))
    reaches = shared_module("moving_reaches")
    moving = MovingContact(thresholds, cc.ArmDynamics(reaches.wrong_urdf(seed)), jacobian, reaches.DT)
    return FusedDetector(ContactDetector(DetectorSettings(), jacobian), moving, held=GripAndLoad(turn))


def grasp_of(frame: str) -> Pose:
    """Pose of the palm in the frame of the goal object."""
    thing, _ = read_object(objects_folder() / f"{frame.removeprefix('object_')}.yaml")
    pose = thing["grasps"][thing["default_grasp"]]["pose"]
    return Pose(np.array(pose["xyz"]), np.array(pose["quaternion"]))


def feed_hand_and_sight(fused: FusedDetector, record, k: int, grasp: Pose):
    """Feeds the status of the hand's motors and the sight of the object in sample k. Returns an event or None."""
    now, event = record.stamp[k], None
    if record.hand[k] and (k == 0 or record.hand[k] is not record.hand[k - 1]):
        event = fused.feed_hand(now, record.hand[k])
    seen = record.sight[k]
    if event is None and not fused.holds and seen is not None and now - seen[0] <= OLDEST_SIGHT:
        distance, angle = Pose(*default_arm().fk(record.position[k])).distance(seen[1] * grasp)
        speed = float(np.linalg.norm(position_jacobian(default_arm(), record.position[k]) @ record.velocity[k]))
        event = fused.feed_sight(now, distance, angle, speed)
    return event


def first_event(record, everything: bool) -> float | None:
    """Time (s) of the first contact in a reach; None: never. `everything`: also by fingers, sight and touch."""
    fused, grasp = detector(record.seed), grasp_of(shared_module("moving_reaches").FRAME)
    fused.set_payload(*record.payload)
    fused.holds = record.payload[0] > 0.0
    noise, armed = np.random.default_rng([record.seed, 61]), False
    for k in range(int(np.searchsorted(record.stamp, record.begun - BEFORE)), len(record.stamp)):
        now = record.stamp[k]
        if not armed and now >= record.begun:
            fused.arm(IN_MOTION, now, 30.0)
            armed = True
        event = fused.feed_measured(now, record.position[k], record.torque[k])
        event = event or fused.feed(now, record.external[k], record.position[k], record.velocity[k])
        if everything and event is None:
            event = feed_hand_and_sight(fused, record, k, grasp)
        if everything and event is None:
            forces = [force + noise.normal(0.0, TOUCH_NOISE, 3) for force in record.touch[k].values()]
            event = fused.feed_touch(now, forces, TOUCH_NOISE)
        if event is not None:
            return now
    return None


def one_reach(job: tuple[int, str]) -> float | bool:
    """With a push: delay (s) of the event after 1 N, infinite without an event. Without a push: True for an alarm."""
    seed, kind = job
    for attempt in range(20):
        try:
            record = shared_module("moving_reaches").MovingReach(seed + 1_000_000 * attempt, kind).run()
        except RuntimeError:
            continue
        if not kind:
            return first_event(record, True) is not None
        if record.one_newton is not None:
            when = first_event(record, False)
            delay = np.inf if when is None else when - record.one_newton
            return float(delay if delay >= 0.0 else np.inf)
    raise RuntimeError(f"seed {seed}: no reach of kind '{kind}' could be run in 20 attempts")


def moving(quick: bool) -> Iterator[Row]:
    """Pushes and false alarms while the arm moves."""
    pushes, quiet = (4, 4) if quick else (200, 500)
    delays = in_parallel(one_reach, [(FIRST_SEED + i, "across") for i in range(pushes)])
    found = [delay <= WITHIN + 1e-9 for delay in delays]
    yield share("push of 3 N across a moving arm, found within 80 ms", found, ">= 90")
    alarms = sum(in_parallel(one_reach, [(FIRST_SEED + 10_000 + i, "") for i in range(quiet)]))
    yield Row("false alarms of the contact detector in moving reaches", alarms, "", "<= 1", f"of {quiet}")


def resting(_quick: bool) -> Iterator[Row]:
    """A push at rest."""
    q = solve(default_arm(), Pose(np.array([0.78, -0.02, 0.44]), np.array([0.5, 0.5, 0.5, 0.5])))
    posture, delays = (q, position_jacobian(default_arm(), q)), []
    for seed in range(60):
        trial = shared_module("arms").ContactTrial(posture, seed, 0.05)
        alarmed = trial.rest_and_arm() is not None
        event, delay = trial.feed(0.2, shared_module("arms").push((0, 1, 0), 3.0))
        delays.append(None if alarmed or event is None else 1e3 * delay)
    yield median("lateral push of 3 N at rest, delay", delays, "ms", "<= 60")


if __name__ == "__main__":
    main("contact", moving, resting)
