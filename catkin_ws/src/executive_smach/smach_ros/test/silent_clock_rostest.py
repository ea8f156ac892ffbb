#!/usr/bin/python3
"""Time limits and heartbeats while simulated time stands still."""

import time
import unittest

import rospy
import smach
import smach_ros
from actionlib.msg import TestAction, TestGoal
from actionlib_msgs.msg import GoalStatusArray
from rosgraph_msgs.msg import Clock
from smach_msgs.msg import SmachContainerStatus
from smach_ros.introspection import STATUS_TOPIC


class TestSilentClock(unittest.TestCase):
    def test_time_limits_run_on(self):
        self.assertFalse(rospy.rostime.is_wallclock())
        state = smach_ros.SimpleActionState("nobody", TestAction, goal=TestGoal(), server_wait_timeout=0.5)
        self.assertEqual(state.execute(smach.UserData()), "aborted")
        state = smach_ros.ConditionState(lambda ud: False, timeout=rospy.Duration(0.5), max_checks=-1)
        self.assertEqual(state.execute(smach.UserData()), "false")

    def test_heartbeats_go_on(self):
        machine = smach.StateMachine(["done"])
        with machine:
            smach.StateMachine.add("A", smach.CBState(lambda ud: "done", outcomes=["done"]))
        got = []
        sub = rospy.Subscriber("/silent" + STATUS_TOPIC, SmachContainerStatus, got.append)
        server = smach_ros.IntrospectionServer("/silent", machine, "/SM_ROOT")
        server.start()
        end = time.monotonic() + 60
        while sum(m.info == "HEARTBEAT" for m in got) < 2 and time.monotonic() < end:
            time.sleep(0.05)
        server.stop()
        sub.unregister()
        self.assertGreaterEqual(sum(m.info == "HEARTBEAT" for m in got), 2)

    def clock(self):
        pub = rospy.Publisher("/clock", Clock, queue_size=10)
        end = time.monotonic() + 60
        while pub.get_num_connections() == 0 and time.monotonic() < end:
            time.sleep(0.01)
        return pub

    def test_an_action_outlives_a_clock_that_goes_back(self):
        pub = self.clock()
        machine = smach.StateMachine(["done"], ["action_goal"])
        with machine:
            smach.StateMachine.add("A", smach.CBState(lambda ud: "done", outcomes=["done"]))
        smach_ros.ActionServerWrapper("work", TestAction, machine, ["done"]).run_server()
        for second in (100, 101, 70, 70.1, 70.5):
            pub.publish(rospy.Time(second))
            time.sleep(0.3)
        got = []
        sub = rospy.Subscriber("work/status", GoalStatusArray, got.append)
        end = time.monotonic() + 60
        while len(got) < 3 and time.monotonic() < end:
            time.sleep(0.05)
        sub.unregister()
        self.assertGreaterEqual(len(got), 3)


if __name__ == "__main__":
    import rostest

    rospy.init_node("silent_clock_rostest")
    rostest.rosrun("smach_ros", "silent_clock", __name__)
