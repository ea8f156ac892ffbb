"""The ports over ROS: services, actions and topics of the robot, the hand, perception, database and contact detector.

A rospy service call has no time limit of its own, so each runs in a thread and the state that waits gives it one.
All names are relative: in the node's own namespace, so that two robots fit in one graph.
"""
from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import rospy
import tf2_ros
import yaml
from coglab_msgs.msg import Contact, ControllerStatus, DmpFeedback, FeedbackStatus, FinishedPtp, LwrState
from coglab_msgs.msg import Recognition as RecognitionMsg
from coglab_msgs.srv import (
    AddPtp,
    ArmContact,
    ExecuteDmp,
    FeedbackSelect,
    FreePlaces,
    GetObject,
    InitVision,
    ListControllers,
    LoadController,
    LoadDmps,
    LocateObject,
    LwrCommand,
    SwitchController,
    SwitchDmp,
)
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import JointState

from .pending import Pending, Polled, PortError, Ready, Threaded
from .ports import ContactEvent, DmpProgress, DmpRequest, Located, Recognition

JOINTS = ("lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6")
SERVICE_WAIT = 20.0
"""s to wait for a service to appear: a node may still be starting."""


class Newest:
    """The newest message of a topic with the time it came (monotonic s)."""

    def __init__(self, topic: str, kind: Any, on_message: Callable[[Any], None] | None = None) -> None:
        self.message: Any = None
        self.stamp = -1e9
        self._on_message = on_message
        self._subscriber = rospy.Subscriber(topic, kind, self._take, queue_size=50)

    def _take(self, message: Any) -> None:
        self.message, self.stamp = message, time.monotonic()
        if self._on_message is not None:
            self._on_message(message)

    def age(self) -> float:
        """s since the last message; large if there was none."""
        return time.monotonic() - self.stamp


def call(name: str, kind: Any, wait: float = SERVICE_WAIT, **fields: Any) -> Pending:
    """Call a service in a thread; a response with ``success`` false becomes a PortError with its message."""

    def run() -> Any:
        full = rospy.resolve_name(name)
        try:
            rospy.wait_for_service(full, timeout=wait)
        except rospy.ROSException:
            raise PortError(f"service {full} is not there after {wait:.0f} s; is its node running?") from None
        try:
            response = rospy.ServiceProxy(full, kind)(**fields)
        except rospy.ServiceException as error:
            raise PortError(f"service {full} broke off; its node may have died", (str(error),)) from None
        if getattr(response, "success", True) is False:
            raise PortError(f"{full} refused: {response.message}")
        return response

    return Threaded(run, f"service {name}")


def mapped(pending: Pending, value: Callable[[Any], Any]) -> Pending:
    """The same call with its response turned into a value."""
    return Polled(pending.done, lambda: value(pending.result()), pending.cancel)


