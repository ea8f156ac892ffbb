"""What the node's rostest is made of: bounded waits, ports, and publishers of target velocities."""

from __future__ import annotations

import subprocess
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState

LIMIT = 60.0  # s, for everything that is waited for


def wait_for(condition, what: str, limit: float = LIMIT):
    end = time.monotonic() + limit
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"not within {limit} s: {what}")


def bound_port(name: str) -> int:
    return wait_for(lambda: rospy.get_param(f"{name}/fri_port_bound", 0), f"{name}/fri_port_bound")


def node_binary() -> str:
    return subprocess.check_output(
        ["catkin_find", "--first-only", "--libexec", "lwr_fri_bridge", "lwr_node"], text=True
    ).strip()


def target_message(velocity: list[float], age: float = 0.0, epoch: str = "", **fields) -> JointState:
    """Target velocities made `age` s ago, in the motion_epoch if one is given."""
    message = JointState(velocity=velocity, **fields)
    message.header.stamp = rospy.Time.now() - rospy.Duration(age)
    message.header.frame_id = epoch
    return message


def refusals(reason: str) -> int:
    """How often target velocities of /lwr were refused so far for that reason, as /diagnostics counts them."""

    def commands():
        message = rospy.wait_for_message("/diagnostics", DiagnosticArray, LIMIT)
        return next((s for s in message.status if s.name.endswith("lwr: commands")), None)

    values = wait_for(commands, "diagnostics of the commands").values
    return next(int(v.value) for v in values if v.key.startswith(f"refused: {reason}"))


class Diagnostics:
    """Every status of /diagnostics with one name, such as "lwr: arm", from now on."""

    def __init__(self, name: str) -> None:
        self.told: list[DiagnosticStatus] = []
        self._name = name
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._take)

    def _take(self, message: DiagnosticArray) -> None:
        self.told += [status for status in message.status if status.name.split("/")[-1] == self._name]

    def next(self, condition, what: str) -> DiagnosticStatus:
        """The first one from now on that meets the condition."""
        known = len(self.told)
        return wait_for(lambda: next((s for s in self.told[known:] if condition(s)), None), what)

    def close(self) -> None:
        self._subscriber.unregister()


class Twist:
    """Publishes a target velocity at 50 Hz, made when it is sent, until stopped."""

    def __init__(self, publisher: rospy.Publisher, velocity: list[float]) -> None:
        self.longest_pause = 0.0
        """s between two messages; a crowded computer makes it longer than 0.02"""
        self._sent = time.monotonic()
        self._publisher, self._velocity = publisher, velocity
        self.timer = rospy.Timer(rospy.Duration(0.02), self._send)

    def _send(self, _: object) -> None:
        now = time.monotonic()
        self.longest_pause = max(self.longest_pause, now - self._sent)
        self._sent = now
        self._publisher.publish(target_message(self._velocity))

    def stop(self) -> None:
        self.timer.shutdown()
