"""Ports of the state machines in a World, except the arm (virtual_arm): hand driver on the emulator, trackers, object
files, and contact detector on the simulated torques."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_contact.detector import ContactDetector, DetectorSettings
from coglab_contact.fused_detector import OLDEST_SIGHT, FusedDetector
from coglab_contact.load import GripAndLoad
from coglab_contact.motion_thresholds import Thresholds
from coglab_contact.moving_contact import MovingContact
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import ObjectDatabase, ObjectError
from coglab_py.packages import package_path
from coglab_py.pose import Pose, length
from coglab_smach.ports.interfaces import (
    OLDEST_BELIEF,
    OLDEST_RECOGNITION,
    Ahead,
    ContactEvent,
    HandState,
    Located,
    Recognition,
)
from coglab_smach.ports.pending import Pending, Polled, PortError, Ready
from ih2_hand.reasons import Reason, reason_of

from coglab_trials.world import World

THRESHOLDS = package_path("coglab_contact", "config", "contact_thresholds.yaml")
HAND = "human_hand"


class VirtualHand:
    """HandPort on the hand of the World, with the rules of the real hand's node."""

    def __init__(self, world: World) -> None:
        self.world = world

    def _goal(self, name: str, **fields: Any) -> Pending:
        hand = self.world.hand
        try:
            job = hand.begin(name, **fields)
        except Exception as error:  # any refusal becomes a PortError
            return Ready(error=PortError(f"{name} ended ABORTED", (str(error),), reason_of(error)))

        def value() -> None:
            assert job.verdict is not None  # the task is done
            if not job.verdict.ok:
                raise PortError(f"{name} ended without success", (job.verdict.text,), job.verdict.reason)

        def cancel() -> None:
            hand.end(job, "preempted; fingers stopped", Reason.CANCELLED)

        return Polled(lambda: job.verdict is not None, value, cancel)

    def calibrate(self, mode: str) -> Pending:
        hand, asked = self.world.hand, self.world.t
        sent: list[str | None] = []

        def done() -> bool:
            # At start the hand counts as holding until a poll shows that it is empty. Wait at most 2 s for that.
            if not sent and (not hand.holding or self.world.t - asked > 2.0):
                sent.append(hand.calibrate(mode))
            return bool(sent) and hand.calibration_over(self.world.t)

        def value() -> None:
            if sent[0] is not None:
                raise PortError(
                    f"the hand does not calibrate after the order '{mode}'", (sent[0],), ReasonCode.HAND_REFUSED
                )

        return Polled(done, value)

    def preshape(self, mode: str, level: str) -> Pending:
        return self._goal("hand_preshape", mode=mode, level=level)

    def close_on_object(self) -> Pending:
        return self._goal("hand_preshape_close")

    def close(self, speed: int) -> Pending:
        return self._goal("hand_close", speed=speed)

    def open(self, speed: int) -> Pending:
        return self._goal("hand_open", speed=speed)

    def state(self) -> HandState:
        hand = self.world.hand
        if hand.dead:
            return HandState(message="hand_status is silent", event=ReasonCode.NODE_SILENT)
        positions = () if hand.calibrating else hand.positions
        return HandState(True, hand.calibrated, hand.calibrating, hand.holding, hand.message, positions, hand.reason)


class VirtualPerception:
    """PerceptionPort on the trackers of the World. The optional recogniser and belief (BeliefFilter) receive each new
    sight once, as in the recogniser's node."""

    def __init__(self, world: World, recogniser: Any = None, belief: Any = None) -> None:
        self.world, self.recogniser, self.belief = world, recogniser, belief
        self._taken: dict[str, float] = {}
        self._seen = self._believed = -math.inf  # s, times of the last sight of the hand and of the last belief
        world.after_period.append(self._believe)

    def init_vision(self, time_limit: float) -> Pending:
        return Ready("virtual trackers")

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        name = object_id if object_id in ("board", "human_hand") else f"object_{object_id}"
        end = self.world.t + time_limit
        known = name == "board" or name in self.world.trackers

        def fresh() -> bool:
            return known and self.world.newest(name)[1] < 0.5

        def value() -> Located:
            if not fresh():
                raise PortError(f"'{name}' was not seen within {time_limit:.1f} s", code=ReasonCode.OBJECT_NOT_SEEN)
            frame, age = self.world.newest(name)
            assert frame is not None  # fresh() is true
            x, y, z = frame.position
            qx, qy, qz, qw = frame.orientation
            return Located(name, "world", (x, y, z), (qx, qy, qz, qw), age)

        return Polled(lambda: fresh() or self.world.t >= end, value)

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        return Ready([Located("", "board", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), 0.0)])

    def _believe(self) -> None:
        """Feed each new sight to the filter, objects first. Set the predicted frames, as the recogniser's node does."""
        t, sights, taken = self.world.t, self.world.sights, self._taken
        new = [name for name, sight in sights.items() if sight.captured > taken.get(name, -1.0)]
        for name in sorted(new, reverse=True):
            sight = sights[name]
            taken[name] = sight.captured
            if name == HAND:
                self._seen = t
                if self.recogniser is not None:
                    self.recogniser.update(sight.captured, sight.frame.position)
            if self.belief is None:
                continue
            if name != HAND:
                self.belief.see_object(sight.captured, name.removeprefix("object_"), sight.frame.position, t)
                continue
            end = self.recogniser.pattern_end() if self.recogniser is not None else None
            seen = self.belief.see_hand(sight.captured, sight.frame.position, t, self.world.hand.holding, end)
            if seen.stamp != sight.captured:
                continue  # the filter ignored this sight; the node publishes nothing either
            self._believed = t
            places = {HAND: seen.hand_place, f"object_{seen.object_id}": seen.place if seen.object_id else None}
            for frame, place in places.items():
                if place is not None and frame in self.world.sights:
                    turned = self.world.sights[frame].frame.orientation
                    self.world.robot.virtual.set_frame(frame + "_ahead", place, turned, t - sight.captured)

    def ahead(self) -> Ahead:
        if self.belief is None or self.world.t - self._believed > OLDEST_BELIEF:
            return Ahead()
        seen = self.belief.belief
        if seen.place is None:
            return Ahead(seen.offer, seen.request, seen.object_id)
        frame = f"object_{seen.object_id}" if seen.object_id else HAND
        x, y, z = map(float, seen.place)
        deviation = float(np.sqrt(np.max(np.diag(seen.covariance))))
        return Ahead(seen.offer, seen.request, seen.object_id, frame + "_ahead", (x, y, z), deviation)

    def recognition(self) -> Recognition:
        if self.recogniser is None or self.world.t - self._seen > OLDEST_RECOGNITION:
            return Recognition()
        seen = self.recogniser.estimate
        return Recognition(seen.pattern, seen.confidence, seen.decided, seen.probabilities)


