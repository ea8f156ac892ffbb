"""Keeps the newest message of every topic, and makes from them the state that the page gets at 30 Hz."""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import rospy
from coglab_msgs.msg import (
    Contact,
    ContactSignal,
    ControllerStatus,
    DmpFeedback,
    HandStatus,
    LwrState,
    MasterState,
    PredictedPath,
    ReasonCode,
    Transition,
    UnfinishedPtp,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from ..desk.control_conditions import Standing
from ..desk.motion_guard import STANDSTILL, Standstills
from ..desk.words import outcome, phase, plain, supervisor, transition
from ..scene import path_ahead
from ..scene.urdf_model import RobotModel
from .recordings import LiveStudy
from .tables import Tables

PALM = "ih2_palm"
FRAME_PARENTS = ("world", "lwr_base_link")
OLD = 1.0  # s without a message, after which the path or progress of a motion is over
GOAL_FRAME = "dmp_goal"
ASKED_FOR = (ReasonCode.CANCELLED, ReasonCode.SWITCHED, ReasonCode.SUPERSEDED)
"""Reason codes of motions that the brain or a person has ended. They are no failures."""
MOST_POSES = 200  # of one path
MOST_STATIC = 1000  # frames of /tf_static that are kept, because their object may be selected later
SILENT = 0.75  # s; each source sends at 4 Hz or more, and the page shows the silence within another 0.2 s
ALL_DRIVES = 0x7F  # one bit a joint; further bits of LwrState.power mean something else
LONGEST_NAME = 256  # bytes of a frame's name
# ROS 1 serialisation: little-endian; strings and arrays begin with their length as uint32.
_U32 = struct.Struct("<I")
_STAMP = struct.Struct("<III")
_POSE = struct.Struct("<7d")


def _round(values: Any, digits: int = 4) -> list[float]:
    return [round(value, digits) if math.isfinite(value) else 0.0 for value in values]


class BadBytes(ValueError):
    """These bytes are no tf message."""


def _name(data: bytes, at: int) -> tuple[str, int]:
    (size,) = _U32.unpack_from(data, at)
    if size > LONGEST_NAME:
        raise BadBytes(f"a name of {size} bytes")
    return data[at + 4 : at + 4 + size].decode("utf-8", "replace"), at + 4 + size


def transforms(data: bytes) -> Iterator[tuple[str, str, float, tuple[float, ...]]]:
    """Frames of a tf2_msgs/TFMessage: parent, child, stamp (s), pose (x, y, z, qx, qy, qz, qw). Raises BadBytes.

    Reading the bytes takes a tenth of the time of a whole decoding, and these messages come often."""
    try:
        (count,) = _U32.unpack_from(data, 0)
        at = 4
        for _ in range(count):
            _, seconds, nanoseconds = _STAMP.unpack_from(data, at)
            parent, at = _name(data, at + 12)
            child, at = _name(data, at)
            yield parent, child, seconds + nanoseconds * 1e-9, _POSE.unpack_from(data, at)
            at += 56
    except struct.error as error:
        raise BadBytes(str(error)) from error


class Sources:
    """Time of the last message of each source. Called from any thread; `now` in s of the steady clock."""

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._heard: dict[str, float] = {}

    def heard(self, name: str) -> None:
        """Registers a message of this source."""
        self._heard[name] = self._now()

    def speaks(self, name: str) -> bool:
        """True if its last message is younger than SILENT."""
        return self._now() - self._heard.get(name, float("-inf")) < SILENT

    def silent(self) -> dict[str, float]:
        """Silence in s of each source that sent something before and is silent now."""
        now = self._now()
        return {name: round(now - at, 1) for name, at in list(self._heard.items()) if now - at >= SILENT}


class RosView:
    """The callbacks of the topics write; any thread may read, because each value is replaced as a whole.

    `say(source, text, level, phase)` adds an event, `put(name, value)` sets a document, `transition` passes a
    transition to the graphs, and `result` passes a result to the desk."""

    def __init__(
        self,
        model: RobotModel | None,
        frames: dict[str, str],
        say: Callable[..., None],
        put: Callable[[str, Any], None],
        transition: Callable[..., None],
        result: Callable[[dict], None],
    ) -> None:
        self.model = model
        self._say, self._put, self._transition, self._result = say, put, transition, result
        self.hand_frame, self._board_frame = frames["human_hand"], frames["board"]
        self.frames: dict[str, tuple[float, ...]] = {}
        self._stamps: dict[str, float] = {}
        self.joints: dict[str, float] = {}
        self._joints_at = self._joints_stamp = 0.0
        self._palm_before: tuple[float, Any] | None = None
        self.palm_speed = 0.0
        self.machine, self.arm, self.hand = MasterState(), LwrState(), HandStatus()
        self.manager, self.dmp = ControllerStatus(), DmpFeedback()
        self._state_since = time.monotonic()
        self._standstills = Standstills()
        self.sources = Sources()
        self.contact_stamp = 0.0
        self.hand_number = 0
        """Count of the hand's messages."""
        self.signal, self.contact, self.latency = ContactSignal(), "", math.nan
        self._dmp_at = self._latency_at = self._path_at = 0.0
        self._path_of = ""  # the controller whose motion is under way
        self.tables = Tables(put)
        self.entry: Callable[[], dict] = dict
        self.config: Callable[[], dict] = dict
        self.objects: Callable[[], tuple[str, ...] | None] = lambda: None
        """Identifiers of the objects in the database; None if there is no database."""
        self.files_changed: Callable[[], None] = lambda: None
        self.study = LiveStudy()
        self.preview = ""
        """Primitive whose path is shown instead of the next motion's; empty: none."""
        self.named = frozenset({self.hand_frame, self._board_frame, GOAL_FRAME})
        """Frames that the picture may show. Knowledge adds those of the objects."""
        self._moving = frozenset(model.moving()) if model else None
        self._subscribers: dict[str, rospy.Subscriber] = {}

    def listen(self) -> None:
        """Subscribes to the topics. Latched messages arrive at once, so call this when all callbacks are set."""
        for topic, kind, callback, queue in (
            ("coglab/state", MasterState, self._on_machine, 20),
            ("coglab/transitions", Transition, self._on_transition, 200),
            ("coglab/results", String, self._on_result, 20),
            ("coglab/contact", Contact, self._on_contact, 20),
            ("contact_detector/signal", ContactSignal, self._on_signal, 1),
            ("lwr/state", LwrState, self._on_arm, 20),
            ("lwr/fri_latency", Float64, self._on_latency, 1),
            ("joint_states", JointState, self._on_joints, 2),
            ("ih2_hand/hand_status", HandStatus, self._on_hand, 5),
            ("controller_manager/status", ControllerStatus, self._on_manager, 20),
            ("controller_manager/dmp/feedback", DmpFeedback, self._on_dmp, 5),
            ("controller_manager/ptp/unfinished_ptp", UnfinishedPtp, self._on_unfinished, 10),
            ("/tf", rospy.AnyMsg, self._on_tf, 50),
            ("/tf_static", rospy.AnyMsg, lambda message: self._on_tf(message, static=True), 50),
        ):
            self._subscribers[topic] = rospy.Subscriber(topic, kind, callback, queue_size=queue, tcp_nodelay=True)
        for name in ("dmp", "ptp"):
            topic = f"controller_manager/{name}/predicted_path"
            self._subscribers[topic] = rospy.Subscriber(topic, PredictedPath, self._on_path, name, queue_size=5)

    def there(self, topic: str) -> bool:
        """True if a node publishes this topic."""
        return self._subscribers[topic].get_num_connections() > 0

    def phase(self) -> str:
        """The phase in words."""
        return phase(self.machine.state) if self.machine.state else ""

    # --- read -------------------------------------------------------------------------------------------------

    def standing(self) -> Standing:
        """State of the robot for the desk."""
        machine, arm, hand = self.machine, self.arm, self.hand
        return Standing(
            master_there=self.there("coglab/state"),
            master_alive=self.there("coglab/state") and self.sources.speaks("brain"),
            state=machine.state,
            in_hub=machine.in_hub,
            actions=tuple(machine.actions),
            object_id=machine.object_id,
            study=self.study.name,
            arm_alive=self.there("lwr/state") and self.sources.speaks("arm"),
            motion_allowed=arm.motion_allowed,
            arm_reason=plain(arm.reason),
            hand_alive=self.there("ih2_hand/hand_status") and self.sources.speaks("hand"),
            hand_connected=hand.connected,
            calibrating=hand.calibrating,
            calibrated=hand.calibrated,
            holding=hand.holding,
            manager_alive=self.there("controller_manager/status") and self.sources.speaks("controllers"),
            detector_alive=self.sources.speaks("contact"),
            database_alive=self.objects() is not None,
            objects=self.objects() or (),
        )

    def stopped(self) -> tuple[bool, str, int]:
        """True if the robot stands after a stop or a fault; the reason; and how often it has come to stand."""
        # A node that is silent for a moment does not end the standstill.
        held = self.there("lwr/state") and self.arm.hold_latched
        stands = self.there("coglab/state") and self.machine.state.rsplit("/", 1)[-1] in STANDSTILL
        return stands or held, plain(self.machine.why or self.arm.reason), self._standstills.count

    def palm(self) -> Any:
        """Position of the palm in the world, m; None if it is not known."""
        if self.model is None or not self.joints:
            return None
        return self.model.place(PALM, self.joints)[:3, 3]

    def path_runs(self) -> bool:
        """True if the page shows the path of a running motion."""
        return bool(self._path_of) and time.monotonic() - self._path_at < OLD

    def shown(self, kind: str, path: PredictedPath) -> dict | None:
        """Document of a path; None if it has no poses, or if the robot has no such frame."""
        if self.model is None or not path.poses or len(path.poses) != len(path.times) or len(path.poses) > MOST_POSES:
            return None
        frame = path.header.frame_id
        known = frame == self.model.root or frame in self.model.shapes
        return path_ahead.document(kind, path, self.model.place(frame, self.joints)) if known else None

    def frame(self) -> dict:
        """The state that the page gets 30 times a second."""
        now = time.monotonic()
        self._measure_palm(now)
        object_frame = str(self.entry().get("frame", ""))
        wanted = {"hand": self.hand_frame, "object": object_frame, "board": self._board_frame, "goal": GOAL_FRAME}
        stamp = rospy.get_time()
        shown = {role: _round(self.frames[name], 4) for role, name in wanted.items() if name in self.frames}
        ages = {role: round(stamp - self._stamps[name], 3) for role, name in wanted.items() if name in self._stamps}
        order = self.model.moving() if self.model else []
        dmp = self.dmp if now - self._dmp_at < OLD else DmpFeedback()
        signal = self.signal if self.sources.speaks("contact") else None
        arm = self.sources.speaks("arm")
        latency = self.latency if now - self._latency_at < SILENT else self.tables.latency
        answer = self.tables.answer_time
        deadline = self.machine.deadline.to_sec()
        return {
            "stamp": round(stamp, 3),
            "q": _round(self.joints.get(name, 0.0) for name in order),
            "live": arm and now - self._joints_at < SILENT,
            "silent": self.sources.silent(),
            "frames": shown,
            "ages": ages,
            "rate": _round(signal.change) if signal else [],
            "threshold": _round(signal.threshold) if signal else [],
            "watched": list(signal.watched) if signal else [],
            "speed": round(self.palm_speed, 4) if arm else None,
            "fri": round(1000 * latency, 3) if arm and math.isfinite(latency) else None,
            "answer": round(1000 * answer, 3) if arm and math.isfinite(answer) else None,
            "current": [motor.current for motor in self.hand.motors] if self.sources.speaks("hand") else [],
            "margin": round(signal.margin, 3) if signal and signal.state == "watching" else None,
            "phase": self.machine.state,
            "words": phase(self.machine.state),
            "waits": plain(self.machine.waits_for),
            "since": round(now - self._state_since, 2),
            "left": round(max(0.0, deadline - stamp), 2) if deadline else None,
            "dmp": [dmp.state, round(dmp.phase, 4), round(dmp.remaining_distance, 4), round(dmp.remaining_time, 3)],
        }

    def status(self) -> dict:
        """The document `status` of the page: the values that change seldom."""
        now, machine, arm, hand = self.standing(), self.machine, self.arm, self.hand
        return {
            "machine": {
                "alive": self.there("coglab/state"),
                "state": machine.state,
                "words": phase(machine.state),
                "hub": machine.in_hub,
                "actions": list(machine.actions),
                "object": machine.object_id,
                "why": plain(machine.why),
                "fallback": str(self.config().get("default_object", "")),
            },
            "arm": {
                "alive": self.there("lwr/state"),
                "supervisor": arm.supervisor,
                "words": supervisor(arm.supervisor),
                "fri": arm.fri_state,
                "quality": arm.quality,
                "mode": arm.control_mode,
                "power": arm.power & ALL_DRIVES == ALL_DRIVES,
                "allowed": arm.motion_allowed,
                "held": arm.hold_latched,
                "reason": plain(arm.reason),
                "cycle": arm.cycle_time,
            },
            "hand": {
                "alive": self.there("ih2_hand/hand_status"),
                "connected": hand.connected,
                "calibrated": hand.calibrated,
                "calibrating": hand.calibrating,
                "holding": hand.holding,
                "message": hand.message,
                "motors": len(hand.motors),
            },
            "manager": {
                "alive": self.there("controller_manager/status"),
                "state": self.manager.state,
                "active": self.manager.active_controller,
                "reason": plain(self.manager.reason),
                "scale": round(self.manager.speed_scale, 3),
            },
            "contact": {
                "words": self.contact,
                "stamp": round(self.contact_stamp, 1),
                "alive": now.detector_alive,
                "state": self.signal.state,
                "mode": self.signal.mode,
                "learnt": self.signal.learnt,
                "samples": self.signal.rest_samples,
                "k": round(self.signal.k, 3),
                "window": round(self.signal.window, 4),
            },
        }

    # --- arm and hand -----------------------------------------------------------------------------------------

    def _measure_palm(self, now: float) -> None:
        if self.palm_at() == (self._palm_before or (0.0,))[0]:
            if now - self._joints_at > OLD:
                self.palm_speed = 0.0
            return
        palm, before = self.palm(), self._palm_before
        self._palm_before = (self.palm_at(), palm)
        if palm is not None and before is not None and before[1] is not None:
            dt = self.palm_at() - before[0]
            if 0.0 < dt < OLD:
                self.palm_speed = math.dist(palm, before[1]) / dt

    def palm_at(self) -> float:
        """Stamp of the joint state, s."""
        return self._joints_stamp

    def _on_joints(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            return
        pairs = zip(message.name, message.position, strict=True)
        ours = {name: value for name, value in pairs if self._moving is None or name in self._moving}
        if not ours or not all(map(math.isfinite, ours.values())):
            return
        self.joints = {**self.joints, **ours} if self._moving else {}
        self._joints_stamp, self._joints_at = message.header.stamp.to_sec(), time.monotonic()

    def _on_signal(self, message: ContactSignal) -> None:
        self.signal = message
        self.sources.heard("contact")

    def _on_latency(self, message: Float64) -> None:
        self.latency, self._latency_at = message.data, time.monotonic()

    def _on_tf(self, message: rospy.AnyMsg, static: bool = False) -> None:
        try:
            for parent, child, stamp, pose in transforms(message._buff):
                kept = child in self.named or (static and len(self.frames) < MOST_STATIC)
                if kept and parent in FRAME_PARENTS and all(map(math.isfinite, pose)) and any(pose[3:]):
                    self.frames[child] = pose
                    self._stamps[child] = stamp
        except BadBytes:
            return

    def _on_arm(self, message: LwrState) -> None:
        before, self.arm = self.arm, message
        self.sources.heard("arm")
        self._standstills.arm(message.hold_latched)
        if (message.supervisor, message.quality) != (before.supervisor, before.quality):
            bad = message.supervisor in ("stopped", "disconnected")
            words = f"{supervisor(message.supervisor)}, quality {message.quality}"
            text = f"{words}: {plain(message.reason)}" if message.reason else words
            self._say("arm", text, "fault" if bad else "info")

    def _on_hand(self, message: HandStatus) -> None:
        before, self.hand = self.hand, message
        self.hand_number += 1
        self.sources.heard("hand")
        if message.message and message.message != before.message:
            self._say("hand", message.message, "info" if message.connected else "fault")

    # --- brain ------------------------------------------------------------------------------------------------

    def _on_machine(self, message: MasterState) -> None:
        self.sources.heard("brain")
        if (message.state, message.waits_for) != (self.machine.state, self.machine.waits_for):
            self._state_since = time.monotonic()
        self.machine = message
        self._standstills.machine(message.state)

    def _on_transition(self, message: Transition) -> None:
        level = {"failed": "warning", "stopped": "fault", "fault": "fault"}.get(message.outcome, "info")
        causes = "".join(f", because {cause}" for cause in message.causes[:4])
        reason = plain(message.reason + causes)
        words = transition(message.path, message.from_state, message.outcome, message.to_state, reason)
        self._say("machine", words, level, phase(f"{message.path}/{message.from_state}"))
        self._transition(message.path, message.from_state, message.outcome, message.to_state, reason)

    def _on_result(self, message: String) -> None:
        try:
            row = json.loads(message.data)
            what = f"{outcome(row['kind'])} {row['object_id']}".strip()
            words = f"{what}: {row['outcome']} after {float(row['duration_s']):.1f} s"
        except (ValueError, KeyError, TypeError):
            return
        self._say("result", words, "info" if row["outcome"] == "succeeded" else "warning")
        self._result(row)

    def _on_contact(self, message: Contact) -> None:
        self.contact_stamp = rospy.get_time()
        self.contact = (
            f"{'contact' if message.contact else 'released'} by {message.source}, margin {message.margin:.1f}"
        )
        self._say("contact", f"{self.contact}: {message.message}", "info")

    # --- controllers ------------------------------------------------------------------------------------------

    def _on_manager(self, message: ControllerStatus) -> None:
        before, self.manager = self.manager, message
        self.sources.heard("controllers")
        if message.state == "fault" and before.state != "fault":
            self._say("controller", f"fault: {message.reason}", "fault")

    def _on_dmp(self, message: DmpFeedback) -> None:
        before, self.dmp, self._dmp_at = self.dmp, message, time.monotonic()
        if message.state == "aborted" and before.state != "aborted":
            self._ended("reach", message)

    def _on_path(self, message: PredictedPath, controller: str) -> None:
        if message.poses:
            self._path_of, self._path_at = controller, time.monotonic()
            self._put("path", self.shown("running", message))
        elif controller == self._path_of:
            self._path_of = ""
            self._put("path", None)

    def _on_unfinished(self, message: UnfinishedPtp) -> None:
        self._ended(f"motion {message.ptp_id}", message)

    def _ended(self, what: str, message: DmpFeedback | UnfinishedPtp) -> None:
        """Adds an event about a motion that ended before its goal."""
        level = "info" if message.reason_code in ASKED_FOR else "warning"
        self._say("controller", f"{what} ended before its goal: {message.reason}", level)
