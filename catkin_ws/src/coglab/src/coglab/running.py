"""The running robot, real or simulated, over ROS 1. Only this module imports rospy."""

from __future__ import annotations

import atexit
import io
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import urlparse

try:
    import rosgraph
    import rospy
    import tf2_ros
except ImportError as error:
    raise ImportError(
        f"coglab.connect() needs ROS 1, and it is not there ({error}): use ./coglab shell python3, or install Debian's "
        "python3-rospy and python3-tf2-ros; coglab.World needs no ROS master"
    ) from error
from coglab_msgs.msg import HandoverResult, ReasonCode, Say, Transition
from coglab_msgs.msg import MasterState as MasterStateMessage
from coglab_msgs.srv import LwrCommand, Start
from coglab_perception.tf_listener import TfListener
from coglab_py.pose import Pose
from coglab_py.steady import Stamps
from coglab_smach.context.master_state import MasterState
from coglab_smach.context.requests import TriggerReply
from coglab_smach.kinematics.reachability import default_arm
from coglab_smach.ports.pending import PortError
from coglab_smach.ros.arm import RosArm
from coglab_smach.ros.calls import PACE, Newest, call
from coglab_smach.ros.hand import RosHand
from geometry_msgs.msg import TransformStamped
from std_srvs.srv import Trigger

from coglab.results import ACTIONS, Event, Exchange
from coglab.robot import Robot

BASE = "world"
KEPT_EVENTS = 10_000
SHOW_PERIOD = 0.02  # s between two broadcasts of an own frame
ANSWER = 2.0  # s, longest wait for an answer of the master or of a node
LATCHED = 0.2  # s in which a latched message comes after its topic is connected


class NoRobot(ConnectionError):
    """There is no robot to connect to. The sentence has the next step."""


def connect(master: str = "", *, namespace: str = "", limit: float = 10.0) -> Robot:
    """Connect to the running robot and return it. Use it in a ``with`` block.

    ``master``: address of the ROS master, such as "http://127.0.0.1:11311", or its port; by default ROS_MASTER_URI.
    ``namespace``: of the robot, if it was launched in one. ``limit``: s, longest wait for messages of the arm.

    The process becomes a new node, "coglab_python_..."; a process that is already a node stays that node.
    Several connections in a process are possible, to one master. NoRobot: no master, no robot, or a robot of another
    version.
    Example::

        with coglab.connect() as robot:
            print(robot.receive("mug"))
    """
    _use_master(master)
    prefix = "/" + namespace.strip("/") + "/" if namespace.strip("/") else "/"
    services = _services()
    arm = prefix + "lwr/command"
    if arm not in services:
        other = sorted(name.removesuffix("lwr/command") for name in services if name.endswith("/lwr/command"))
        there = f"; there are robots in {', '.join(other)}: connect(namespace=...)" if other else ""
        raise NoRobot(
            f"the ROS master {os.environ['ROS_MASTER_URI']} knows no robot in '{prefix}'{there}; to start one: "
            "./coglab launch, or ./coglab launch arm:=ideal"
        )
    _check_version(arm, LwrCommand)
    brain = prefix + "coglab/start"
    if brain in services:
        _check_version(brain, Start)
    _become_node()
    cell = _RunningBackEnd(prefix, brain in services, f"{prefix}ih2_hand/stop" in services)
    try:
        cell.await_news(limit)
    except BaseException:
        cell.close()
        raise
    return Robot(cell, cell.close)