class RosArm:
    """ArmPort over controller_manager and lwr. Shows the goal of the running motion as tf frame ``dmp_goal``."""

    def __init__(self, manager: str = "controller_manager", lwr: str = "lwr") -> None:
        self._manager, self._lwr = manager, lwr
        self._lock = threading.Lock()
        self._finished: set[int] = set()
        self._started_at = 0.0
        self._lwr_state = Newest(f"{lwr}/state", LwrState)
        self._joints = Newest(f"{lwr}/joint_states", JointState)
        self._feedback = Newest(f"{manager}/dmp/feedback", DmpFeedback)
        self._status = Newest(f"{manager}/status", ControllerStatus)
        self._cascade = Newest(f"{manager}/feedback/status", FeedbackStatus)
        self._ptp = Newest(f"{manager}/ptp/finished_ptp", FinishedPtp, self._on_finished)
        self._shown_goal = tf2_ros.StaticTransformBroadcaster()

    def _on_finished(self, message: FinishedPtp) -> None:
        with self._lock:
            self._finished.add(message.ptp_id)

    def load_controller(self, controller_id: str, controller_type: str) -> Pending:
        def run() -> None:
            loaded = _wait(call(f"{self._manager}/list_controllers", ListControllers))
            if (controller_id, controller_type) in zip(loaded.controller_ids, loaded.controller_types, strict=False):
                return
            _wait(call(f"{self._manager}/load_controller", LoadController, controller_id=controller_id,
                       controller_type=controller_type))

        return Threaded(run, f"loading of plug-in '{controller_id}'")

    def load_dmps(self, filename: str) -> Pending:
        return mapped(call(f"{self._manager}/dmp/load_dmps", LoadDmps, filename=filename), lambda r: r.num_loaded)

    def lwr_command(self, event: str) -> Pending:
        return mapped(call(f"{self._lwr}/command", LwrCommand, event=event), lambda r: r.message)

    def motion_allowed(self) -> tuple[bool, str]:
        state = self._lwr_state.message
        if state is None:
            return False, f"{self._lwr}/state has never been published; is the robot node running?"
        if self._joints.age() > 1.0:
            return False, f"{self._lwr}/joint_states is silent for {min(self._joints.age(), 999):.1f} s"
        if state.motion_allowed:
            return True, ""
        return False, state.reason or f"the LWR interface is in state '{state.supervisor}'"

    def switch_controller(self, controller_id: str) -> Pending:
        return mapped(call(f"{self._manager}/switch_controller", SwitchController, wait=5.0,
                           controller_id=controller_id), lambda r: r.controller_type)

    def apply_profile(self, profile: str) -> Pending:
        return mapped(call(f"{self._manager}/feedback/apply_profile", FeedbackSelect, wait=5.0, names=[profile],
                           reason=""), lambda r: None)

    def profile_settled(self, profile: str) -> tuple[bool, str]:
        message = self._cascade.message
        if message is None:
            return False, f"{self._manager}/feedback/status has never been published; is the robot node running?"
        if message.profile != profile:
            return False, f"profile '{message.profile}' is in force"
        busy = [f"{c.name} is {c.activity}" for c in message.controllers if not c.enabled and c.activity != "off"]
        return not busy, ", ".join(busy)

    def execute_dmp(self, request: DmpRequest) -> Pending:
        self._started_at = time.monotonic()
        fields = _dmp_fields(request)
        pending = call(f"{self._manager}/dmp/execute_dmp", ExecuteDmp, wait=5.0, initial_state=0,
                       initial_position=Point(), goal_frame=request.goal_frame, **fields)

        def accepted(response: Any) -> None:
            self._started_at = time.monotonic()
            self._show_goal(request)

        return mapped(pending, accepted)

    def _show_goal(self, request: DmpRequest) -> None:
        """For whoever looks on: where the palm is to go, relative to the tracked frame. Nothing in control reads it."""
        shown = TransformStamped()
        shown.header.stamp = rospy.Time.now()
        shown.header.frame_id, shown.child_frame_id = request.goal_frame, "dmp_goal"
        shown.transform.translation = Vector3(*request.goal_offset)
        shown.transform.rotation = Quaternion(*(request.target_orientation or (0.0, 0.0, 0.0, 1.0)))
        self._shown_goal.sendTransform(shown)

    def switch_dmp(self, request: DmpRequest) -> Pending:
        return mapped(call(f"{self._manager}/dmp/switch_dmp", SwitchDmp, wait=1.0, **_dmp_fields(request)),
                      lambda r: None)

    def dmp_progress(self) -> DmpProgress:
        message = self._feedback.message
        if message is None or self._feedback.stamp < self._started_at:
            return DmpProgress("running" if self._started_at else "idle")
        return DmpProgress(message.state, message.reason, message.primitive_id, message.phase,
                           message.remaining_distance)

    def move_ptp(self, position: Sequence[float], max_velocity: Sequence[float]) -> Pending:
        with self._lock:
            self._finished.clear()
        added = call(f"{self._manager}/ptp/add_ptp", AddPtp, wait=5.0, position=list(position),
                     max_vel=list(max_velocity), max_acc=[])

        def finished() -> bool:
            if not added.done():
                return False
            response = added.result()
            with self._lock:
                if response.ptp_id in self._finished:
                    return True
            status = self._status.message
            if status is not None and status.state == "fault":
                raise PortError("the point-to-point motion ended in a fault of the controller manager",
                                (status.reason,))
            allowed, why = self.motion_allowed()
            if not allowed:
                raise PortError("the arm does not follow any more", (why,))
            return False

        return Polled(finished, lambda: None)

    def joint_positions(self) -> tuple[float, ...] | None:
        message = self._joints.message
        if message is None or self._joints.age() > 0.5:
            return None
        by_name = dict(zip(message.name, message.position, strict=False))
        return tuple(by_name[name] for name in JOINTS) if all(name in by_name for name in JOINTS) else None

    def hold(self, reason: str) -> Pending:
        return self.lwr_command("hold")


