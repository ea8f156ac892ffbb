#!/usr/bin/python3
"""How the node begins and ends: signals, ports, parameters, a stall; each time a node of its own beside /lwr."""

from __future__ import annotations

import os
import pathlib
import re
import signal
import subprocess
import sys
import time
import unittest

import rospy
import rostest
from coglab_msgs.msg import LwrState, ReasonCode
from coglab_msgs.srv import LwrCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from lwr_node_support import LIMIT, Diagnostics, Twist, bound_port, node_binary, wait_for
from udp_controller import UdpController


class LwrNodeProcesses(unittest.TestCase):
    def second_node(self, name: str, **parameters) -> tuple[subprocess.Popen, UdpController, Twist]:
        """Another bridge with a controller of its own, moving A1 at 0.5 rad/s."""
        for parameter, value in parameters.items():
            rospy.set_param(f"/{name}/{parameter}", value)
        rospy.set_param(f"/{name}/fri_port", 0)
        rospy.set_param(f"/{name}/rt_priority", 0)
        rospy.set_param(f"/{name}/receive_timeout", 2.0)  # of a controller played in Python
        node = subprocess.Popen([node_binary(), f"__name:={name}", f"_lwr_namespace:=/{name}"], env=os.environ)
        robot = UdpController(bound_port(f"/{name}")).start()
        rospy.wait_for_service(f"/{name}/command", LIMIT)
        command = rospy.ServiceProxy(f"/{name}/command", LwrCommand)
        wait_for(lambda: command("start").success, "start")
        target = rospy.Publisher(f"/{name}/target_joint_states", JointState, queue_size=1)
        twist = Twist(target, [0.5, 0, 0, 0, 0, 0, 0])
        before, states = robot.position[0], []
        subscriber = rospy.Subscriber(f"/{name}/state", LwrState, states.append)

        def moves() -> bool:
            if states and not states[-1].motion_allowed:  # a late computer has ended the motion
                command("start")
            return robot.position[0] > before + 0.2

        try:
            wait_for(moves, "motion")
        except AssertionError as error:
            self.fail(f"{error}; {robot.answered} answers in time, state {robot.state}, {states[-1:]}")
        finally:
            subscriber.unregister()
        return node, robot, twist

    def end(self, node: subprocess.Popen, robot: UdpController, twist: Twist) -> None:
        twist.stop()
        if node.poll() is None:
            node.kill()
        node.wait(timeout=LIMIT)
        robot.close()

    def test_sigint_brakes_then_asks_for_monitor_mode(self) -> None:
        node, robot, twist = self.second_node("lwr_two")
        try:
            node.send_signal(signal.SIGINT)
            self.assertEqual(node.wait(timeout=LIMIT), 0)
            self.assertEqual(robot.state, 1)
            self.assertEqual(robot.requests[-1][0], 2)
            self.assertLess(robot.requests[-1][1], 1e-6)
        finally:
            self.end(node, robot, twist)

    def test_rosnode_kill_brakes_too(self) -> None:
        node, robot, twist = self.second_node("lwr_seven")
        try:
            subprocess.run(["rosnode", "kill", "/lwr_seven"], env=os.environ, check=False, timeout=LIMIT)
            self.assertEqual(node.wait(timeout=LIMIT), 0)
            self.assertEqual((robot.state, robot.requests[-1][0]), (1, 2))
            self.assertLess(robot.requests[-1][1], 1e-6)
        finally:
            self.end(node, robot, twist)

    def test_sigint_keeps_answering_for_2_s_if_monitor_mode_does_not_come(self) -> None:
        node, robot, twist = self.second_node("lwr_four")
        try:
            robot.obeys = False
            answered, began = robot.answered, time.monotonic()
            node.send_signal(signal.SIGTERM)
            self.assertEqual(node.wait(timeout=LIMIT), 0)
            self.assertGreater(time.monotonic() - began, 1.9)
            self.assertGreater(robot.answered, answered)
            self.assertLess(robot.steps[-1], 1e-6)  # braked meanwhile
        finally:
            self.end(node, robot, twist)

    def test_sigint_with_a_silent_controller_ends_after_1_s(self) -> None:
        node, robot, twist = self.second_node("lwr_five")
        try:
            robot.silent = True
            began = time.monotonic()
            node.send_signal(signal.SIGINT)
            self.assertEqual(node.wait(timeout=LIMIT), 0)
            self.assertGreater(time.monotonic() - began, 0.9)  # it waited for it to come back
        finally:
            self.end(node, robot, twist)

    def test_no_packets_is_said_with_port_and_time(self) -> None:
        rospy.set_param("/lwr_six/fri_port", 0)
        rospy.set_param("/lwr_six/rt_priority", 0)
        told: list[str] = []
        rospy.Subscriber("/rosout", Log, lambda m: told.append(m.msg))
        commands, connection = Diagnostics("lwr_six: commands"), Diagnostics("lwr_six: FRI connection")
        began = time.monotonic()
        node = subprocess.Popen([node_binary(), "__name:=lwr_six", "_lwr_namespace:=/lwr_six"], env=os.environ)
        try:
            port = bound_port("/lwr_six")
            said = re.compile(rf"no valid packet received on port {port} for (\d+) s")
            warning = wait_for(lambda: next((m for m in map(said.search, told) if m), None), "the warning")
            self.assertGreater(time.monotonic() - began, 4.9)
            self.assertGreaterEqual(int(warning[1]), 5, warning[0])
            # Nothing was asked of it and nothing refused; of the connection it says the same.
            quiet = wait_for(lambda: commands.told, "diagnostics")[0]
            self.assertEqual((quiet.level, quiet.message), (DiagnosticStatus.OK, "ok"))
            self.assertEqual({int(v.value) for v in quiet.values}, {0})
            status = wait_for(lambda: connection.told, "diagnostics")[-1]
            self.assertEqual((status.level, status.values[0].value), (2, str(ReasonCode.ROBOT_DISCONNECTED)))
            self.assertTrue(said.search(status.message))
        finally:
            commands.close()
            connection.close()
            node.send_signal(signal.SIGINT)
            self.assertEqual(node.wait(timeout=LIMIT), 0)

    def test_a_busy_port_is_said_first(self) -> None:
        port = bound_port("/lwr")
        rospy.set_param("/lwr_eight/fri_port", port)
        known = subprocess.Popen(
            [node_binary(), "__name:=lwr_eight", "_lwr_namespace:=/lwr_eight"],
            env=os.environ,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        told, _ = known.communicate(timeout=LIMIT)
        self.assertNotEqual(known.returncode, 0)
        first = next(line for line in told.splitlines() if line.strip())
        self.assertIn(f":{port} (Address already in use)", first)

    def test_a_stall_of_this_computer_is_named_and_ends_by_itself_at_rest(self) -> None:
        node, robot, twist = self.second_node("lwr_ten")
        states: list[LwrState] = []
        subscriber = rospy.Subscriber("/lwr_ten/state", LwrState, states.append)
        try:
            twist.stop()
            wait_for(lambda: robot.steps and max(robot.steps[-200:]) < 1e-6, "standing still")
            wait_for(lambda: states, "a state")
            epoch = states[-1].motion_epoch
            robot.silent = True  # its receive_timeout is 2 s here
            lost = wait_for(lambda: next((s for s in states if s.supervisor == "disconnected"), None), "the loss")
            self.assertIn("this computer", lost.reason)
            robot.silent = False
            wait_for(lambda: states[-1].motion_allowed, "motion allowed again, unasked")
            stopped = next(s for s in states if s.supervisor == "stopped")
            self.assertEqual(stopped.reason_code, ReasonCode.COMPUTER_LATE)
            self.assertEqual(stopped.next_event, "start")
            self.assertGreater(states[-1].motion_epoch, epoch)
            self.assertEqual(states[-1].reason_code, ReasonCode.NONE)
            self.assertLess(max(robot.steps[-50:]), 1e-6)
        finally:
            subscriber.unregister()
            self.end(node, robot, twist)

    def test_parameters_out_of_range_are_refused_at_start(self) -> None:
        for name, value, expected in (
            ("set_point_leash/position", 7.0, "outside its range"),
            ("fri_port", 70000, "outside its range"),
            ("rt_priority", 99, "outside its range"),
            ("hot_drive", -300.0, "outside its range"),
            ("joint_states_rate", 0.0, "outside its range"),
            ("position_margin", "wide", "expected a number"),
            ("quiet_restart", 1, "expected true or false"),
            ("tool_frame", 7, "expected a name"),
            ("krl_convention", "nobody", "known: coglab"),
            ("limits_profile", "t9", "profile 't9' is missing"),
            ("control_mode", "start", "expected position"),
        ):
            space = "/lwr_three_" + name.replace("/", "_")
            rospy.set_param(f"{space}/{name}", value)
            run = subprocess.run(
                [node_binary(), f"__name:={space[1:]}", f"_lwr_namespace:={space}"],
                env=os.environ,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=LIMIT,
            )
            self.assertEqual(run.returncode, 1, name)
            self.assertIn(expected, run.stdout)
            self.assertIn(name.split("/")[-1] if name != "limits_profile" else "t9", run.stdout)


if __name__ == "__main__":
    rospy.init_node("lwr_node_processes_rostest")
    rostest.rosrun("lwr_fri_bridge", "lwr_node_processes", LwrNodeProcesses, sys.argv)
