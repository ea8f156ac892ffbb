#!/usr/bin/python3
"""Ctrl-C ends every kind of machine."""

import os
import signal
import subprocess
import sys
import threading
import time
import unittest

import rospy
from std_srvs.srv import Trigger, TriggerResponse

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from reference_server import ReferenceServer  # noqa: E402

LIMIT = 60.0


KINDS = """action_without_server action_under_way monitor condition service service_that_hangs
    concurrence handler handler_in_main_thread""".split()


class TestShutdown(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """All at once: most of the time goes into starting and ending processes."""
        cls.server = ReferenceServer("reference")
        cls.release = threading.Event()

        def hang(request):
            cls.release.wait(2 * LIMIT)
            return TriggerResponse()

        cls.service = rospy.Service("hangs", Trigger, hang)
        script = os.path.join(HERE, "shutdown_machine.py")
        cls.processes = {
            kind: subprocess.Popen([sys.executable, script, kind], stdout=subprocess.PIPE, text=True) for kind in KINDS
        }

    @classmethod
    def tearDownClass(cls):
        cls.release.set()
        for process in cls.processes.values():
            process.kill()
            process.wait()
            process.stdout.close()
        cls.service.shutdown()

    def check(self, kind, under_way=lambda: True):
        process = self.processes[kind]
        for line in process.stdout:
            if "READY" in line:
                break
        end = time.monotonic() + LIMIT
        while not under_way() and time.monotonic() < end:
            time.sleep(0.05)
        self.assertIsNone(process.poll(), "still running before the interrupt")
        process.send_signal(signal.SIGINT)
        self.assertIn("OUTCOME end", process.communicate(timeout=LIMIT)[0])

    def test_action_without_server(self):
        self.check("action_without_server")

    def test_action_under_way(self):
        self.check("action_under_way", under_way=lambda: self.server.goals)
        self.assertEqual(self.server.goals, [3])

    def test_monitor(self):
        self.check("monitor")

    def test_condition(self):
        self.check("condition")

    def test_service_that_is_not_there(self):
        self.check("service")

    def test_service_that_hangs(self):
        self.check("service_that_hangs")

    def test_concurrence(self):
        self.check("concurrence")

    def test_set_preempt_handler(self):
        self.check("handler")

    def test_set_preempt_handler_does_not_wait_for_its_own_thread(self):
        self.check("handler_in_main_thread")


if __name__ == "__main__":
    import rostest

    rospy.init_node("shutdown_rostest")
    rostest.rosrun("smach_ros", "shutdown", __name__)
