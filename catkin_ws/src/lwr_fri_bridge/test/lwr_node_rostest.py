#!/usr/bin/python3
"""The bridge as a node: Table 1 of D4.10, the acknowledged twin, diagnostics, an orderly end on SIGINT."""

from __future__ import annotations

import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

import rospy
import rostest
from coglab_msgs.msg import LwrState
from coglab_msgs.srv import LwrCommand
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from udp_controller import UdpController

LIMIT = 20.0  # s, for everything that is waited for


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


class Twist:
    """Publishes a target velocity at 50 Hz until stopped."""

    def __init__(self, publisher: rospy.Publisher, velocity: list[float]) -> None:
        self.message = JointState(velocity=velocity)
        self.publisher = publisher
        self.timer = rospy.Timer(rospy.Duration(0.02), lambda _: publisher.publish(self.message))

    def stop(self) -> None:
        self.timer.shutdown()


class LwrNode(unittest.TestCase):
    robot: UdpController

    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = UdpController(bound_port("/lwr")).start()
        cls.states: list[LwrState] = []
        rospy.Subscriber("/lwr/state", LwrState, cls.states.append)
        rospy.wait_for_service("/lwr/command", LIMIT)
        cls.command = staticmethod(rospy.ServiceProxy("/lwr/command", LwrCommand))
        cls.events = rospy.Publisher("/lwr/ros_events", String, queue_size=5)
        cls.target = rospy.Publisher("/lwr/target_joint_states", JointState, queue_size=1)
        wait_for(
            lambda: cls.events.get_num_connections() and cls.target.get_num_connections(),
            "connections",
        )

    @classmethod
    def tearDownClass(cls) -> None:
        cls.robot.close()

    def wait_state(self, supervisor: str) -> LwrState:
        wait_for(
            lambda: self.states and self.states[-1].supervisor == supervisor,
            f"supervisor {supervisor}",
        )
        return self.states[-1]

    def ask(self, event: str) -> str:
        reply = self.command(event)
        self.assertTrue(reply.success, f"{event}: {reply.message}")
        return reply.message

    def setUp(self) -> None:
        wait_for(lambda: self.states and self.states[-1].fri_state in ("MON", "CMD"), "a state")
        self.ask("reset")
        if self.states[-1].fri_state != "MON":
            self.ask("stop")
        wait_for(lambda: self.states[-1].fri_state == "MON", "monitor mode")

    def test_joint_states_torques_and_wrench(self) -> None:
        joints = rospy.wait_for_message("/lwr/joint_states", JointState, LIMIT)
        self.assertEqual(
            joints.name, ["lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"]
        )
        self.assertEqual(list(joints.effort), [1, 2, 3, 4, 5, 6, 7])
        self.assertEqual(len(joints.velocity), 7)
        torques = rospy.wait_for_message("/lwr/external_torques", JointState, LIMIT)
        self.assertEqual(list(torques.effort), [7, 6, 5, 4, 3, 2, 1])
        wrench = rospy.wait_for_message("/lwr/tool_wrench", WrenchStamped, LIMIT).wrench
        self.assertEqual((wrench.torque.x, wrench.torque.y, wrench.torque.z), (6, 5, 4))

    def test_unknown_event_is_rejected_with_the_list(self) -> None:
        reply = self.command("jump")
        self.assertFalse(reply.success)
        self.assertIn("known events: start, hold, reset, stop, position", reply.message)

    def test_start_move_hold_reset_stop(self) -> None:
        self.assertIn("POSITION", self.ask("start"))
        state = self.wait_state("command")
        self.assertTrue(state.motion_allowed)
        before = self.robot.position[0]
        twist = Twist(self.target, [0.2, 0, 0, 0, 0, 0, 0])
        try:
            wait_for(lambda: self.robot.position[0] > before + 0.1, "motion")
            self.events.publish("hold")
            state = self.wait_state("holding")
            self.assertTrue(state.hold_latched)
            self.assertIn("reset", state.reason)
            time.sleep(0.5)
            held = self.robot.position[0]
            time.sleep(0.5)
            self.assertEqual(self.robot.position[0], held)
            self.assertFalse(self.command("start").success)
            self.ask("reset")
            wait_for(lambda: self.robot.position[0] > held + 0.05, "motion after reset")
        finally:
            twist.stop()
        self.ask("stop")
        self.wait_state("monitor")
        self.assertEqual(self.robot.requests[-1][0], 2)
        self.assertLess(
            self.robot.requests[-1][1], 1e-6
        )  # the arm stood when monitor mode was asked for
        self.assertLess(max(self.robot.steps), 0.2 * 0.005 * 1.01 + 1e-6)

    def test_malformed_targets_are_refused(self) -> None:
        self.ask("start")
        before = list(self.robot.position)
        for message in (
            JointState(velocity=[0.2] * 6),
            JointState(velocity=[float("nan")] * 7),
            JointState(name=["lwr_a1"] * 7, velocity=[0.2] * 7),
            JointState(name=["a", "b", "c", "d", "e", "f", "g"], velocity=[0.2] * 7),
        ):
            for _ in range(10):
                self.target.publish(message)
                time.sleep(0.01)
        self.assertEqual(self.robot.position, before)

    def test_modes_change_in_monitor_mode_only(self) -> None:
        self.ask("joint_impedance stiffness 500 damping 0.7")
        self.assertIn("JNT_IMP", self.ask("start"))
        self.assertFalse(self.command("position").success)
        self.ask("stop")
        self.ask("position")

    def test_diagnostics(self) -> None:
        end = time.monotonic() + LIMIT
        found: dict[str, dict[str, str]] = {}
        while time.monotonic() < end and len(found) < 3:
            for status in rospy.wait_for_message("/diagnostics", DiagnosticArray, LIMIT).status:
                found[status.name.split(": ")[1]] = {v.key: v.value for v in status.values}
        self.assertEqual(found["FRI connection"]["quality"], "PERFECT")
        for key in ("latency (s)", "jitter (s)", "misses", "longest answer time (s)", "peer"):
            self.assertIn(key, found["FRI connection"])
        self.assertEqual(float(found["arm"]["temperature lwr_a6 (degC)"]), 36.0)

    def test_sigint_brakes_then_asks_for_monitor_mode(self) -> None:
        rospy.set_param("/lwr_two/fri_port", 0)
        rospy.set_param("/lwr_two/rt_priority", 0)
        binary = subprocess.check_output(
            ["catkin_find", "--first-only", "--libexec", "lwr_fri_bridge", "lwr_node"], text=True
        ).strip()
        node = subprocess.Popen(
            [binary, "__name:=lwr_two", "_lwr_namespace:=/lwr_two"], env=os.environ
        )
        robot = UdpController(bound_port("/lwr_two")).start()
        twist = None
        try:
            rospy.wait_for_service("/lwr_two/command", LIMIT)
            command = rospy.ServiceProxy("/lwr_two/command", LwrCommand)
            wait_for(lambda: command("start").success, "start")
            target = rospy.Publisher("/lwr_two/target_joint_states", JointState, queue_size=1)
            twist = Twist(target, [0.5, 0, 0, 0, 0, 0, 0])
            before = robot.position[0]
            wait_for(lambda: robot.position[0] > before + 0.2, "motion")
            node.send_signal(signal.SIGINT)
            self.assertEqual(node.wait(timeout=LIMIT), 0)
            self.assertEqual(robot.state, 1)
            self.assertEqual(robot.requests[-1][0], 2)
            self.assertLess(robot.requests[-1][1], 1e-6)
        finally:
            if twist:
                twist.stop()
            if node.poll() is None:
                node.kill()
            node.wait(timeout=LIMIT)
            robot.close()

    def test_parameter_out_of_range_is_refused_at_start(self) -> None:
        rospy.set_param("/lwr_three/set_point_leash/position", 7.0)
        binary = subprocess.check_output(
            ["catkin_find", "--first-only", "--libexec", "lwr_fri_bridge", "lwr_node"], text=True
        ).strip()
        run = subprocess.run(
            [binary, "__name:=lwr_three", "_lwr_namespace:=/lwr_three"],
            env=os.environ,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LIMIT,
        )
        self.assertNotEqual(run.returncode, 0)
        self.assertIn("set_point_leash/position = 7 is outside its range 0.005..0.5", run.stdout)


if __name__ == "__main__":
    rospy.init_node("lwr_node_rostest")
    rostest.rosrun("lwr_fri_bridge", "lwr_node", LwrNode, sys.argv)
