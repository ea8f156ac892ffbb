#!/usr/bin/python3
"""An action server for the tests: the number in the goal selects its behaviour."""

import sys
import threading

import actionlib
import rospy
from actionlib.msg import TestAction, TestResult

SUCCEED, ABORT, UNTIL_CANCELLED, SUCCEED_WHEN_CANCELLED, DEAF = range(1, 6)


class ReferenceServer:
    """Serves `name`; `cancelled` counts the cancels that arrived."""

    def __init__(self, name):
        self.goals, self.cancelled = [], 0
        self.release = threading.Event()  # lets a deaf goal end
        self._server = actionlib.SimpleActionServer(name, TestAction, execute_cb=self._execute, auto_start=False)
        self._server.register_preempt_callback(self._on_cancel)
        self._server.start()

    def _on_cancel(self):
        self.cancelled += 1

    def _execute(self, goal):
        self.goals.append(goal.goal)
        result = TestResult(result=goal.goal + 100)
        if goal.goal == SUCCEED:
            self._server.set_succeeded(result)
        elif goal.goal == ABORT:
            self._server.set_aborted(result)
        elif goal.goal == DEAF:
            self.release.wait(300)
            self._server.set_succeeded(result)
        else:
            while not self._server.is_preempt_requested() and not rospy.is_shutdown():
                rospy.sleep(0.005)
            if goal.goal == SUCCEED_WHEN_CANCELLED:
                self._server.set_succeeded(result)
            else:
                self._server.set_preempted(result)


if __name__ == "__main__":
    rospy.init_node("reference_server", anonymous=True)
    ReferenceServer(sys.argv[1])
    rospy.spin()