def _use_master(master: str) -> None:
    """Set ROS_MASTER_URI. NoRobot if no master answers there, or if this process is a node of another one."""
    address = f"http://127.0.0.1:{master}" if str(master).isdigit() else str(master)
    address = address or os.environ.get("ROS_MASTER_URI", "http://127.0.0.1:11311")
    parts = urlparse(address)
    try:
        known = parts.scheme == "http" and parts.hostname and parts.port
    except ValueError:
        known = False
    if not known:
        raise ValueError(f"master: 'http://HOST:PORT' or a port is expected, got {master!r}")
    before = os.environ.get("ROS_MASTER_URI", "")
    if rospy.core.is_initialized() and before.rstrip("/") != address.rstrip("/"):
        raise NoRobot(f"this process is a node of {before}, and can be of one ROS master only: start another process")
    if rospy.is_shutdown() and rospy.core.is_initialized():
        raise NoRobot("the ROS node of this process has been shut down; ROS 1 allows only one: start another process")
    try:
        socket.create_connection((str(parts.hostname), int(parts.port or 0)), timeout=ANSWER).close()
    except OSError as error:
        raise NoRobot(
            f"no ROS master answers at {address} ({error.strerror or error}); start a robot: ./coglab launch; if it "
            "runs, use ./coglab shell, or connect('PORT') with the port that ./coglab launch printed"
        ) from None
    os.environ["ROS_MASTER_URI"] = address


def _services() -> list[str]:
    """Names of all services at the master."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(ANSWER)
    try:
        return [name for name, _ in rosgraph.Master("/coglab_python").getSystemState()[2]]
    except (OSError, rosgraph.MasterException) as error:
        raise NoRobot(f"the program at {os.environ['ROS_MASTER_URI']} is no ROS master: {error}") from None
    finally:
        socket.setdefaulttimeout(before)


def _check_version(service: str, kind: Any) -> None:
    """NoRobot if the service has another definition than this program."""
    caller = "/coglab_python"
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(ANSWER)
    try:
        address = rospy.core.parse_rosrpc_uri(rosgraph.Master(caller).lookupService(service))
        with socket.create_connection(address, timeout=ANSWER) as link:
            header = {"probe": "1", "md5sum": kind._md5sum, "callerid": caller, "service": service}
            rosgraph.network.write_ros_handshake_header(link, header)
            link.settimeout(ANSWER)
            answer = rosgraph.network.read_ros_handshake_header(link, io.BytesIO(), 4096)
    except (OSError, rosgraph.MasterException, rosgraph.network.ROSHandshakeException) as error:
        raise NoRobot(f"the node of {service} does not answer ({error}); has it just ended? ./coglab status") from None
    finally:
        socket.setdefaulttimeout(before)
    if answer.get("error") or answer.get("md5sum") not in (None, "*", kind._md5sum):
        raise NoRobot(
            f"the robot has another version than this program: {service} has another definition "
            f"({answer.get('error') or answer.get('md5sum')}); build both from the same sources"
        )


def _become_node() -> None:
    """rospy.init_node for this process, once. The end of the process and Ctrl-C stay Python's own."""
    if rospy.core.is_initialized():
        return
    rospy.init_node("coglab_python", anonymous=True, disable_signals=True, disable_rosout=True)
    atexit.register(rospy.signal_shutdown, "the program ends")
    PACE.follow()


