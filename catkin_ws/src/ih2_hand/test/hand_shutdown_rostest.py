#!/usr/bin/python3
"""Node and emulator end without a traceback; a goal under way is aborted and the fingers stop."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

import rosnode
import rospy
import rostest
from actionlib import GoalStatus
from hand_client import HandClient

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
LIMIT_S = 60.0


class HandShutdown(unittest.TestCase):
    """Each test starts its own processes."""

    def setUp(self) -> None:
        self.processes: list[subprocess.Popen] = []

    def tearDown(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()

    def start(self, script: str, *arguments: str) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, str(SCRIPTS / script), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.processes.append(process)
        return process

    def start_emulator(self, name: str) -> subprocess.Popen:
        process = self.start("hand_emulator.py", "--greeting", f"__name:={name}", "__ns:=coglab_sim")
        self.assertTrue(process.stdout.readline().startswith("port /"))
        end = time.monotonic() + LIMIT_S
        while f"/coglab_sim/{name}" not in rosnode.get_node_names():
            self.assertLess(time.monotonic(), end, "the emulator is not on the master")
            time.sleep(0.05)
        return process

    def check_end(self, process: subprocess.Popen, status: int | None = 0) -> None:
        _, errors = process.communicate(timeout=LIMIT_S)
        self.assertNotIn("Traceback", errors, errors)
        self.assertNotIn("Error", errors)
        self.assertNotIn("unexpected", errors)
        if status is not None:
            self.assertEqual(process.returncode, status, errors)

    def test_emulator_and_signals(self) -> None:
        for number in (signal.SIGINT, signal.SIGTERM):
            processes = [self.start_emulator(f"emulator_{number.name.lower()}_{i}") for i in range(3)]
            time.sleep(0.3)  # let the timers run
            for process in processes:
                process.send_signal(number)
            for process in processes:
                self.check_end(process)

    def test_emulator_and_rosnode_kill(self) -> None:
        process = self.start_emulator("emulator_killed")
        killed, failed = rosnode.kill_nodes(["/coglab_sim/emulator_killed"])
        self.assertEqual((len(killed), len(failed)), (1, 0))
        self.check_end(process)

    def test_node_with_a_goal_under_way(self) -> None:
        self.start_emulator("hand_emulator")
        rospy.set_param("ih2_hand/serial_port", "param:coglab_sim/hand_port")
        rospy.set_param("ih2_hand/read_timeout", 0.25)
        node = self.start("hand_node.py", "__name:=ih2_hand")
        hand = HandClient()
        hand.wait_ready()
        hand.send("hand_close", 60)
        hand.wait(lambda: hand.feedback, "feedback")
        node.send_signal(signal.SIGINT)
        result = hand.result("hand_close")
        self.assertEqual(hand.clients["hand_close"].get_state(), GoalStatus.ABORTED)
        self.assertFalse(result.isOk)
        self.assertIn("node", result.message)
        self.check_end(node, None)
        before = None
        while before != list(hand.fingers.position):  # what was on its way
            before = list(hand.fingers.position)
            time.sleep(1.0)
        time.sleep(1.0)
        self.assertEqual(list(hand.fingers.position), before, "the fingers stand")


if __name__ == "__main__":
    rospy.init_node("hand_shutdown_rostest")
    rostest.rosrun("ih2_hand", "hand_shutdown", HandShutdown, sys.argv)
