#!/usr/bin/python3
"""The hand works by the steady clock: before /clock runs, while it stands still, and after it went back."""

from __future__ import annotations

import sys
import time
import unittest

import rospy
import rostest
from actionlib_msgs.msg import GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from hand_client import HandClient
from rosgraph_msgs.msg import Clock


class HandClock(unittest.TestCase):
    def test_goals_end_well_whatever_the_clock_does(self) -> None:
        self.assertFalse(rospy.rostime.is_wallclock())
        hand, faults, listed = HandClient(), [], []
        rospy.Subscriber("/diagnostics", DiagnosticArray, lambda array: faults.extend(array.status))
        rospy.Subscriber("ih2_hand/hand_open/status", GoalStatusArray, listed.append)
        clock = rospy.Publisher("/clock", Clock, queue_size=10)
        hand.wait_ready()
        for times in ((), (100.0, 100.1), (70.0, 70.1), (500.0,)):
            for each in times:
                clock.publish(rospy.Time.from_sec(each))
                time.sleep(0.2)
            for name, arguments in (("hand_preshape", ("cylindrical", "low")), ("hand_open", (511,))):
                result = hand.run(name, *arguments)
                self.assertTrue(result.isOk, f"{name} after {times}: {result.message}")
        hand.wait(lambda: any("/clock" in fault.message for fault in faults), "the silent /clock on /diagnostics")
        for topic in (listed, hand.statuses):
            count = len(topic)
            hand.wait(lambda topic=topic, count=count: len(topic) > count + 2, "a node that still speaks")
        fingers = hand.fingers
        hand.wait(lambda: hand.fingers is not fingers, "finger_positions")


if __name__ == "__main__":
    rospy.init_node("hand_clock_rostest")
    rostest.rosrun("ih2_hand", "hand_clock", HandClock, sys.argv)
