"""The hand node, D4.10 Table 3: polls the hand, publishes its status, and serves its actions."""

from __future__ import annotations

import copy
import threading
import time
from typing import Any

import rospy
from coglab_msgs.msg import HandStatus
from coglab_py import parameters, steady
from coglab_py.pace import Pace
from coglab_py.steady import ending
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from ih2_hand import grasps
from ih2_hand.driver import (
    DIALECTS,
    LARGEST_READ_TIMEOUT_S,
    LEAST_READ_TIMEOUT_S,
    HandSerialDriver,
)
from ih2_hand.errors import (
    HandCalibratingError,
    HandConnectionLost,
    HandError,
    HandInconsistentError,
    HandPortError,
    HandTimeoutError,
)
from ih2_hand.memory import HandMemory
from ih2_hand.progress import LONGEST_S, MotorVerdict, Task
from ih2_hand.reasons import NEUTRAL, Reason, reason_of
from ih2_hand.ros.diagnostics import Diagnostics
from ih2_hand.ros.goals import GoalQueue
from ih2_hand.ros.messages import joint_state, motor_status
from ih2_hand.trace import Tracer
from ih2_hand.wire_choices import WIRE

ONLY_DEVICE = "(the only serial device)"
"""Name of the port in messages while no port is set and none was found."""

RECONNECT_S = 0.5  # s between attempts to open the port
SHORTEST_GOAL_S = 0.001  # s, lower bound of the parameter goal_time_limit
CONTRADICTIONS = 3  # consecutive polls with contradicting readings after which the connection counts as lost
STOP_CHECKS = 5  # times that the stop service checks whether the motors stand


