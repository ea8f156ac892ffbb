#!/usr/bin/python3
"""Faults between node and hand: pulled cables, silence, noise, a blocked motor."""

from __future__ import annotations

import sys
import time
import unittest

import rospy
import rostest
from actionlib import GoalStatus
from hand_client import HandClient

GOALS = {"hand_open": (60,), "hand_close": (60,), "hand_preshape": ("cylindrical", "low"), "hand_preshape_close": ()}


class HandFaults(unittest.TestCase):
    """Each test begins with an open hand and a line without faults."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.hand = HandClient()
        cls.hand.wait_ready()
        cls.hand.calibrate_and_wait("fast force")

    def setUp(self) -> None:
        self.hand.fault("clear")
        self.hand.wait(lambda: self.hand.status.connected, "hand connected")
        self.hand.touch([255] * 5)
        self.assertTrue(self.hand.run("hand_open", 511).isOk)

    def begin(self, name: str) -> None:
        """Start the action of that name."""
        # From the other end: the interrupted goal before this one may have left the fingers anywhere.
        if name == "hand_open":
            self.assertTrue(self.hand.run("hand_close", 511).isOk)
        if name == "hand_close":
            self.assertTrue(self.hand.run("hand_open", 511).isOk)
        if name == "hand_preshape_close":
            self.assertTrue(self.hand.run("hand_preshape", "cylindrical", "low").isOk)
        self.hand.send(name, *GOALS[name])
        self.hand.wait(lambda: self.hand.feedback, "feedback")

    def check_broken(self, fault: str) -> None:
        for name in GOALS:
            self.hand.fault("clear")
            self.hand.wait(lambda: self.hand.status.connected, "reconnection")
            self.begin(name)
            port = rospy.get_param("coglab_sim/hand_port")
            self.hand.fault(fault)
            result = self.hand.result(name)
            self.assertFalse(result.isOk, name)
            self.assertEqual(self.hand.clients[name].get_state(), GoalStatus.ABORTED, name)
            self.assertIn(port, result.message)
            self.assertRegex(result.message, r"(0x\w\w|none)")
            self.hand.wait(lambda: not self.hand.status.connected, "report of the loss")
            self.assertEqual(list(self.hand.status.motors), [])

    def test_cable_pulled_during_each_action(self) -> None:
        self.check_broken("unplug")

    def test_silence_during_each_action(self) -> None:
        self.check_broken("mute")

    def test_reconnection_counts_as_holding_and_moves_nothing(self) -> None:
        self.assertTrue(self.hand.run("hand_preshape", "lateral", "high").isOk)
        before = [110, 5, 160, 245, 245]
        self.hand.wait(lambda: list(self.hand.fingers.position) == before, "fingers at rest")
        count = len(self.hand.statuses)
        self.hand.fault("unplug 1")
        self.hand.wait(lambda: any(not status.connected for status in self.hand.statuses[count:]), "loss")
        self.hand.wait(lambda: self.hand.status.connected, "reconnection")
        status = self.hand.fresh_status()
        self.assertTrue(status.holding)
        self.assertFalse(status.calibrated)
        time.sleep(0.5)
        self.assertEqual(list(self.hand.fingers.position), before)
        result = self.hand.run("hand_preshape_close")
        self.assertIn("hand_preshape first", result.message)
        self.hand.calibrate("fast")
        self.hand.wait(lambda: "may hold" in self.hand.status.message, "refusal")
        self.assertTrue(self.hand.run("hand_open", 511).isOk)
        self.assertFalse(self.hand.fresh_status().holding)

    def test_goal_without_connection(self) -> None:
        self.hand.fault("unplug")
        self.hand.wait(lambda: not self.hand.status.connected, "loss")
        result = self.hand.run("hand_open", 100)
        self.assertFalse(result.isOk)
        self.assertIn("not connected", result.message)
        self.assertFalse(self.hand.stop_service().success)


if __name__ == "__main__":
    rospy.init_node("hand_faults_rostest")
    rostest.rosrun("ih2_hand", "hand_faults", HandFaults, sys.argv)
