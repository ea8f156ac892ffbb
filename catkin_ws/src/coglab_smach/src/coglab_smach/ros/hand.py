"""HandPort on the four actions, the calibration topic and the status of ih2_hand."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
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
from coglab_smach.ports.pending import Pending, PortError
from coglab_smach.ros.calls import Newest

SERVER_WAIT = 10.0  # s, time limit for an action server to appear
SILENT_AGAIN = 1.0  # s that a hand node found silent during a calibration has to speak again


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
        if server_is_there(client):  # at once, so that orders reach the hand in their order
            self._send(goal)
        else:
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


class Calibration(Pending):
    """One order to calibrate, followed in the states of the hand. ``orders``: its publisher.

    A caller that comes late, on a busy computer, finds an old status. So a silent node has SILENT_AGAIN to speak."""

    def __init__(self, mode: str, orders: rospy.Publisher, state: Callable[[], HandState]) -> None:
        self._mode, self._orders, self._state = mode, orders, state
        self._asked = time.monotonic()
        self._sent: float | None = None  # s, time of the order
        self._silent: float | None = None  # s, since when the node is silent
        self._begun = self._over = False
        self._error: PortError | None = None

    def done(self) -> bool:
        if not self._over and self._sent is None:
            self._send()
        elif not self._over:
            self._over = self._has_ended(self._state(), time.monotonic())
        return self._over

    def result(self) -> None:
        if self._error is not None:
            raise self._error

    def _send(self) -> None:
        """Send the order if it will arrive. At start the hand counts as holding until a poll shows that it is empty.
        Wait at most 2 s for that."""
        state = self._state()
        settled = not state.holding or time.monotonic() - self._asked > 2.0
        if state.connected and settled and self._orders.get_num_connections() > 0:
            self._orders.publish(String(self._mode))
            self._sent = time.monotonic()

    def _has_ended(self, state: HandState, now: float) -> bool:
        assert self._sent is not None
        since, refused = now - self._sent, f"the hand does not calibrate after the order '{self._mode}'"
        if state.event == ReasonCode.NODE_SILENT:
            self._silent = now if self._silent is None else self._silent
            return now - self._silent > SILENT_AGAIN and self._fail(refused, state.message, state.event)
        self._silent = None
        if state.calibrating:
            self._begun = True
            return False
        if state.event == ReasonCode.HAND_REFUSED and since > 0.2:
            return self._fail(refused, state.message, state.event)
        if self._begun and not state.calibrated:
            return self._fail("the hand's calibration ended without success", state.message, state.event)
        if self._begun or (state.calibrated and since > 0.5):
            return True
        why = state.message or "hand_status does not report it"
        return since > 3.0 and self._fail(refused, why, ReasonCode.NODE_SILENT)

    def _fail(self, sentence: str, why: str, code: int) -> bool:
        self._error = PortError(sentence, (why,), code)
        return True


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
        return Calibration(mode, self._calibration, self.state)

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
