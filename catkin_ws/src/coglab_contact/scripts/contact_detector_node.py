#!/usr/bin/python3
"""The node /contact_detector: publishes contact events on coglab/contact; ~arm (coglab_msgs/ArmContact) arms it.

Names are relative. Subscribes: lwr/external_torques (effort, Nm), lwr/joint_states (measured torques as effort),
lwr/state (FRI period), ih2_hand/hand_status, ih2_hand/fingertip_forces (~tactile_topic, optional), and tf2 for the
object of a reach.
Parameters: perception/frames; robot_description, for Jacobian and dynamics. Private: the fields of
coglab_contact.detector.DetectorSettings; ~thresholds_file: thresholds of the moving arm, learnt in simulation;
~learnt_file: thresholds that ~learn_motion learns from this robot's motions, read at the next start.
Publishes ~margin (std_msgs/Float64) at 20 Hz while watching, and ~signal (coglab_msgs/ContactSignal) at 20 Hz while
torques come; both at 100 Hz while a hand with touch sensors gives a load. With the joint samples, at most at 100 Hz:
~force (geometry_msgs/Vector3Stamped, base frame), the force (N) on the palm relative to that before the last watched
reach.
Services: ~learn (Learn): learn the noise at rest again. ~learn_motion (LearnMotion): true: record motions without
contact, false: learn from them. ~set_parameters (dynamic_reconfigure): coglab_contact.detector.TUNABLE.
"""

import dataclasses
import math
import sys
import threading
import time
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import rospy
import tf2_ros
from coglab_contact.detector import TUNABLE, ContactDetector, DetectorSettings
from coglab_contact.fused_detector import IN_MOTION, LIFT, OLDEST_SIGHT, RELEASE, FusedDetector
from coglab_contact.load import GripAndLoad
from coglab_contact.motion_thresholds import ThresholdError, Thresholds
from coglab_contact.moving_contact import MotionRecorder, MovingContact, unwritable
from coglab_msgs.msg import Contact, ContactSignal, FingertipForces, HandStatus, LwrState, ReasonCode
from coglab_msgs.srv import ArmContact, ArmContactResponse, Learn, LearnMotion, LearnMotionResponse, LearnResponse
from coglab_perception.frames import FrameNames, FramesError
from coglab_perception.tf_listener import TfListener
from coglab_py import parameters, steady
from coglab_py.node_start import init_node
from coglab_py.pace import Pace
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_py.publish import can_be_sent, publish
from coglab_py.reconfigure import Field, ReconfigureServer
from coglab_py.yaml_file import YamlError
from geometry_msgs.msg import Vector3, Vector3Stamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

FORCE_PERIOD = 0.009  # s, shortest time between two messages of ~force
SIGNAL = 0.01  # s, shortest time between two messages on ~signal


def made_at(message: JointState) -> float | None:
    """Returns the robot controller's time (s), which our bridge writes as ns to frame_id; None for other drivers."""
    text = message.header.frame_id
    return 1e-9 * int(text) if text.isdecimal() else None


def pose_of(place, turn) -> Pose | None:
    """Converts a message's point and quaternion to a pose; None if they are invalid."""
    p, q = np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w])
    if not (np.all(np.isfinite(p)) and np.all(np.isfinite(q)) and abs(float(np.linalg.norm(q)) - 1.0) < 0.01):
        return None
    return Pose(p, q)


