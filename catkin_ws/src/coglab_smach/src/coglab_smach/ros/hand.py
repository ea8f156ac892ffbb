"""HandPort on the four actions, the calibration topic and the status of ih2_hand."""

from __future__ import annotations

import threading
import time
from typing import Any

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from coglab_msgs.msg import (
    HandCloseAction,
    HandCloseGoal,
    HandOpenAction,
    HandOpenGoal,
    HandPreshapeAction,
    HandPreshapeCloseAction,
    HandPreshapeCloseGoal,
    HandPreshapeGoal,
    HandStatus,
    ReasonCode,
)
from coglab_py.steady import server_is_there, wait_for
from std_msgs.msg import String

from coglab_smach.ports.interfaces import HandState
from coglab_smach.ports.pending import Pending, Polled, PortError
from coglab_smach.ros.calls import Newest

SERVER_WAIT = 10.0  # s, time limit for an action server to appear


class ActionCall(Pending):
    """One goal of an action server. ``isOk`` of the result decides on success; ``message`` is the reason."""

    # Not actionlib.SimpleActionClient: it misses a result that arrives during its send_goal().
    def __init__(self, client: actionlib.ActionClient, name: str, goal: Any) -> None:
        self._client, self._name = client, name
        self._done = threading.Event()
        self._error: PortError | None = None
        self._result: Any = None
        self._lock = threading.Lock()
        self._handle: actionlib.ClientGoalHandle | None = None
        self._cancelled = False
        threading.Thread(target=self._send, args=(goal,), name=f"action:{name}", daemon=True).start()

    def _send(self, goal: Any) -> None:
        if not wait_for(lambda: self._cancelled or server_is_there(self._client), SERVER_WAIT):
            self._fail(
                f"action {self._name} has no server after {SERVER_WAIT:.0f} s; is the hand node running?",
                code=ReasonCode.NODE_SILENT,
            )
            return
        with self._lock:
            if self._cancelled:
                self._fail(f"action {self._name} was cancelled before its goal was sent", code=ReasonCode.CANCELLED)
                return
            self._handle = self._client.send_goal(goal, self._on_transition)

    def _fail(self, sentence: str, causes: tuple[str, ...] = (), code: int = 0) -> None:
        self._error = PortError(sentence, causes, code)
        self._done.set()

    def _on_transition(self, handle: actionlib.ClientGoalHandle) -> None:
        if handle.get_comm_state() != actionlib.CommState.DONE:
            return
        status, result = handle.get_goal_status(), handle.get_result()
        self._result = result
        message = getattr(result, "message", "") or handle.get_goal_status_text()
        if status != GoalStatus.SUCCEEDED or (result is not None and not result.isOk):
            self._fail(
                f"action {self._name} ended {GoalStatus.to_string(status)}",
                (message,) if message else (),
                getattr(result, "reason_code", ReasonCode.NONE),
            )
            return
        self._done.set()

    def done(self) -> bool:
        return self._done.is_set()

    def result(self) -> Any:
        if self._error is not None:
            raise self._error
        return self._result

    def cancel(self) -> None:
        """End the action. An unsent goal is not sent any more."""
        with self._lock:
            self._cancelled = True
            if self._handle is not None and not self._done.is_set():
                self._handle.cancel()


class RosHand:
    """HandPort on ROS."""

    def __init__(self, namespace: str = "ih2_hand") -> None:
        self._ns = namespace
        self._clients = {
            name: actionlib.ActionClient(f"{namespace}/{name}", kind)
            for name, kind in (
                ("hand_open", HandOpenAction),
                ("hand_close", HandCloseAction),
                ("hand_preshape", HandPreshapeAction),
                ("hand_preshape_close", HandPreshapeCloseAction),
            )
        }
        self._status = Newest(f"{namespace}/hand_status", HandStatus)
        self._calibration = rospy.Publisher(f"{namespace}/hand_calibration", String, queue_size=1)

    def disconnect(self) -> None:
        """Disconnect the action clients."""
        for client in self._clients.values():
            client.stop()

    def _call(self, name: str, goal: Any) -> Pending:
        return ActionCall(self._clients[name], f"{self._ns}/{name}", goal)

    def preshape(self, mode: str, level: str) -> Pending:
        return self._call("hand_preshape", HandPreshapeGoal(mode=mode, level=level))

    def close_on_object(self) -> Pending:
        return self._call("hand_preshape_close", HandPreshapeCloseGoal())

    def close(self, speed: int) -> Pending:
        return self._call("hand_close", HandCloseGoal(speed=speed))

    def open(self, speed: int) -> Pending:
        return self._call("hand_open", HandOpenGoal(speed=speed))

    def calibrate(self, mode: str) -> Pending:
        """Publish the order when the hand node is connected. Then follow hand_status: started, ended, or refused."""
        begun: dict[str, Any] = {"sent": 0.0, "seen": False, "asked": time.monotonic(), "error": None}

        def fail(why: str, code: int) -> bool:
            begun["error"] = PortError(f"the hand does not calibrate after the order '{mode}'", (why,), code)
            return True

        def done() -> bool:
            state = self.state()
            if begun["error"] is not None:
                return True
            if not begun["sent"]:
                # At start the hand counts as holding until a poll shows that it is empty. Wait at most 2 s for that.
                settled = not state.holding or time.monotonic() - begun["asked"] > 2.0
                if state.connected and settled and self._calibration.get_num_connections() > 0:
                    self._calibration.publish(String(mode))
                    begun["sent"] = time.monotonic()
                return False
            since = time.monotonic() - begun["sent"]
            if state.calibrating:
                begun["seen"] = True
                return False
            if state.event == ReasonCode.HAND_REFUSED and since > 0.2:
                return fail(state.message, state.event)
            if begun["seen"] or (state.calibrated and since > 0.5):
                return True
            return since > 3.0 and fail(state.message or "hand_status does not report it", ReasonCode.NODE_SILENT)

        def value() -> None:
            if begun["error"] is not None:
                raise begun["error"]
            state = self.state()
            if not state.calibrated:
                raise PortError("the hand's calibration ended without success", (state.message,), state.event)

        return Polled(done, value)

    def state(self) -> HandState:
        message = self._status.message
        if message is None or self._status.age() > 1.0:
            return HandState(message=f"{self._ns}/hand_status is silent", event=ReasonCode.NODE_SILENT)
        return HandState(
            message.connected,
            message.calibrated,
            message.calibrating,
            message.holding,
            message.message,
            tuple(motor.position for motor in message.motors),
            message.event_code,
        )
