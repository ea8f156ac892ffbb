"""A client of the hand node: goals, status and faults in a few words, for tests and scripts."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any

import rospy
from actionlib.simple_action_client import SimpleGoalState
from coglab_msgs.msg import (
    FingerContact,
    FingerPositions,
    HandCloseAction,
    HandCloseGoal,
    HandOpenAction,
    HandOpenGoal,
    HandPreshapeAction,
    HandPreshapeCloseAction,
    HandPreshapeCloseGoal,
    HandPreshapeGoal,
    HandStatus,
)
from coglab_py.action_client import ActionClient
from coglab_py.steady import server_is_there
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

ACTIONS = {
    "hand_open": (HandOpenAction, HandOpenGoal),
    "hand_close": (HandCloseAction, HandCloseGoal),
    "hand_preshape": (HandPreshapeAction, HandPreshapeGoal),
    "hand_preshape_close": (HandPreshapeCloseAction, HandPreshapeCloseGoal),
}
"""Action and goal type by action name."""


class HandClient:
    """Talks to one hand node (`hand`) and, in simulation, to its emulator (`cell`); the names are
    relative to the caller's namespace. Every wait has a time limit and raises TimeoutError."""

    def __init__(self, hand: str = "ih2_hand", cell: str = "coglab_sim", limit: float = 60.0):
        self.limit = limit
        self.status = HandStatus()
        self.statuses: list[HandStatus] = []
        """Every status received."""
        self.feedback: list[Any] = []
        """Feedback of the last goal."""
        self.fingers = FingerPositions()
        self.joints = JointState()
        rospy.Subscriber(f"{hand}/hand_status", HandStatus, self._on_status)
        rospy.Subscriber(f"{hand}/joint_states", JointState, self._on_joints)
        rospy.Subscriber(f"{cell}/finger_positions", FingerPositions, self._on_fingers)
        self._calibration = rospy.Publisher(f"{hand}/hand_calibration", String, queue_size=5)
        self._fault = rospy.Publisher(f"{cell}/hand_fault", String, queue_size=5)
        self._contact = rospy.Publisher(f"{cell}/finger_contact", FingerContact, queue_size=5)
        self.stop_service = rospy.ServiceProxy(f"{hand}/stop", Trigger)
        self.clients = {name: ActionClient(f"{hand}/{name}", types[0]) for name, types in ACTIONS.items()}

    def _on_status(self, status: HandStatus) -> None:
        self.status = status
        self.statuses.append(status)

    def _on_joints(self, joints: JointState) -> None:
        self.joints = joints

    def _on_fingers(self, fingers: FingerPositions) -> None:
        self.fingers = fingers

    def wait(self, what: Callable[[], Any], text: str, limit: float | None = None) -> None:
        """Until `what()` is true."""
        end = time.monotonic() + (limit or self.limit)
        while not what():
            if time.monotonic() > end:
                raise TimeoutError(f"{text}: not within {limit or self.limit} s; last status: {self.status.message}")
            time.sleep(0.01)

    def wait_ready(self) -> None:
        """Until the node is connected and its actions are there."""
        for name, client in self.clients.items():
            self.wait(functools.partial(server_is_there, client), f"action server {name}")
        self.wait(lambda: self.status.connected, "hand connected")

    def send(self, name: str, *arguments: Any) -> Any:
        """Send a goal; the action client."""
        self.feedback = []
        self.clients[name].send_goal(ACTIONS[name][1](*arguments), feedback_cb=lambda item: self.feedback.append(item))
        return self.clients[name]

    def result(self, name: str) -> Any:
        """Result of the goal sent last."""
        client = self.clients[name]
        self.wait(lambda: client.simple_state == SimpleGoalState.DONE, f"result of {name}")
        return client.get_result()

    def run(self, name: str, *arguments: Any) -> Any:
        """Send a goal and wait for its result."""
        self.send(name, *arguments)
        return self.result(name)

    def fresh_status(self) -> HandStatus:
        """A status whose poll began after this call; not by stamps, as the clock may step."""
        count = len(self.statuses)
        self.wait(lambda: len(self.statuses) >= count + 5, "fresh hand_status")
        return self.status

    def _publish(self, publisher: rospy.Publisher, message: Any) -> None:
        self.wait(publisher.get_num_connections, f"subscriber of {publisher.name}")
        publisher.publish(message)

    def calibrate(self, words: str) -> None:
        """Ask for a calibration; returns at once."""
        self._publish(self._calibration, String(words))

    def calibrate_and_wait(self, words: str) -> None:
        """Calibrate and wait for the end."""
        count = len(self.statuses)
        self.calibrate(words)
        self.wait(lambda: any(status.calibrating for status in self.statuses[count:]), "start")
        self.wait(lambda: not self.status.calibrating, "end of the calibration")

    def fault(self, command: str) -> None:
        """Give the emulator a fault command."""
        self._publish(self._fault, String(command))

    def touch(self, positions: list[int], stiffness: float = 20.0) -> None:
        """Put an object between the fingers: contact position of each motor, 255 is free."""
        message = FingerContact(contact_position=positions, stiffness=[stiffness] * 5)
        message.header.stamp = rospy.Time.now()
        self._publish(self._contact, message)
        time.sleep(0.1)