class ContactDetectorNode:
    """ROS node of FusedDetector."""

    def __init__(self, urdf: str) -> None:
        settings = DetectorSettings()
        for field in dataclasses.fields(settings):
            default = getattr(settings, field.name)
            if isinstance(default, tuple):
                value = tuple(parameters.numbers(f"~{field.name}", default, len(default)))
            else:
                value = parameters.read(f"~{field.name}", type(default), default)
            setattr(settings, field.name, value)
        self.arm = cc.Chain(urdf)
        self.joints = tuple(self.arm.joint_names)
        self.learnt_file = parameters.read("~learnt_file", str, "")
        self.moving = MovingContact(self.thresholds(), cc.ArmDynamics(urdf), self.arm)
        held = GripAndLoad(lambda q: Pose(*self.arm.fk(np.asarray(q, dtype=float))).rotation.as_matrix())
        self.detector = FusedDetector(ContactDetector(settings, self.arm), self.moving, held=held)
        self.recorder: MotionRecorder | None = None
        self.lock = threading.Lock()
        self.position: list[float] | None = None
        self.velocity: list[float] | None = None
        self.joint_stamp = 0.0
        self.pace = Pace().follow()  # converts stamps to the time of the simulated cell
        self.last_sample: float | None = None  # s, time of the last torques, converted
        self.last_stamp = rospy.Time()
        self.heard = -math.inf  # s, monotonic arrival time of the last torques
        self.publisher = rospy.Publisher("coglab/contact", Contact, queue_size=10)
        self.margin = rospy.Publisher("~margin", Float64, queue_size=1)
        self.signal = rospy.Publisher("~signal", ContactSignal, queue_size=1)
        self.force = rospy.Publisher("~force", Vector3Stamped, queue_size=1, tcp_nodelay=True)
        self.force_stamp = 0.0
        frames = FrameNames.from_mapping(
            parameters.read("perception/frames", dict, {}), rospy.resolve_name("perception/frames")
        )
        self.base = frames.world
        self.buffer = tf2_ros.Buffer(rospy.Duration(2.0))
        self.listener = TfListener(self.buffer, self.base)
        self.grasp: tuple[str, Pose] | None = None  # frame of the object of the reach, and the palm in that frame
        self.shown: float | None = None  # time of the sample of the last ~signal
        rospy.Subscriber("lwr/joint_states", JointState, self.on_joints, queue_size=20, tcp_nodelay=True)
        rospy.Subscriber("lwr/state", LwrState, self.on_state, queue_size=1)
        rospy.Subscriber("ih2_hand/hand_status", HandStatus, self.on_hand, queue_size=1)
        tactile = parameters.read("~tactile_topic", str, "ih2_hand/fingertip_forces")
        rospy.Subscriber(tactile, FingertipForces, self.on_touch, queue_size=5, tcp_nodelay=True)
        self.torques = rospy.Subscriber(
            "lwr/external_torques", JointState, self.on_torques, queue_size=20, tcp_nodelay=True
        )
        rospy.Service("~arm", ArmContact, self.on_arm)
        rospy.Service("~learn", Learn, self.on_learn)
        rospy.Service("~learn_motion", LearnMotion, self.on_learn_motion)
        steady.SteadyTimer(0.05, self.on_timer, "signal")
        gains = [Field(name, text, getattr(settings, name), low, high) for name, (low, high, text) in TUNABLE.items()]
        self.reconfigure = ReconfigureServer(gains, self.tune)

    def tune(self, gains: dict[str, float]) -> None:
        """Use these settings (coglab_contact.detector.TUNABLE) from now on."""
        with self.lock:
            watches = self.detector.still
            watches.use(dataclasses.replace(watches.settings, **gains))

    def thresholds(self) -> Thresholds:
        """Returns the thresholds that this robot has learnt, else those of the package."""
        shipped = str(package_path("coglab_contact", "config", "contact_thresholds.yaml"))
        file = Path(parameters.read("~thresholds_file", str, shipped))
        if self.learnt_file and Path(self.learnt_file).is_file():
            file = Path(self.learnt_file)
        return Thresholds.load(file)

    def refuses(self, message: JointState | HandStatus | FingertipForces) -> bool:
        """Returns whether the stamp of a message is invalid for other messages; logs a warning."""
        if can_be_sent(message.header.stamp):
            return False
        rospy.logwarn_throttle(5.0, f"contact detector: {message._type} refused: its stamp is out of range")
        return True

    def on_state(self, message: LwrState) -> None:
        """Set the FRI period: the stamps of reception jitter, the robot's measurements do not."""
        with self.lock:
            self.moving.observer.period = message.cycle_time

    def on_joints(self, message: JointState) -> None:
        """Process positions, velocities and torques in wire order. Missing velocities are differentiated positions."""
        index = {name: i for i, name in enumerate(message.name)}
        if any(name not in index for name in self.joints) or len(message.position) != len(message.name):
            return
        if self.refuses(message):
            return
        order = [index[name] for name in self.joints]
        position = [message.position[i] for i in order]
        stamp = self.pace.of(message.header.stamp.to_sec())
        if len(message.velocity) == len(message.name):
            velocity = [message.velocity[i] for i in order]
        elif self.position is not None and stamp > self.joint_stamp:
            velocity = [(a - b) / (stamp - self.joint_stamp) for a, b in zip(position, self.position, strict=False)]
        else:
            velocity = None
        self.position, self.velocity, self.joint_stamp = position, velocity, stamp
        if len(message.effort) != len(message.name):
            return
        with self.lock:
            event = self.detector.feed_measured(stamp, position, [message.effort[i] for i in order], made_at(message))
            if self.recorder is not None:
                self.recorder.look()
            force = self.detector.force() if abs(stamp - self.force_stamp) >= FORCE_PERIOD else None
        self.publish_event(event, message.header.stamp)
        if force is not None:
            self.force_stamp = stamp
            out = Vector3Stamped(vector=Vector3(*force))
            out.header.stamp, out.header.frame_id = message.header.stamp, self.base
            publish(self.force, out)

    def on_hand(self, message: HandStatus) -> None:
        """Process the finger motors. An empty hand has no payload."""
        if self.refuses(message):
            return
        with self.lock:
            self.detector.holds = message.connected and message.holding
            if message.connected and not message.holding and self.moving.load > 0.0:
                self.detector.set_payload(0.0)
            event = self.detector.feed_hand(self.pace.of(message.header.stamp.to_sec()), message.motors)
        self.publish_event(event, message.header.stamp)

    def on_touch(self, message: FingertipForces) -> None:
        """Process the forces on fingers and palm."""
        if self.refuses(message):
            return
        forces = [(force.x, force.y, force.z) for force in [*message.forces, message.palm]]
        with self.lock:
            event = self.detector.feed_touch(self.pace.of(message.header.stamp.to_sec()), forces, message.deviation)
            giving = self.detector.share_gone() is not None
        self.publish_event(event, message.header.stamp)
        if giving:  # the grip follows this signal
            self.publish_signal()

    def on_torques(self, message: JointState) -> None:
        """Process each torque sample; an event is published at once."""
        if len(message.effort) != 7 or self.position is None or self.velocity is None or self.refuses(message):
            return
        with self.lock:
            self.last_stamp = message.header.stamp
            stamp = self.last_sample = self.pace.of(message.header.stamp.to_sec())
            self.heard = time.monotonic()
            event = self.detector.feed(stamp, message.effort, self.position, self.velocity)
        self.publish_event(event, message.header.stamp)

    def publish_event(self, event, stamp) -> None:
        """Publish an event, if there is one. ``stamp``: of the sample that decided."""
        if event is None:
            return
        out = Contact(
            source=event.source,
            contact=event.contact,
            margin=event.margin,
            confidence=event.confidence,
            reason_code=event.code,
            message=event.message,
        )
        out.header.stamp = stamp
        publish(self.publisher, out)
        rospy.loginfo("contact detector: %s", event.message)

    def silent(self) -> bool:
        """True if no torques have come for 1 s."""
        return (time.monotonic() - self.heard) * self.pace.factor > 1.0

    def on_arm(self, request):
        """Arm or disarm the detector."""
        with self.lock:
            if request.mode == "off":
                self.detector.disarm()
                self.grasp = None
                return ArmContactResponse(success=True, message="off")
            now = self.last_sample
            if now is None or self.silent():
                slowed = f" (the simulated cell runs at {self.pace.factor:g} of real time)"
                return ArmContactResponse(
                    False,
                    ReasonCode.NODE_SILENT,
                    f"no joint torques on {self.torques.resolved_name} for 1.0 s. The robot node sends them with every "
                    "FRI datagram: it is not running, the robot is not connected, or this computer is overloaded"
                    f"{slowed if self.pace.factor < 1.0 else ''}. See ./coglab doctor",
                )
            try:
                self.grasp = self.grasp_of(request)
                self.detector.arm(
                    request.mode, now, request.timeout, request.k, request.joints, request.mass, request.load_share
                )
            except ValueError as error:
                return ArmContactResponse(False, ReasonCode.INVALID_ARGUMENT, str(error))
        when = "now" if request.mode in (IN_MOTION, LIFT, RELEASE) else "once the arm is still"
        return ArmContactResponse(
            True, ReasonCode.NONE, f"watching for {request.mode} for {request.timeout:.1f} s, {when}"
        )

    @staticmethod
    def grasp_of(request) -> tuple[str, Pose] | None:
        """Returns the object of a request; ValueError for an invalid pose."""
        if not request.frame:
            return None
        p, q = request.grasp.position, request.grasp.orientation
        grasp = pose_of(p, q)
        if grasp is None:
            raise ValueError(
                f"grasp: expected a finite place and a unit quaternion, got ({p.x:g}, {p.y:g}, {p.z:g}) m and "
                f"({q.x:g}, {q.y:g}, {q.z:g}, {q.w:g})"
            )
        return request.frame, grasp

    def look_at_object(self) -> None:
        """Process the pose of the palm relative to the tracked object of the reach."""
        with self.lock:
            grasp, position, velocity = self.grasp, self.position, self.velocity
        if grasp is None or position is None or velocity is None:
            return
        try:
            transform = self.buffer.lookup_transform(self.base, grasp[0], rospy.Time(0))
        except tf2_ros.TransformException:
            return
        if abs((rospy.Time.now() - transform.header.stamp).to_sec()) > OLDEST_SIGHT:
            return
        seen = pose_of(transform.transform.translation, transform.transform.rotation)
        if seen is None:
            return
        distance, angle = Pose(*self.arm.fk(np.asarray(position))).distance(seen * grasp[1])
        speed = float(np.linalg.norm(self.arm.jacobian(np.asarray(position))[:3] @ np.asarray(velocity)))
        now = rospy.Time.now()
        with self.lock:
            event = self.detector.feed_sight(self.pace.of(now.to_sec()), distance, angle, speed)
        self.publish_event(event, now)

    def on_learn_motion(self, request):
        """True: start recording motions without contact, if a file can be written. False: stop, learn, write the file
        and use it."""
        with self.lock:
            if request.gather:
                why = self.no_file()
                if why:
                    return LearnMotionResponse(False, ReasonCode.BAD_FILE, why)
                self.recorder = MotionRecorder(self.moving)
                return LearnMotionResponse(
                    True, ReasonCode.NONE, "recording: let the arm reach, with and without objects in the hand"
                )
            recorder, self.recorder = self.recorder, None
            if recorder is None:
                return LearnMotionResponse(
                    False, ReasonCode.NOTHING_RUNS, "nothing was recorded: call with gather true first"
                )
            reaches = len(recorder.reaches)
        # Learning from minutes of samples takes seconds: the lock is free meanwhile, so the detector continues.
        try:
            thresholds = recorder.learn()
            thresholds.save(Path(self.learnt_file))
        except ThresholdError as error:
            return LearnMotionResponse(False, ReasonCode.OUT_OF_RANGE, str(error))
        except OSError as error:
            with self.lock:
                # A disk error can be repaired; the motions would have to be repeated.
                self.recorder = self.recorder or recorder
            return LearnMotionResponse(
                False, ReasonCode.BAD_FILE, f"{error}; the recording is kept: call again with gather false"
            )
        with self.lock:
            self.moving.use(thresholds)
        return LearnMotionResponse(
            True, ReasonCode.NONE, f"learnt from {reaches} motions, written to {self.learnt_file}"
        )

    def no_file(self) -> str:
        """Returns the reason why the result could not be written, else ''. Checked first: recording takes minutes."""
        if not self.learnt_file:
            return "parameter ~learnt_file, the file to write, is not set: start with contact_learnt_file:=FILE"
        return unwritable(self.learnt_file)

    def on_learn(self, _request):
        """Learn the noise at rest."""
        with self.lock:
            try:
                return LearnResponse(True, ReasonCode.NONE, self.detector.still.learn())
            except ValueError as error:
                return LearnResponse(False, ReasonCode.NODE_SILENT if self.silent() else ReasonCode.BUSY, str(error))

    def on_timer(self) -> None:
        """Process the sight of the object; publish margin and signal."""
        self.look_at_object()
        self.publish_signal()

    def publish_signal(self) -> None:
        """Publish the state of the detector once per torque sample, at most every SIGNAL s."""
        with self.lock:
            before, stamp, sent = self.shown, self.last_sample, self.last_stamp
            if before is not None and stamp is not None and 0.0 < stamp - before < SIGNAL:
                return
            self.shown = stamp
            seen, settings = self.detector.look(), self.detector.still.settings
            grip = None if stamp is None else self.detector.grip(stamp)
        if seen.state == "watching":
            publish(self.margin, Float64(seen.margin))
        if stamp is None or stamp == before:
            return
        message = ContactSignal(
            state=seen.state,
            mode=seen.mode,
            change=list(seen.change),
            threshold=list(seen.threshold),
            watched=list(seen.watched),
            window=settings.window,
            k=seen.k,
            margin=seen.margin,
            grip=math.nan if grip is None else grip,
            rest_samples=seen.rest_samples,
            learnt=seen.rest_samples >= settings.learn_samples,
        )
        message.header.stamp = sent
        publish(self.signal, message)


def main() -> int:
    """Entry point."""
    init_node("contact_detector")
    urdf = parameters.found_above("robot_description", str)
    if urdf is None:
        rospy.logfatal("contact_detector: parameter robot_description is missing; load lwr_description's URDF")
        return 1
    try:
        ContactDetectorNode(urdf)
    except (parameters.ParameterError, FramesError, ThresholdError, YamlError, OSError) as error:
        rospy.logfatal("contact_detector: %s", error)
        return 1
    return steady.spin()


if __name__ == "__main__":
    sys.exit(main())