class TracePublisher:
    """Publishes every serial frame on `~trace`, as `trace.Tracer` writes it, while the topic has a subscriber."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~trace", String, queue_size=1000)
        self._lock = threading.Lock()
        self._tracer: Tracer | None = None

    def hook(self, direction: str, data: bytes) -> None:
        """Callback for `HandSerialDriver(trace=...)`."""
        if not self._publisher.get_num_connections():
            self._tracer = None
            return
        with self._lock:
            tracer = self._tracer or Tracer()
            self._tracer = tracer
            for line in tracer.feed(direction, data, time.time()):
                self._publisher.publish(String(line))


class HandNode(HandMemory):
    """Owns the driver. One thread polls, one executes the goals, one runs a requested calibration.

    Private parameters: `serial_port` (device, pty, socket:// URL, `param:NAME` for the value of
    another parameter, or empty for the only serial device), `rate` (Hz, 30), `dialect` (legacy),
    `read_timeout` (s, 0.05: longest wait for an answer), `use_tension` (false: the motor current
    limits the grip), `goal_time_limit` (s, 10), `grasps_file` (empty: the package's grasps.yaml).
    """

    def __init__(self) -> None:
        self._port_setting = parameters.read("~serial_port", str, "")
        self.rate = parameters.read("~rate", float, 30.0, 1.0, 200.0)
        self._dialect = parameters.read("~dialect", str, "legacy", among=DIALECTS)
        self._read_timeout = parameters.read(
            "~read_timeout", float, WIRE.read_timeout_s, LEAST_READ_TIMEOUT_S, LARGEST_READ_TIMEOUT_S
        )
        super().__init__(
            is_current=not parameters.read("~use_tension", bool, False),
            limit=parameters.read("~goal_time_limit", float, 10.0, SHORTEST_GOAL_S, LONGEST_S),
        )
        self._preshapes = grasps.load_preshapes(parameters.read("~grasps_file", str, "") or None)
        self.driver: HandSerialDriver | None = None
        self.port = self._port_setting or ONLY_DEVICE
        self._event = (Reason.HAND_LINK_LOST, "not connected yet")
        self._last_status = HandStatus()
        self._last_begun = 0.0
        """Time at which the last poll began (monotonic, s)."""
        self._contradictions = 0
        self._lost_lock = threading.Lock()
        self._ended = threading.Event()
        self._publisher = rospy.Publisher("~hand_status", HandStatus, queue_size=5, tcp_nodelay=True)
        self._joints = rospy.Publisher("~joint_states", JointState, queue_size=5)
        self._diagnostics = Diagnostics(self)
        self._trace = TracePublisher()
        self.goals = GoalQueue(self, Pace().follow())
        rospy.Service("~stop", Trigger, self._on_stop)
        rospy.Subscriber("~hand_calibration", String, self._on_calibration, queue_size=5)
        self._thread = steady.worker(self._poll, "poll")

    def run(self) -> int:
        """Run until the node is shut down; return the exit status. A running goal is aborted and the
        fingers are stopped. Without a goal no command is sent."""
        # Before rospy closes the topics, so that action clients receive the result.
        rospy.on_shutdown(self.goals.shutdown)
        self._thread.start()
        self.goals.start()
        status = steady.spin()
        self._ended.set()
        self._thread.join(2.0)
        if self.driver:
            self.driver.close()
        return status

    # -- connection ------------------------------------------------------------------------------

    def connected_driver(self) -> HandSerialDriver:
        """The driver. Raises HandConnectionLost with the reason if there is none."""
        driver = self.driver
        if driver is None:
            raise HandConnectionLost(f"the hand is not connected: {self.message}")
        return driver

    @property
    def event_code(self) -> Reason:
        """Reason code of the last event."""
        return self._event[0]

    @property
    def message(self) -> str:
        """Text of the last event."""
        return self._event[1]

    def event(self, text: str, reason: Reason = Reason.NONE) -> None:
        """Report an event: log it, publish it in hand_status at once (so that the next event does not
        replace it unseen), and in the diagnostics."""
        self._event = (reason, text)
        (rospy.loginfo if reason in NEUTRAL else rospy.logwarn)("hand: %s", text)
        self._tell_again()
        self._diagnostics.publish()

    def _tell_again(self) -> None:
        """Publish the last poll again with the current flags and event."""
        self._fill_and_send(copy.copy(self._last_status))

    def _connect(self) -> None:
        try:
            self._open()
        except Exception as error:  # any error of the port: the next attempt follows
            text = (
                str(error)
                if isinstance(error, HandError)
                else (
                    f"the hand's port {self.port} cannot be opened ({type(error).__name__}: {error}): "
                    "check that it is the hand's serial device"
                )
            )
            if text != self.message:
                self.event(text, Reason.HAND_LINK_LOST)

    def _open(self) -> None:
        named = self._resolve_port()
        self.port = named or ONLY_DEVICE
        driver = HandSerialDriver(
            named or None,
            dialect=self._dialect,
            preshapes=self._preshapes,
            trace=self._trace.hook,
            read_timeout=self._read_timeout,
        )
        self.port = driver.port
        self.forget()
        self._contradictions = 0
        self.driver = driver
        self.event(f"connected on {self.port}; the grip counts as holding until shown empty")

    def _resolve_port(self) -> str:
        if not self._port_setting.startswith("param:"):
            return self._port_setting
        name = self._port_setting[len("param:") :]
        try:
            port = parameters.read(name, str, "")
        except parameters.ParameterError as error:
            raise HandPortError(str(error)) from None
        except Exception as error:  # any error of an absent master: the next attempt follows
            raise HandPortError(f"parameter {name} cannot be read ({error}): is the ROS master there?") from error
        if not port:
            raise HandPortError(
                f"parameter {rospy.resolve_name(name)} is not set: start the node that sets it, e.g. hand_emulator"
            )
        return port

    def lost(self, error: Exception, driver: HandSerialDriver | None = None) -> None:
        """Close the lost connection and report it at once; polling reopens the port. No effect if
        `driver` is given and is no longer the current driver."""
        with self._lost_lock:
            if self.driver is None or driver not in (None, self.driver):
                return
            driver, self.driver = self.driver, None
        driver.close()
        self.forget()
        self.event(f"connection lost: {error}", Reason.HAND_LINK_LOST)

    # -- polling ---------------------------------------------------------------------------------

    def _poll(self) -> None:
        period = 1.0 / self.rate
        next_time = next_connect = time.monotonic()
        while not self._ended.is_set() and not rospy.is_shutdown():
            now = time.monotonic()
            try:
                if self.driver is None and now >= next_connect:
                    self._connect()
                    next_connect = time.monotonic() + RECONNECT_S
                self._poll_once()
                self._diagnostics.tick()
            except Exception as error:
                if ending():
                    return
                rospy.logerr("hand: unexpected %s: %s", type(error).__name__, error)
                self.lost(HandError(f"internal error: {error}"))
            # After a late poll the next ones shift: missed polls are not repeated.
            next_time = max(next_time + period, time.monotonic())
            self._ended.wait(next_time - time.monotonic())

    def _poll_once(self) -> None:
        driver, stamp, begun = self.driver, rospy.Time.now(), time.monotonic()
        readings: list[dict[str, Any]] = []
        if driver is not None and not self.calibrating:
            try:
                readings = driver.read_motors()
                self._contradictions = 0
            except HandCalibratingError:
                pass
            except HandInconsistentError as error:
                self._contradictions += 1
                rospy.logwarn_throttle(1.0, "hand: %s", error)
                if self._contradictions >= CONTRADICTIONS:
                    self.lost(error, driver)
                return
            except (HandTimeoutError, HandConnectionLost) as error:
                if not self.calibrating:
                    self.lost(error, driver)
                return
        self._publish(readings, stamp, begun)

    def _publish(self, readings: list[dict[str, Any]], stamp: rospy.Time, begun: float) -> None:
        status = HandStatus(motors=[motor_status(reading) for reading in readings])
        if readings and not self.calibrating:
            if self.look(status.motors):
                self.event("the hand is open: it holds nothing")
            self._joints.publish(joint_state(readings, stamp))
        status.header.stamp = stamp
        self._last_status, self._last_begun = status, begun
        self._fill_and_send(status)

    def _fill_and_send(self, status: HandStatus) -> None:
        # The end of a calibration clears this flag last: a reader that sees False also sees the outcome.
        status.calibrating = self.calibrating
        status.calibrated, status.holding = self.calibrated, self.holding
        status.connected = self.driver is not None
        if status.calibrating or not status.connected:
            status.motors = []  # these readings are from before the calibration or the loss
        status.event_code, status.message = self._event
        self._publisher.publish(status)
        self.goals.polled(status, self._last_begun)

    # -- goals -----------------------------------------------------------------------------------

    def make_task(self, name: str, goal: Any) -> Task:
        """Task for an accepted goal. RefusedError or HandError give the reason to refuse it."""
        return self.task_for(name, goal, self.connected_driver())

    def task_ended(self, task: Task, verdict: MotorVerdict) -> None:
        """Store preshape and grip as shown by the finished task, and publish them."""
        self.task_over(task, verdict)
        self._event = (verdict.reason, f"{task.name}: {verdict.text}")
        self._tell_again()  # before the result, so that the client finds the grip published

    # -- calibration and stop --------------------------------------------------------------------

    def _on_calibration(self, request: String) -> None:
        self.goals.call(lambda: self._calibrate(request.data.split()))

    def _calibrate(self, words: list[str]) -> None:
        """Start a calibration, or report why not. Runs in the goals' thread, so no goal can begin meanwhile."""
        reason = self.why_not_calibrate(words, self.goals.active)
        driver = self.driver
        if reason is None and driver is None:
            reason = f"the hand is not connected: {self.message}"
        if reason:
            self.event(f"calibration refused: {reason}", Reason.HAND_REFUSED)
            return
        self.calibration_began()
        self.event(f"calibration {words[0]} started", Reason.HAND_STARTED)
        threading.Thread(target=self._run_calibration, args=(driver, words[0]), name="calibration", daemon=True).start()

    def _run_calibration(self, driver: HandSerialDriver, kind: str) -> None:
        failure: Exception | None = None
        try:
            driver.calibration(kind)
        except Exception as error:  # any error, so that the hand does not count as calibrating forever
            failure = error
        if failure is None and self.driver is driver:
            self.calibrated = True
            self._event = (Reason.HAND_ENDED, f"calibration {kind} ended")
        else:
            failure = failure or HandConnectionLost("the connection was lost meanwhile")
            self._event = (reason_of(failure), f"calibration {kind} failed: {failure}")
        self.calibrating = False
        self.event(self.message, self.event_code)
        if isinstance(failure, (HandConnectionLost, HandTimeoutError)):
            self.lost(failure, driver)

    def _on_stop(self, _: Any) -> TriggerResponse:
        """Stop every motor. Success is true only if the motors report that they stand."""
        self.goals.stop("stopped by the stop service")
        driver = self.driver
        if driver is None:
            return TriggerResponse(False, f"not connected, nothing sent: {self.message}")
        try:
            driver.stop_all()
            if self.calibrating:
                return TriggerResponse(
                    False,
                    "StopALL sent, but the hand discards everything while it calibrates; cut its power if it must stop",
                )
            for attempt in range(STOP_CHECKS):
                if all(status["mode"] == "stop" for status in driver.get_all_finger_status()):
                    return TriggerResponse(True, "every motor stands")
                if attempt:  # a frame may be incomplete: filling the parser also stops the motors
                    driver.line.resynchronise("stop not taken")
                driver.stop_all()
        except HandError as error:
            return TriggerResponse(False, f"StopALL sent, not confirmed: {error}")
        return TriggerResponse(False, "StopALL sent, but a motor still reports a driven mode: cut the hand's power")
