#!/usr/bin/python3
"""Sections 9 and 15 of the specification: Ctrl-C ends every kind of machine."""

import os
import signal
import subprocess
import sys
import threading
import unittest

import rospy
from std_srvs.srv import Trigger, TriggerResponse

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from reference_server import ReferenceServer  # noqa: E402

LIMIT = 30.0


class TestShutdown(unittest.TestCase):
    def run_until_interrupted(self, kind):
        command = [sys.executable, os.path.join(HERE, "shutdown_machine.py"), kind]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            for line in process.stdout:
                if "READY" in line:
                    break
            process.send_signal(signal.SIGINT)
            return process.communicate(timeout=LIMIT)[0]
        finally:
            process.kill()
            process.wait()

    def check(self, kind):
        self.assertIn("OUTCOME", self.run_until_interrupted(kind))

    def test_s15_action_without_server(self):
        self.check("action_without_server")

    def test_s15_action_under_way(self):
        server = ReferenceServer("reference")
        self.check("action_under_way")
        self.assertEqual(server.goals, [3])

    def test_s15_monitor(self):
        self.check("monitor")

    def test_s15_condition(self):
        self.check("condition")

    def test_s15_service_that_is_not_there(self):
        self.check("service")

    def test_s15_service_that_hangs(self):
        done = threading.Event()
        service = rospy.Service(
            "hangs", Trigger, lambda request: done.wait(60) or TriggerResponse()
        )
        self.check("service_that_hangs")
        done.set()
        service.shutdown()

    def test_s15_concurrence(self):
        self.check("concurrence")

    def test_s9_set_preempt_handler(self):
        self.assertIn("OUTCOME end", self.run_until_interrupted("handler"))

    def test_s9_set_preempt_handler_does_not_wait_for_its_own_thread_better(self):
        self.assertIn("OUTCOME end", self.run_until_interrupted("handler_in_main_thread"))


if __name__ == "__main__":
    import rostest

    rospy.init_node("shutdown_rostest")
    rostest.rosrun("smach_ros", "shutdown", __name__)