def _wait(pending: Pending, limit: float = 60.0) -> Any:
    """Block until a pending call has ended: only inside a thread of its own, never in a state."""
    end = time.monotonic() + limit
    while not pending.done():
        if time.monotonic() > end:
            raise PortError(f"no answer within {limit:.0f} s")
        time.sleep(0.005)
    return pending.result()


def _dmp_fields(request: DmpRequest) -> dict[str, Any]:
    orientation = request.target_orientation
    return {"primitive_id": request.primitive_id, "dmp_ratio": request.dmp_ratio,
            "goal_offset": Point(*request.goal_offset), "orientation_control": orientation is not None,
            "target_orientation": Quaternion(*(orientation if orientation is not None else (0, 0, 0, 0)))}


class RosPerception:
    """PerceptionPort over perception and the recogniser's topic."""

    def __init__(self, namespace: str = "perception") -> None:
        self._ns = namespace
        self._recognition = Newest(f"{namespace}/recognition", RecognitionMsg)

    def init_vision(self, time_limit: float) -> Pending:
        return mapped(call(f"{self._ns}/init_vision", InitVision, timeout=time_limit), lambda r: r.message)

    def locate_object(self, object_id: str, time_limit: float) -> Pending:
        pending = call(f"{self._ns}/locate_object", LocateObject, wait=2.0, object_id=object_id, timeout=time_limit)
        return mapped(pending, lambda r: _located(r.frame_id, r.pose.header.frame_id, r.pose.pose, r.age))

    def free_places(self, object_id: str, time_limit: float) -> Pending:
        pending = call(f"{self._ns}/free_places", FreePlaces, wait=2.0, object_id=object_id, timeout=time_limit)
        return mapped(pending, lambda r: [_located("", p.header.frame_id, p.pose, 0.0) for p in r.places])

    def recognition(self) -> Recognition:
        message = self._recognition.message
        if message is None or self._recognition.age() > 0.5:
            return Recognition()
        return Recognition(message.pattern, message.confidence, message.decided,
                           dict(zip(message.names, message.probabilities, strict=False)))


def _located(frame: str, parent: str, pose: Pose, age: float) -> Located:
    p, q = pose.position, pose.orientation
    return Located(frame, parent, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w), age)


class RosDatabase:
    """DatabasePort over object_database."""

    def __init__(self, namespace: str = "object_database") -> None:
        self._ns = namespace

    def get_object(self, object_id: str) -> Pending:
        pending = call(f"{self._ns}/get_object", GetObject, wait=5.0, object_id=object_id)
        return mapped(pending, lambda r: yaml.safe_load(r.yaml))


class RosContact:
    """ContactPort: the topic coglab/contact, and the service that arms whoever publishes there."""

    def __init__(self, topic: str = "coglab/contact", service: str = "contact_detector/arm") -> None:
        self._service = service
        self._event: ContactEvent | None = None
        self._wanted: bool | None = None
        self._newest = Newest(topic, Contact, self._on_contact)

    def _on_contact(self, message: Contact) -> None:
        if self._wanted is not None and self._event is None and message.contact == self._wanted:
            self._event = ContactEvent(message.contact, message.source, message.margin, message.message)

    def arm(self, mode: str, time_limit: float, settings: dict[str, Any]) -> Pending:
        self._event = None
        self._wanted = mode != "release"
        return mapped(call(self._service, ArmContact, wait=2.0, mode=mode, timeout=time_limit,
                           k=float(settings.get("k", 0.0)), joints=list(settings.get("joints", [])),
                           mass=float(settings.get("mass", 0.0)),
                           load_share=float(settings.get("load_share", 0.0))), lambda r: None)

    def disarm(self) -> None:
        if self._wanted is not None:
            self._wanted = None
            call(self._service, ArmContact, wait=0.5, mode="off", timeout=0.0, k=0.0, joints=[], mass=0.0,
                 load_share=0.0)

    def event(self) -> ContactEvent | None:
        return self._event


__all__ = ["JOINTS", "Newest", "Ready", "RosArm", "RosContact", "RosDatabase", "RosPerception", "call", "mapped"]
