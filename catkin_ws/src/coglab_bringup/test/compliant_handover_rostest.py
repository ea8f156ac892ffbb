#!/usr/bin/python3
"""A handover with the feedback profile `dmp_compliant`: the end-effector admittance runs during the reach alone."""

import sys
import unittest

import rospy
import rostest
from coglab_bringup.handover import run_handover
from coglab_bringup.trial_recorder import TrialRecorder
from coglab_msgs.msg import FeedbackStatus

ADMITTANCE = "ee_admittance"


class CompliantHandover(unittest.TestCase):
    """One handover for all cases: it runs once, in setUpClass."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("compliant_handover_test")
        cls.activity = []  # (time, profile, activity of the admittance)
        rospy.Subscriber("/controller_manager/feedback/status", FeedbackStatus, cls.on_status, queue_size=100)
        recorder = TrialRecorder()
        cls.row, cls.start, cls.end = run_handover("exchange_human_to_robot", "mug", recorder)
        cls.trial = recorder.stop()

    @classmethod
    def on_status(cls, message):
        activity = {controller.name: controller.activity for controller in message.controllers}
        cls.activity.append((message.header.stamp.to_sec(), message.profile, activity[ADMITTANCE]))

    def test_outcome(self):
        self.assertEqual(self.row["outcome"], "success", self.trial.transitions[-8:])

    def test_the_admittance_ran_during_the_reach_alone(self):
        running = [t for t, profile, activity in self.activity if activity == "running" and profile == "dmp_compliant"]
        self.assertTrue(running, self.activity)
        contact = next(t for t, found, *_ in self.trial.contacts if found and t >= self.start)
        off = [t for t, _, activity in self.activity if t > running[-1] and activity == "off"]
        self.assertTrue(off, self.activity)
        self.assertLess(off[0], contact + 1.5, "the admittance was still at work long after contact was found")


if __name__ == "__main__":
    rostest.rosrun("coglab_bringup", "compliant_handover", CompliantHandover, sys.argv)
