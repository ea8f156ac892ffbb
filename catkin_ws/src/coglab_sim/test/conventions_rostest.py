#!/usr/bin/python3
"""Every KRL convention over UDP: bridge and cell as nodes, from the start through a motion to monitor mode."""

import sys
import time
import unittest

import rospy
import rostest
from coglab_msgs.msg import LwrState
from coglab_msgs.srv import LwrCommand
from sensor_msgs.msg import JointState
from std_msgs.msg import String

LIMIT = 120.0  # s, for everything that is waited for


class Arm:
    """One of the robots, as its users see it."""

    def __init__(self, namespace: str) -> None:
        self.state: LwrState | None = None
        self.position: list[float] = []
        self.messages: list[str] = []
        rospy.Subscriber(f"/{namespace}/lwr/state", LwrState, lambda m: setattr(self, "state", m))
        rospy.Subscriber(
            f"/{namespace}/lwr/joint_states", JointState, lambda m: setattr(self, "position", list(m.position))
        )
        rospy.Subscriber(f"/{namespace}/coglab_sim/cell/messages", String, lambda m: self.messages.append(m.data))
        self.target = rospy.Publisher(f"/{namespace}/lwr/target_joint_states", JointState, queue_size=1)
        rospy.wait_for_service(f"/{namespace}/lwr/command", LIMIT)
        self.command = rospy.ServiceProxy(f"/{namespace}/lwr/command", LwrCommand)

    def wait(self, condition, what: str) -> None:
        end = time.monotonic() + LIMIT
        while not condition():
            if time.monotonic() > end:
                raise AssertionError(f"not within {LIMIT} s: {what}; state {self.state}, messages {self.messages}")
            time.sleep(0.02)


class Conventions(unittest.TestCase):
    def run_through(self, convention: str, mode: str, speed: float = 0.3, fastest: float = 0.3) -> None:
        arm = Arm(convention)
        arm.wait(
            lambda: arm.position and arm.state and arm.state.fri_state == "MON" and arm.state.power == 0x7F,
            "monitor mode",
        )
        self.command(arm, mode)
        self.command(arm, "start")
        arm.wait(lambda: arm.state.motion_allowed, "motion allowed")
        self.assertEqual(
            arm.state.control_mode,
            {"position": "POSITION", "joint_impedance": "JNT_IMP", "cartesian_impedance": "CART_IMP"}[mode],
        )
        before, begin = list(arm.position), time.monotonic()
        message = JointState(velocity=[speed] + [0.0] * 6)

        def moved() -> bool:
            if not arm.state.motion_allowed:  # a busy computer has ended command mode
                arm.command("start")
            message.header.stamp = rospy.Time.now()
            arm.target.publish(message)
            return arm.position[0] > before[0] + 0.15

        arm.wait(moved, "motion of A1")
        self.assertLess((arm.position[0] - before[0]) / (time.monotonic() - begin), 1.2 * fastest)
        self.assertLess(max(abs(a - b) for a, b in zip(arm.position[1:], before[1:], strict=True)), 0.03)
        self.command(arm, "stop")
        arm.wait(lambda: arm.state.fri_state == "MON" and arm.state.supervisor == "monitor", "monitor mode again")
        # The controller had nothing to complain about but a computer that was late.
        self.assertEqual([words for words in arm.messages if not words.startswith(("FRI timing", "FRI quality"))], [])

    def command(self, arm: Arm, event: str) -> None:
        replies = []

        def done() -> bool:
            replies.append(arm.command(event))
            return replies[-1].success

        arm.wait(done, event)

    def test_coglab(self) -> None:
        self.run_through("coglab", "position")

    def test_centro_epiaggio(self) -> None:
        self.run_through("centro_epiaggio", "joint_impedance")

    def test_stanford(self) -> None:
        self.run_through("stanford", "cartesian_impedance")

    def test_rcprg_tum(self) -> None:
        self.run_through("rcprg_tum", "joint_impedance")

    def test_rtt_lwr_in_t1(self) -> None:
        """The launch argument limits_profile:=t1 keeps every joint at 0.24 rad/s, whatever is asked for."""
        self.run_through("rtt_lwr", "position", speed=1.5, fastest=0.24)


if __name__ == "__main__":
    rospy.init_node("conventions_rostest")
    rostest.rosrun("coglab_sim", "conventions", Conventions, sys.argv)
