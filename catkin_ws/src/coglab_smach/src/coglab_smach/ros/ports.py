"""ROS ports of perception, object database and contact detector. The arm is in ros.arm, the hand in ros.hand.

All names are relative to the node's namespace, so that two robots can share one ROS graph.
"""

from __future__ import annotations

import math
import threading
import time
from typing import Any

from coglab_msgs.msg import Contact, ContactSignal, HandoverBelief, ReasonCode
from coglab_msgs.msg import Recognition as RecognitionMsg
from coglab_msgs.srv import ArmContact, FreePlaces, GetObject, InitVision, ListObjects, LocateObject
from coglab_py.pose import IDENTITY
from coglab_py.yaml_file import YamlError, parse
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3Stamped

from coglab_smach.ports.interfaces import OLDEST_BELIEF, OLDEST_RECOGNITION, Ahead, ContactEvent, Located, Recognition
from coglab_smach.ports.pending import Pending, Permit, PortError, Threaded
from coglab_smach.ros.calls import SERVICE_WAIT, Newest, call, call_now, mapped

ARM = "contact_detector/arm"
OLDEST_SIGNAL = 0.3  # s, oldest ContactSignal that is used
OLDEST_FORCE = 0.1  # s, oldest force that is used
DEFAULT_SHARE = 0.5  # share of the load, if the request does not set one


class RosPerception:
    """PerceptionPort on the perception services and the recogniser's topics."""

    def __init__(self) -> None:
        self._recognition = Newest("perception/recognition", RecognitionMsg)
        self._belief = Newest("perception/belief", HandoverBelief)

    def init_vision(self, time_limit: float) -> Pending:
        # Report a missing service before the caller's time limit ends.
        wait = max(0.5, min(SERVICE_WAIT, time_limit - 1.0))
        return mapped(call("perception/init_vision", InitVision, wait, timeout=time_limit), lambda r: r.message)

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        pending = call("perception/locate_object", LocateObject, wait=2.0, object_id=object_id, timeout=time_limit)
        return mapped(pending, lambda r: _located(r.frame_id, r.pose.header.frame_id, r.pose.pose, r.age))

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        pending = call("perception/free_places", FreePlaces, wait=2.0, object_id=object_id, timeout=time_limit)
        return mapped(pending, lambda r: [_located("", p.header.frame_id, p.pose, 0.0) for p in r.places])

    def recognition(self) -> Recognition:
        message = self._recognition.message
        if message is None or self._recognition.age() > OLDEST_RECOGNITION:
            return Recognition()
        return Recognition(
            message.pattern,
            message.confidence,
            message.decided,
            dict(zip(message.names, message.probabilities, strict=False)),
        )

    def ahead(self) -> Ahead:
        message = self._belief.message
        if message is None or self._belief.age() > OLDEST_BELIEF:
            return Ahead()
        variances = [message.place_covariance[i] for i in (0, 4, 8)]
        if variances[0] < 0.0:
            return Ahead(message.offer, message.request, message.object_id)
        p, of = message.place, message.object_frame or message.hand
        deviation = math.sqrt(max(0.0, *variances))
        return Ahead(message.offer, message.request, message.object_id, of + "_ahead", (p.x, p.y, p.z), deviation)


def _located(frame: str, parent: str, pose: Pose, age: float) -> Located:
    p, q = pose.position, pose.orientation
    return Located(frame, parent, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w), age)


def _entry(object_id: str, text: str) -> dict[str, Any]:
    try:
        entry: dict[str, Any] = parse(text, f"entry of '{object_id}'").value
    except YamlError as error:
        raise PortError(str(error), code=ReasonCode.BAD_FILE) from None
    return entry


class RosDatabase:
    """DatabasePort on object_database."""

    def get_object(self, object_id: str) -> Pending:
        pending = call("object_database/get_object", GetObject, wait=5.0, object_id=object_id)
        return mapped(pending, lambda r: _entry(object_id, r.yaml))

    def list_objects(self) -> Pending:
        return mapped(call("object_database/list_objects", ListObjects, wait=1.0), lambda r: list(r.object_ids))


class RosContact:
    """ContactPort on the topic coglab/contact, the arming service of its publisher, and the detector's signal."""

    def __init__(self) -> None:
        self._force = Newest("contact_detector/force", Vector3Stamped)
        self._signal = Newest("contact_detector/signal", ContactSignal)
        self._needed: float | None = None  # share of the load in mode 'release'; None in other modes
        self._armed_at = 0.0
        self._event: ContactEvent | None = None
        self._wanted: bool | None = None
        self._before = threading.Event()
        self._before.set()
        self._newest = Newest("coglab/contact", Contact, self._on_contact)

    def _on_contact(self, message: Contact) -> None:
        if self._wanted is not None and self._event is None and message.contact == self._wanted:
            self._event = ContactEvent(
                message.contact,
                message.source,
                message.margin,
                message.message,
                message.confidence,
                message.reason_code,
            )

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        self._event = None
        self._wanted = mode != "release"
        share = float(settings.get("load_share", 0.0))
        self._needed = None if self._wanted else share if share > 0.0 else DEFAULT_SHARE
        self._armed_at = time.monotonic()
        grasp = settings.get("grasp", {"xyz": (0.0, 0.0, 0.0), "quaternion": IDENTITY})
        return mapped(
            self._request(
                2.0,
                mode=mode,
                timeout=time_limit,
                k=float(settings.get("k", 0.0)),
                joints=list(settings.get("joints", [])),
                mass=float(settings.get("mass", 0.0)),
                load_share=share,
                frame=str(settings.get("frame", "")),
                grasp=Pose(Point(*grasp["xyz"]), Quaternion(*grasp["quaternion"])),
            ),
            lambda r: None,
        )

    def _request(self, wait: float, **fields: Any) -> Pending:
        """Send one request after the end of the previous one. A disarm must arrive neither after a later arm nor before
        the arm that it ends."""
        before, self._before = self._before, threading.Event()
        over = self._before

        def run(permit: Permit) -> Any:
            try:
                end = time.monotonic() + SERVICE_WAIT
                while not before.wait(0.05):
                    permit.check()
                    if time.monotonic() > end:
                        raise PortError(
                            f"{ARM} has not answered the request before this one for {SERVICE_WAIT:.0f} s",
                            code=ReasonCode.NODE_SILENT,
                        )
                return call_now(ARM, ArmContact, permit, wait, **fields)
            finally:
                over.set()

        return Threaded(run, f"service {ARM}")

    def disarm(self) -> None:
        if self._wanted is not None:
            self._wanted = self._needed = None
            self._request(0.5, mode="off")

    def event(self) -> ContactEvent | None:
        return self._event

    def share_gone(self) -> float | None:
        signal, newest = self._signal.message, self._signal.stamp
        if self._needed is None or signal is None or newest < self._armed_at or self._signal.age() > OLDEST_SIGNAL:
            return None
        watched = signal.mode == "release" and signal.state == "watching"
        return float(signal.margin) * self._needed if watched else None

    def force(self) -> tuple[float, float, float] | None:
        message = self._force.message
        if message is None or self._force.age() > OLDEST_FORCE:
            return None
        return (message.vector.x, message.vector.y, message.vector.z)

    def grip(self) -> float | None:
        signal = self._signal.message
        if signal is None or self._signal.age() > OLDEST_SIGNAL or not math.isfinite(signal.grip):
            return None
        return float(signal.grip)