class VirtualDatabase:
    """DatabasePort on the real object files."""

    def __init__(self, database: ObjectDatabase) -> None:
        self.database = database

    def get_object(self, object_id: str) -> Pending:
        try:
            return Ready(self.database.get(object_id))
        except ObjectError as error:
            return Ready(error=PortError(str(error), code=ReasonCode.OBJECT_UNKNOWN))

    def list_objects(self) -> Pending:
        return Ready(self.database.ids())


class VirtualContact:
    """ContactPort: the detector on the simulated joint torques, hand motors, trackers and touch sensors."""

    def __init__(self, world: World, touch: float | None = None) -> None:
        """``touch``: standard deviation (N) of each component of the hand's touch sensors. None: no sensors."""
        self.world, self._touch = world, touch
        self._noise = np.random.default_rng(0)
        chain = world.robot.chain
        moving = MovingContact(Thresholds.load(THRESHOLDS), cc.ArmDynamics(world.robot.urdf), chain)
        self.moving = moving
        held = GripAndLoad(lambda q: Pose(*chain.fk(q)).rotation.as_matrix())
        self.detector = FusedDetector(ContactDetector(DetectorSettings(), chain), moving, held=held)
        self.watched_while_moving = 0  # periods in which the detector for an arm at rest watched a moving arm
        self._event: ContactEvent | None = None
        self._grasp: tuple[str, Pose] | None = None
        self._polled: Any = None
        world.after_period.append(self._sense)

    def _sense(self) -> None:
        if self.world.robot.virtual.frozen:
            return
        report, t = self.world.robot.report, self.world.t
        velocity, detector = np.asarray(report["measured_velocity"]), self.detector
        self.moving.observer.period = report["fri_period"]
        events = [
            detector.feed_measured(t, report["position"], report["torque"]),
            detector.feed(t, report["external_torque"], report["position"], velocity),
            self._sense_hand(),
            self._sense_touch(),
            self._sense_object(report["position"], velocity),
        ]
        self._event = next((event for event in (self._event, *events) if event is not None), None)
        if detector.still.state() == "watching" and np.abs(velocity).max() > 0.05:
            self.watched_while_moving += 1

    def _sense_hand(self) -> ContactEvent | None:
        """Feed the hand motors at each new poll. An empty hand has no payload."""
        hand = self.world.hand
        if hand.readings is self._polled or hand.dead:
            return None
        self._polled = hand.readings
        if not hand.holding and self.moving.load > 0.0:
            self.detector.set_payload(0.0)
        return self.detector.feed_hand(self.world.t, hand.readings)

    def _sense_touch(self) -> ContactEvent | None:
        """Feed the forces on phalanges and palm, if the hand has touch sensors."""
        if self._touch is None:
            return None
        forces = np.array(list(self.world.cell.touch().values()))
        forces += self._touch * self._noise.standard_normal(forces.shape)
        return self.detector.feed_touch(self.world.t, forces.tolist(), self._touch)

    def _sense_object(self, position: Any, velocity: np.ndarray) -> ContactEvent | None:
        """Feed the tracked pose of the object relative to the palm."""
        if self._grasp is None:
            return None
        frame, grasp = self._grasp
        seen, age = self.world.newest(frame)
        if seen is None or age > OLDEST_SIGHT:
            return None
        chain = self.world.robot.chain
        distance, angle = Pose(*chain.fk(position)).distance(seen * grasp)
        speed = length(chain.jacobian(np.asarray(position))[:3] @ velocity)
        return self.detector.feed_sight(self.world.t, distance, angle, speed)

    def arm(self, mode: str, time_limit: float, settings: Mapping[str, Any]) -> Pending:
        self._event = None
        frame = str(settings.get("frame", ""))
        self._grasp = (frame, Pose.from_dict(settings["grasp"])) if frame else None
        try:
            self.detector.arm(
                mode,
                self.world.t,
                time_limit,
                float(settings.get("k", 0.0)),
                settings.get("joints", ()),
                float(settings.get("mass", 0.0)),
                float(settings.get("load_share", 0.0)),
            )
        except ValueError as error:
            return Ready(error=PortError(str(error), code=ReasonCode.INVALID_ARGUMENT))
        return Ready()

    def disarm(self) -> None:
        self.detector.disarm()

    def event(self) -> ContactEvent | None:
        return self._event

    def share_gone(self) -> float | None:
        return self.detector.share_gone()

    def force(self) -> tuple[float, float, float] | None:
        force = self.detector.force()
        return None if force is None else (float(force[0]), float(force[1]), float(force[2]))

    def grip(self) -> float | None:
        return self.detector.grip(self.world.t)
