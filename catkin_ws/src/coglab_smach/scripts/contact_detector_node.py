#!/usr/bin/python3
"""The node /contact_detector: external joint torques -> coglab/contact, armed by ~arm (coglab_msgs/ArmContact).

Subscribes lwr/external_torques (effort, Nm) and lwr/joint_states; names are relative. Parameters (private): the fields
of coglab_smach.contact.detector.DetectorSettings; robot_description is read for the Jacobian.
Publishes at 20 Hz ~margin (std_msgs/Float64) while watching, ~signal (coglab_msgs/ContactSignal) while torques come.
Service ~learn (std_srvs/Trigger): the noise at rest anew.
"""

import dataclasses
import sys
import threading

import coglab_controllers as cc
import numpy as np
import rospy
from coglab_msgs.msg import Contact, ContactSignal, ReasonCode
from coglab_msgs.srv import ArmContact, ArmContactResponse
from coglab_py import parameters
from coglab_smach.contact.detector import ContactDetector, DetectorSettings
from coglab_smach.ros.publish import publish
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger, TriggerResponse


class ContactDetectorNode:
    """Thin node over ContactDetector."""

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
        self.detector = ContactDetector(settings, lambda q: self.arm.jacobian(np.asarray(q, dtype=float))[:3])
        self.lock = threading.Lock()
        self.position: list[float] | None = None
        self.velocity: list[float] | None = None
        self.joint_stamp = 0.0
        self.last_sample: float | None = None
        self.publisher = rospy.Publisher("coglab/contact", Contact, queue_size=10)
        self.margin = rospy.Publisher("~margin", Float64, queue_size=1)
        self.signal = rospy.Publisher("~signal", ContactSignal, queue_size=1)
        self.shown: float | None = None  # stamp of the sample that ~signal was published for
        rospy.Subscriber("lwr/joint_states", JointState, self.on_joints, queue_size=1, tcp_nodelay=True)
        self.torques = rospy.Subscriber(
            "lwr/external_torques", JointState, self.on_torques, queue_size=20, tcp_nodelay=True
        )
        rospy.Service("~arm", ArmContact, self.on_arm)
        rospy.Service("~learn", Trigger, self.on_learn)
        rospy.Timer(rospy.Duration(0.05), self.on_timer)

    def on_joints(self, message: JointState) -> None:
        """Positions and velocities in wire order; velocities are differentiated where the message has none."""
        index = {name: i for i, name in enumerate(message.name)}
        if any(name not in index for name in self.joints) or len(message.position) != len(message.name):
            return
        order = [index[name] for name in self.joints]
        position = [message.position[i] for i in order]
        stamp = message.header.stamp.to_sec()
        if len(message.velocity) == len(message.name):
            velocity = [message.velocity[i] for i in order]
        elif self.position is not None and stamp > self.joint_stamp:
            velocity = [(a - b) / (stamp - self.joint_stamp) for a, b in zip(position, self.position, strict=False)]
        else:
            velocity = None
        self.position, self.velocity, self.joint_stamp = position, velocity, stamp

    def on_torques(self, message: JointState) -> None:
        """Each torque sample goes through the detector; an event is published at once."""
        if len(message.effort) != 7 or self.position is None or self.velocity is None:
            return
        with self.lock:
            stamp = self.last_sample = message.header.stamp.to_sec()
            event = self.detector.feed(stamp, message.effort, self.position, self.velocity)
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
        out.header.stamp = message.header.stamp
        publish(self.publisher, out)
        rospy.loginfo("contact detector: %s", event.message)

    def on_arm(self, request):
        """Arm or disarm."""
        with self.lock:
            if request.mode == "off":
                self.detector.disarm()
                return ArmContactResponse(success=True, message="off")
            now = self.last_sample
            if now is None or abs(rospy.Time.now().to_sec() - now) > 1.0:
                return ArmContactResponse(
                    False,
                    ReasonCode.NODE_SILENT,
                    f"no torques on {self.torques.resolved_name} for 1 s; is the robot connected?",
                )
            try:
                self.detector.arm(
                    request.mode, now, request.timeout, request.k, request.joints, request.mass, request.load_share
                )
            except ValueError as error:
                return ArmContactResponse(False, ReasonCode.INVALID_ARGUMENT, str(error))
        return ArmContactResponse(
            True, ReasonCode.NONE, f"watching for {request.mode} for {request.timeout:.1f} s once the arm is still"
        )

    def on_learn(self, _request):
        """Noise at rest."""
        with self.lock:
            try:
                return TriggerResponse(True, self.detector.learn())
            except ValueError as error:
                return TriggerResponse(False, str(error))

    def on_timer(self, _event) -> None:
        """Live margin and signal."""
        with self.lock:
            before, stamp = self.shown, self.last_sample
            self.shown = stamp
            seen, settings = self.detector.look(), self.detector.settings
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
            rest_samples=seen.rest_samples,
            learnt=seen.rest_samples >= settings.learn_samples,
        )
        message.header.stamp = rospy.Time.from_sec(stamp)
        publish(self.signal, message)


def main() -> int:
    """Entry point."""
    rospy.init_node("contact_detector")
    urdf = parameters.found_above("robot_description", str)
    if urdf is None:
        rospy.logfatal("contact_detector: parameter robot_description is missing; load lwr_description's URDF")
        return 1
    try:
        ContactDetectorNode(urdf)
    except parameters.ParameterError as error:
        rospy.logfatal("contact_detector: %s", error)
        return 1
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
