"""The emulated hand as a ROS node: connects it to the simulated object, publishes its fingers and its port."""

from __future__ import annotations

import time

import rospy
from coglab_msgs.msg import FingerContact, FingerPositions, MotorCommands, MotorStates
from coglab_py.pace import Pace
from coglab_py.steady import SteadyTimer
from std_msgs.msg import String

from ih2_hand.emulator.physical_motor import MotorState
from ih2_hand.emulator.pty_server import PtyServer

PUBLISH_HZ = 50.0


class CellClock:
    """Clock of the emulated hand. It passes with the simulated cell, which moves the fingers; without a cell it is
    steady."""

    def __init__(self, pace: Pace):
        self._pace = pace

    def monotonic(self) -> float:
        """Time (s) of the cell."""
        return self._pace.now()

    def sleep(self, seconds: float) -> None:
        """Wait for this time (s) of the cell."""
        time.sleep(seconds / self._pace.factor)


class EmulatorNode:
    """Publishes `finger_positions` (50 Hz) and subscribes to `hand_fault` (commands of `emulator.faults`). In the
    cell it subscribes to `motor_states` and answers each with `motor_commands`. Without a cell it subscribes to
    `finger_contact`, which replaces an object. Parameter `hand_port` holds the pty's path. All names are relative."""

    def __init__(self, server: PtyServer):
        self._server = server
        self._positions = rospy.Publisher("finger_positions", FingerPositions, queue_size=5)
        if server.hand.physical:
            self._commands = rospy.Publisher("motor_commands", MotorCommands, queue_size=1)
            rospy.Subscriber("motor_states", MotorStates, self._on_states, queue_size=1, tcp_nodelay=True)
        else:
            rospy.Subscriber("finger_contact", FingerContact, self._on_contact, queue_size=5)
        rospy.Subscriber("hand_fault", String, self._on_fault, queue_size=5)
        self._timer = SteadyTimer(1.0 / PUBLISH_HZ, self._publish, "finger_positions")
        # rospy may shut down without a signal (rosnode kill): then the process ends, too.
        rospy.on_shutdown(server.request_shutdown)

    def stop(self) -> None:
        """Stop publishing. Call it before rospy shuts down."""
        self._timer.shutdown()

    @staticmethod
    def announce(path: str) -> None:
        """Set the parameter with the pty's path; remove it while the hand is unplugged."""
        try:
            if path:
                rospy.set_param("hand_port", path)
            elif rospy.has_param("hand_port"):
                rospy.delete_param("hand_port")
        except Exception as error:  # any error of an absent master; the hand continues
            rospy.logwarn("parameter hand_port not updated, the ROS master does not answer: %s", error)

    def _on_contact(self, contact: FingerContact) -> None:
        try:
            with self._server.lock:
                self._server.hand.advance()
                self._server.hand.set_contacts(contact.contact_position, contact.stiffness)
        except ValueError as error:
            rospy.logwarn_throttle(1.0, "finger_contact refused: %s", error)

    def _on_states(self, message: MotorStates) -> None:
        fields = (message.position, message.current, message.effort, message.moving, message.locked)
        try:
            states = [MotorState(*values) for values in zip(*fields, strict=True)]
            with self._server.lock:
                self._server.hand.follow(states)
                self._server.hand.advance()
                orders = self._server.hand.orders()
        except ValueError as error:
            rospy.logwarn_throttle(1.0, "motor_states refused: %s", error)
            return
        commands = MotorCommands()
        commands.header.stamp = rospy.Time.now()
        commands.speed, commands.target, commands.current = (list(values) for values in zip(*orders, strict=True))
        self._commands.publish(commands)

    def _on_fault(self, command: String) -> None:
        try:
            rospy.loginfo("hand emulator: %s", self._server.fault(command.data))
        except ValueError as error:
            rospy.logwarn("%s", error)

    def _publish(self) -> None:
        message = FingerPositions()
        message.header.stamp = rospy.Time.now()
        with self._server.lock:
            hand = self._server.hand
            hand.advance()
            message.position = [min(254, round(motor.position)) for motor in hand.motors]
            message.current = [min(1023, int(motor.current)) for motor in hand.motors]
            message.effort = [motor.effort for motor in hand.motors]
        self._positions.publish(message)
