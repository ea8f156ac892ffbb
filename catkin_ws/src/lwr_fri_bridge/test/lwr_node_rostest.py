#!/usr/bin/python3
"""The bridge as a node: Table 1 of D4.10, the acknowledged twin, diagnostics."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import time
import unittest

import rospy
import rostest
from coglab_msgs.msg import LwrState, ReasonCode
from coglab_msgs.srv import LwrCommand
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import String

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from lwr_node_support import LIMIT, Twist, bound_port, refusals, wait_for
from udp_controller import UdpController


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
        """Again where the controller played in Python was too slow for the limit of the request."""
        replies = []

        def done() -> bool:
            replies.append(self.command(event))
            return replies[-1].success

        wait_for(done, event)
        return replies[-1].message

    def setUp(self) -> None:
        wait_for(lambda: self.states and self.states[-1].fri_state in ("MON", "CMD"), "a state")
        self.ask("reset")
        if self.states[-1].fri_state != "MON":
            self.ask("stop")
        wait_for(lambda: self.states[-1].fri_state == "MON", "monitor mode")

    def test_joint_states_torques_and_wrench(self) -> None:
        joints = rospy.wait_for_message("/lwr/joint_states", JointState, LIMIT)
        self.assertEqual(joints.name, ["lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"])
        self.assertEqual(list(joints.effort), [1, 2, 3, 4, 5, 6, 7])
        self.assertEqual(len(joints.velocity), 7)
        torques = rospy.wait_for_message("/lwr/external_torques", JointState, LIMIT)
        self.assertEqual(list(torques.effort), [7, 6, 5, 4, 3, 2, 1])
        message = rospy.wait_for_message("/lwr/tool_wrench", WrenchStamped, LIMIT)
        self.assertEqual(message.header.frame_id, "ih2_palm")
        # On the wire 1 2 3, torques reversed 4 5 6, in the base's axes; told in the tool's.
        force, torque = message.wrench.force, message.wrench.torque
        self.assertEqual((force.x, force.y, force.z), (2, -1, 3))
        self.assertEqual((torque.x, torque.y, torque.z), (5, -6, 4))

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
            self.assertEqual((state.reason_code, state.next_event), (ReasonCode.HELD, "reset"))
            answered = self.robot.answered
            wait_for(lambda: self.robot.answered > answered + 100 and max(self.robot.steps[-50:]) < 1e-9, "rest")
            held = self.robot.position[0]
            time.sleep(0.5)
            self.assertEqual(self.robot.position[0], held)
            refused = self.command("start")
            self.assertEqual((refused.success, refused.reason_code), (False, ReasonCode.HELD))
            self.ask("reset")
            wait_for(lambda: self.robot.position[0] > held + 0.05, "motion after reset")
        finally:
            twist.stop()
        self.ask("stop")
        self.wait_state("monitor")
        self.assertEqual(self.robot.requests[-1][0], 2)
        self.assertLess(self.robot.requests[-1][1], 1e-6)  # the arm stood when monitor mode was asked for
        self.assertLess(max(self.robot.steps), 0.2 * 0.005 * 1.01 + 1e-6)

    def test_extreme_stamps_are_refused_counted_and_said(self) -> None:
        told: list[str] = []
        rospy.Subscriber("/rosout", Log, lambda m: told.append(m.msg))
        self.ask("start")
        before, refused = list(self.robot.position), refusals("stamp")
        now = rospy.Time.now()
        near = rospy.Duration(30)  # more than a busy computer is late
        for stamp in (rospy.Time(0), rospy.Time(1), rospy.Time(4294967295, 999999999), now + near, now - near):
            for _ in range(4):
                message = JointState(velocity=[0.2] * 7)
                message.header.stamp = stamp
                self.target.publish(message)
                time.sleep(0.02)
        wait_for(lambda: refusals("stamp") > refused, "the refusals in the diagnostics")
        wait_for(lambda: any("header.stamp" in line for line in told), "the reason in the log")
        self.assertEqual(self.robot.position, before)
        self.ask("stop")

    def test_outcomes_of_events_go_to_the_log_once(self) -> None:
        told: list[str] = []
        subscriber = rospy.Subscriber("/rosout", Log, lambda m: told.append(m.msg))

        def said(line: str, event: str) -> bool:
            self.events.publish(event)
            return wait_for(lambda: any(line in one for one in told), line)

        # Until the log is connected.
        wait_for(lambda: self.events.publish("reset") or any("lwr: reset: nothing to do" in m for m in told), "the log")
        said("lwr: hold: done", "hold")
        said("lwr: start refused: hold is latched", "start")
        said("lwr: ros_events: unknown event 'jump'", "jump")
        said("lwr: reset: done", "reset")
        subscriber.unregister()
        self.assertEqual(sum("lwr: hold: done" in line for line in told), 1)
        self.assertFalse([line for line in told if "not finished yet" in line])

    def test_diagnostics(self) -> None:
        end = time.monotonic() + LIMIT
        found: dict[str, dict[str, str]] = {}
        while time.monotonic() < end and len(found) < 3:
            for status in rospy.wait_for_message("/diagnostics", DiagnosticArray, LIMIT).status:
                found[status.name.split(": ")[1]] = {v.key: v.value for v in status.values}
        self.assertEqual(found["FRI connection"]["quality"], "PERFECT")
        for key in ("latency (s)", "jitter (s)", "misses", "mean answer time (s)", "longest answer time (s)", "peer"):
            self.assertIn(key, found["FRI connection"])
        # A second sender, which a test before this one was, is told as long as the node lives.
        known = (str(ReasonCode.NONE), str(ReasonCode.SECOND_SENDER))
        self.assertIn(found["FRI connection"]["reason_code"], known)
        self.assertTrue(all("reason_code" in values for values in found.values()))
        for joint, degrees in zip(("a1", "a2", "e1", "a3", "a4", "a5", "a6"), range(30, 37), strict=True):
            self.assertEqual(float(found["arm"][f"temperature lwr_{joint} (degC)"]), degrees)

    def test_a_second_publisher_is_refused_while_one_moves_the_arm(self) -> None:
        # A stalled machine ends command mode, and then both publishers are refused for that. The motion_epoch has grown
        # by it, and such a try says nothing. Neither does one in which this publisher paused, for topic_timeout (0.1 s)
        # lets the other one move.
        for _ in range(20):
            self.ask("start")
            epoch = wait_for(lambda: self.states[-1].motion_allowed and self.states[-1].motion_epoch, "permission")
            try:
                self.second_publisher_is_refused()
                break
            except AssertionError:
                if self.states[-1].motion_epoch == epoch and not self.paused:
                    raise
                self.setUp()
        else:
            self.fail("command mode was lost in each of 20 tries")
        self.ask("stop")

    def second_publisher_is_refused(self) -> None:
        """In command mode: a second publisher moves the arm only after the first one has ended."""
        self.paused = False
        binary = [sys.executable, str(pathlib.Path(__file__).resolve().parent / "foreign_target.py")]
        told: list[str] = []
        log = rospy.Subscriber("/rosout", Log, lambda m: told.append(m.msg))
        refused = refusals("another publisher")
        twist = Twist(self.target, [0.0] * 7)
        foreign = subprocess.Popen([*binary, "__name:=foreign_target"], env=os.environ)
        try:
            before = self.robot.position[6]
            wait_for(
                lambda: any("target_joint_states" in m and "/foreign_target" in m for m in told),
                "the refusal",
            )
            rospy.sleep(1.0)
            there, self.paused = self.robot.position[6], twist.longest_pause > 0.05
            self.assertEqual(there, before)
            self.assertGreater(refusals("another publisher"), refused)
            twist.stop()  # a pause longer than topic_timeout: now the other one may
            wait_for(lambda: self.robot.position[6] > before + 0.05, "the other one's motion")
        finally:
            twist.stop()
            foreign.kill()
            foreign.wait(timeout=LIMIT)
            log.unregister()


if __name__ == "__main__":
    rospy.init_node("lwr_node_rostest")
    rostest.rosrun("lwr_fri_bridge", "lwr_node", LwrNode, sys.argv)
