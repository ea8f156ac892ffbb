"""Common parts of the rostests of this package: the robot's services, a tf2 goal, and bounded waits."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from xmlrpc.client import ServerProxy

import rospy
import tf2_ros
from coglab_msgs.msg import ControllerStatus, DmpFeedback, FinishedPtp, LwrState, UnfinishedPtp
from coglab_msgs.srv import (
    AddPtp,
    AddPtpRequest,
    CancelMotion,
    CancelMotionResponse,
    ExecuteDmp,
    ExecuteDmpRequest,
    GetActiveController,
    ListControllers,
    LoadController,
    LoadDmps,
    LwrCommand,
    PredictDmp,
    SetSpeedScale,
    SwitchController,
    SwitchDmp,
)
from geometry_msgs.msg import TransformStamped
from lateness import LATE, say_again
from sensor_msgs.msg import JointState

HOME = [-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782]
JOINTS = ["lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"]
SERVICES = {
    "load_controller": LoadController,
    "list_controllers": ListControllers,
    "switch_controller": SwitchController,
    "get_active_controller": GetActiveController,
    "speed_scale": SetSpeedScale,
}
DMP_SERVICES = {
    "load_dmps": LoadDmps,
    "execute_dmp": ExecuteDmp,
    "predict_dmp": PredictDmp,
    "switch_dmp": SwitchDmp,
}

LIMIT = 60.0  # s, for all that is waited for: nothing is red because the computer is busy


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Polls a condition on the steady clock; fails with the description `what`."""
    end = time.monotonic() + LIMIT
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"not within {LIMIT} s: {what}")
        time.sleep(0.01)


def robot_processes() -> list[int]:
    """Process ids of the nodes that move the arm: one, or two with split:=true; none if one has ended."""
    master = rospy.get_master()
    nodes = {node for _, who in master.getSystemState()[2][2] for node in who}
    own = sorted(nodes & {"/robot", "/lwr", "/controller_manager"})
    try:
        return [ServerProxy(master.lookupNode(node)[2]).getPid(rospy.get_name())[2] for node in own]
    except OSError:  # the master still knows a process that has ended
        return []