class _RunningBackEnd:
    """The BackEnd of a running robot."""

    frame_delay = 0.15

    def __init__(self, prefix: str, brain: bool, hand: bool) -> None:
        self._prefix = prefix
        self.actions: Mapping[str, str] = ACTIONS if brain else {}
        self.arm = RosArm(f"{prefix}controller_manager", f"{prefix}lwr")
        self.hand = RosHand(f"{prefix}ih2_hand") if hand else None
        self._state = Newest(f"{prefix}coglab/state", MasterStateMessage)
        self._lock = threading.Lock()
        self._results: list[tuple[float, Exchange]] = []
        self._events: deque[Event] = deque(maxlen=KEPT_EVENTS)
        self._note_connection()
        self._submitted = time.monotonic()
        self._result_topic = Newest(f"{prefix}coglab/handover_results", HandoverResult, self._on_result)
        self._topics = [
            self._result_topic,
            Newest(f"{prefix}coglab/transitions", Transition, self._on_transition),
            Newest(f"{prefix}say", Say, self._on_say),
        ]
        self._buffer = tf2_ros.Buffer(debug=False)
        self._listener = TfListener(self._buffer, BASE)
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._frames: dict[str, Pose] = {}
        self._over = threading.Event()
        self._show = threading.Thread(target=self._show_frames, name="coglab_frames", daemon=True)
        self._show.start()

    def await_news(self, limit: float) -> None:
        """Wait for messages of arm, brain and hand. NoRobot after ``limit`` s."""
        heard: dict[str, Callable[[], bool]] = {
            "joint positions of the arm": lambda: self.arm.joint_positions() is not None,
            "the state of the arm": lambda: self.arm.motion_allowed().code != ReasonCode.NODE_SILENT,
            "the status of the controller manager": lambda: self.arm.standing().code != ReasonCode.NODE_SILENT,
        }
        if self.actions:
            heard["the state of the brain"] = lambda: self._state.message is not None
            heard["the topic coglab/handover_results"] = self._result_topic.is_connected
        if self.hand is not None:
            hand = self.hand
            heard["the status of the hand"] = lambda: hand.state().event != ReasonCode.NODE_SILENT
        end = time.monotonic() + limit
        while missing := [what for what, there in heard.items() if not there()]:
            if time.monotonic() > end:
                raise NoRobot(f"{' and '.join(missing)} did not come within {limit:g} s; see ./coglab status")
            time.sleep(0.02)
        if self.actions:
            time.sleep(LATCHED)  # an old result must not count as a new one

    def close(self) -> None:
        """Unsubscribe from everything. The node stays for other connections."""
        self._over.set()
        self._show.join(1.0)
        for port in (self.arm, self.hand):
            for value in vars(port).values() if port is not None else ():
                if isinstance(value, Newest):
                    value.close()
        for topic in (self._state, *self._topics):
            topic.close()
        if self.hand is not None:
            self.hand.disconnect()
        self._listener.unregister()

    def check(self) -> None:
        if self._over.is_set():
            raise RuntimeError("this robot was closed: call coglab.connect() again")
        if rospy.is_shutdown():
            raise RuntimeError("the ROS node of this process has been shut down: start another process")

    def now(self) -> float:
        return float(rospy.get_time())

    def clock(self) -> float:
        return PACE.now()

    def pause(self, seconds: float) -> None:
        self.check()
        time.sleep(max(0.001, seconds))

    def state(self) -> MasterState:
        message = self._state.message
        if message is None:
            return MasterState()
        if self._state.age() > 5.0:
            why = "the brain has been silent for 5 s: does it run? ./coglab status"
            return MasterState(message.state, False, (), message.object_id, why, ReasonCode.NODE_SILENT)
        return MasterState(
            message.state,
            message.in_hub,
            tuple(message.actions),
            message.object_id,
            message.why,
            message.reason_code,
            message.waits_for,
            message.waits_code,
            message.deadline.to_sec(),
        )

    def submit(self, action: str, object_id: str) -> TriggerReply:
        submitted = time.monotonic()
        pending = call(f"{self._prefix}coglab/start", Start, wait=ANSWER, action=action, object_id=object_id)
        end = time.monotonic() + 2 * ANSWER + 2.0
        while not pending.done():
            if time.monotonic() > end:
                pending.cancel()
                return TriggerReply(
                    False, "the brain does not answer: does it run? ./coglab status", ReasonCode.NODE_SILENT
                )
            time.sleep(0.005)
        try:
            answer = pending.result()
        except PortError as error:
            return TriggerReply(False, error.sentence.partition(" refused: ")[2] or error.sentence, error.code)
        self._submitted = submitted
        # The state before the request must not count as the hub after the action.
        end = time.monotonic() + 1.0
        while self.state().in_hub and action in self.state().actions and time.monotonic() < end:
            time.sleep(0.005)
        return TriggerReply(True, answer.message)

    def result(self, action: str) -> Exchange | None:
        with self._lock:
            for arrived, result in reversed(self._results):
                if arrived > self._submitted and ACTIONS.get(result.what, result.what) == action:
                    return result
        return None

    def stop(self, reason: str) -> None:
        if not self.actions:
            self.arm.hold(reason)
            return
        pending = call(f"{self._prefix}coglab/stop", Trigger, wait=1.0)
        end = time.monotonic() + 2 * ANSWER
        while not pending.done() and time.monotonic() < end:
            time.sleep(0.005)
        try:
            pending.result()
        except PortError:
            self.arm.hold(reason)  # the brain is silent: brake at least

    def frame(self, name: str) -> tuple[Pose | None, float]:
        if name == "palm":
            joints, measured = self.arm.measured()
            return (None, 0.0) if joints is None else (Pose(*default_arm().fk(joints)), rospy.get_time() - measured)
        try:
            found = self._buffer.lookup_transform(BASE, name, rospy.Time(0))
        except tf2_ros.TransformException:
            return None, 0.0
        move, turn, stamp = found.transform.translation, found.transform.rotation, found.header.stamp.to_sec()
        age = rospy.get_time() - stamp if stamp > 0.0 else 0.0  # a static frame has no age
        return Pose.from_dict({"xyz": [move.x, move.y, move.z], "quaternion": [turn.x, turn.y, turn.z, turn.w]}), age

    def show_frame(self, name: str, pose: Pose) -> None:
        with self._lock:
            self._frames[name] = pose

    def events(self) -> list[Event]:
        with self._lock:
            events = list(self._events)
            self._events.clear()
        return events

    def _show_frames(self) -> None:
        while not self._over.wait(SHOW_PERIOD) and not rospy.is_shutdown():
            with self._lock:
                frames = dict(self._frames)
            if frames:
                try:
                    self._broadcaster.sendTransform([_transform(name, pose) for name, pose in frames.items()])
                except rospy.ROSException:  # the node ends
                    return

    def _on_transition(self, message: Transition) -> None:
        because = "".join(f" <- {cause}" for cause in message.causes)
        reason = f": {message.reason}" if message.reason else ""
        sentence = f"{message.path}/{message.from_state} -[{message.outcome}]-> {message.to_state}{reason}{because}"
        self._add(
            Event(
                message.header.stamp.to_sec(),
                "transition",
                sentence,
                message.reason_code,
                message.path,
                message.from_state,
                message.outcome,
                message.to_state,
            )
        )

    def _note_connection(self) -> None:
        self._stamps, self._connected = Stamps(), time.monotonic()

    def _is_new(self, stamp: rospy.Time) -> bool:
        """False for a latched message from before the connection. Right also after this computer's clock was set."""
        return self._stamps.steady(stamp) >= self._connected

    def _on_say(self, message: Say) -> None:
        if self._is_new(message.header.stamp):
            self._add(Event(message.header.stamp.to_sec(), "said", message.text, message.code))

    def _on_result(self, message: HandoverResult) -> None:
        result = _exchange(message)
        with self._lock:
            self._results.append((time.monotonic(), result))
            del self._results[:-200]
        if self._is_new(message.ended):
            self._add(Event(result.ended, "result", f"{result.what}: {result.outcome}", result.code))

    def _add(self, event: Event) -> None:
        with self._lock:
            self._events.append(event)


def _exchange(message: HandoverResult) -> Exchange:
    """Result of an action from its message."""
    return Exchange(
        next((name for name, action in ACTIONS.items() if action == message.action), message.action),
        message.success,
        message.reason_code,
        message.reason,
        tuple(message.causes),
        message.started.to_sec(),
        message.ended.to_sec(),
        message.object_id,
        message.outcome,
        {mark.name: mark.stamp.to_sec() for mark in message.marks},
    )


def _transform(name: str, pose: Pose) -> TransformStamped:
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = rospy.Time.now(), BASE, name
    move, turn = message.transform.translation, message.transform.rotation
    move.x, move.y, move.z = map(float, pose.position)
    turn.x, turn.y, turn.z, turn.w = map(float, pose.orientation)
    return message