def runs(pid: int) -> bool:
    """Whether a process has not ended. A zombie process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def end_all(pids: list[int]) -> None:
    """Signals processes to end, as roslaunch does, and waits until they have ended."""
    for pid in pids:
        os.kill(pid, signal.SIGINT)
    wait_until(lambda: not any(runs(pid) for pid in pids), f"end of {pids} after SIGINT")


@contextmanager
def frozen_master() -> Iterator[None]:
    """The ROS master of this test accepts calls and does not answer; rostest runs it in its own process."""
    pid = rospy.get_master().getPid()[2]
    assert any(name in Path(f"/proc/{pid}/cmdline").read_bytes() for name in (b"rosmaster", b"rostest"))
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


class Robot:
    """The robot's interface for users."""

    def __init__(self) -> None:
        self.joints: JointState | None = None
        self.state: LwrState | None = None
        self.status = ControllerStatus()
        self.feedback = DmpFeedback()
        self.feedbacks: list[DmpFeedback] = []
        self.reasons: list[int] = []  # codes of the arm, of the manager and of ended motions
        self.finished: list[int] = []
        self.unfinished: dict[int, UnfinishedPtp] = {}
        rospy.Subscriber("lwr/joint_states", JointState, self._on_joints)
        rospy.Subscriber("lwr/state", LwrState, self._on_state)
        rospy.Subscriber("controller_manager/status", ControllerStatus, self._on_status)
        rospy.Subscriber("controller_manager/dmp/feedback", DmpFeedback, self._on_feedback)
        rospy.Subscriber("controller_manager/ptp/finished_ptp", FinishedPtp, lambda m: self.finished.append(m.ptp_id))
        rospy.Subscriber("controller_manager/ptp/unfinished_ptp", UnfinishedPtp, self._on_unfinished)
        self._goal: tuple[float, float, float] | None = None
        self._quaternion = (0.0, 0.0, 0.0, 1.0)
        self._broadcaster = tf2_ros.TransformBroadcaster()
        threading.Thread(target=self._broadcast, daemon=True).start()

    def _on_joints(self, message: JointState) -> None:
        self.joints = message

    def _on_state(self, message: LwrState) -> None:
        self.state = message
        self.reasons.append(message.reason_code)

    def _on_status(self, message: ControllerStatus) -> None:
        self.status = message
        self.reasons.append(message.reason_code)

    def _on_unfinished(self, message: UnfinishedPtp) -> None:
        self.unfinished[message.ptp_id] = message
        self.reasons.append(message.reason_code)

    def _on_feedback(self, message: DmpFeedback) -> None:
        self.feedback = message
        self.feedbacks.append(message)
        self.reasons.append(message.reason_code)

    def _broadcast(self) -> None:
        while not rospy.is_shutdown():
            if self._goal is not None:
                message = TransformStamped()
                message.header.stamp = rospy.Time.now()
                message.header.frame_id = "lwr_base_link"
                message.child_frame_id = "human_hand"
                t, q = message.transform.translation, message.transform.rotation
                t.x, t.y, t.z = self._goal
                q.x, q.y, q.z, q.w = self._quaternion
                self._broadcaster.sendTransform(message)
            time.sleep(1.0 / 30.0)

    def see_hand(self, position: tuple[float, float, float] | None) -> None:
        """Sets the position at which perception sees the human hand; None: not at all."""
        self._goal = position

    @staticmethod
    def call(name: str, kind: type, *args: object) -> object:
        """Calls a service below the root; waits for it."""
        rospy.wait_for_service(name, LIMIT)
        return rospy.ServiceProxy(name, kind)(*args)

    def manager(self, name: str, *args: object) -> object:
        """A service of the controller manager."""
        return self.call("controller_manager/" + name, SERVICES[name], *args)

    def dmp(self, name: str, *args: object) -> object:
        """A service of the DMP plug-in."""
        return self.call("controller_manager/dmp/" + name, DMP_SERVICES[name], *args)

    def add_ptp(self, position: list[float], velocity: list[float] | None = None) -> object:
        """Adds a point-to-point motion."""
        answer = self.call("controller_manager/ptp/add_ptp", AddPtp, position, velocity or [], [])
        self.reasons.append(answer.reason_code)
        return answer

    def cancel(self, controller: str, reason: str = "") -> CancelMotionResponse:
        """Ends the motion of a controller; returns when the arm stands."""
        return self.call(f"controller_manager/{controller}/cancel", CancelMotion, 0.0, reason)

    def start(self) -> None:
        """Brings the arm into command mode."""
        wait_until(
            lambda: self.state is not None and self.state.supervisor != "disconnected",
            "datagrams of the robot controller",
        )
        if self.state.motion_allowed:
            return

        def allowed() -> bool:  # on a busy machine datagrams may pause for a moment, also after the answer
            if not self.call("lwr/command", LwrCommand, "start").success:
                return False
            end = time.monotonic() + 5.0
            while not self.state.motion_allowed and time.monotonic() < end:
                time.sleep(0.01)
            return self.state.motion_allowed

        wait_until(allowed, "motion allowed")

    def unless_late(self, attempt: Callable[[], None], late: frozenset[int] = LATE) -> None:
        """Runs a part of a test in which the arm moves; again if it fails and a late computer has ended a motion.

        `late`: the ReasonCodes that a late computer explains.
        """
        for left in reversed(range(5)):
            self.start()
            self.reasons.clear()
            try:
                return attempt()
            except AssertionError as error:
                time.sleep(0.5)  # its reason may be on its way
                if not left or not late & set(self.reasons):
                    raise
                say_again(attempt.__name__, error)

    def load(self) -> None:
        """Loads both plug-ins unless they are there."""
        loaded = self.manager("list_controllers").controller_ids
        for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
            if name not in loaded:
                answer = self.manager("load_controller", name, kind)
                assert answer.success, answer.message

    def switch(self, name: str) -> object:
        """Makes a controller the active one."""
        answer = self.manager("switch_controller", name)
        assert answer.success, answer.message
        return answer

    def begin(self, position: list[float]) -> object:
        """Adds a point-to-point motion, again while a late computer is the reason against it; returns the answer."""
        end = time.monotonic() + LIMIT
        answer = self.add_ptp(position)
        while answer.status == AddPtpRequest.REJECTED and time.monotonic() < end:
            assert answer.reason_code in LATE, answer
            self.start()
            time.sleep(0.1)  # with split:=true the manager hears of command mode a little later
            answer = self.add_ptp(position)
        assert answer.status != AddPtpRequest.REJECTED, answer
        return answer

    def go(self, position: list[float]) -> None:
        """Moves to a posture with the point-to-point plug-in and waits for its end; begins again where a late computer
        has ended command mode."""
        self.switch("ptp")
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            motion = self.begin(position).ptp_id
            wait_until(lambda motion=motion: motion in {*self.finished, *self.unfinished}, "its end")
            if motion in self.finished:
                return
            assert self.unfinished[motion].reason_code in LATE, self.unfinished[motion]
            say_again("point-to-point motion", self.unfinished[motion].reason)
        raise AssertionError(f"no motion ended well within {LIMIT} s: {self.unfinished[motion]}")

    def execute(self, primitive: str = "reach_human", **fields: object) -> object:
        """Calls execute_dmp."""
        request = ExecuteDmpRequest(primitive_id=primitive, dmp_ratio=1.0, goal_frame="human_hand")
        for key, value in fields.items():
            setattr(request, key, value)
        answer = self.dmp("execute_dmp", request)
        self.reasons.append(answer.reason_code)
        return answer

    def arm(self) -> list[float]:
        """Measured joints in wire order."""
        by_name = dict(zip(self.joints.name, self.joints.position, strict=False))
        return [by_name[name] for name in JOINTS]
