#!/usr/bin/python3
"""The states on services, topics and conditions."""

import os
import sys
import time
import unittest

import rospy
import smach
import smach_ros
from std_msgs.msg import Bool, Empty
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse, Trigger

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from states_support import LIMIT, in_thread


class TestService(unittest.TestCase):
    def setUp(self):
        self.ud = smach.UserData()
        self.asked = []
        self.service = rospy.Service("set", SetBool, self._serve)

    def tearDown(self):
        self.service.shutdown()
        rospy.sleep(0.05)

    def _serve(self, request):
        self.asked.append(request.data)
        return SetBoolResponse(success=request.data, message="text") if request.data else None

    def test_request_in_its_three_ways(self):
        self.ud.whole, self.ud.data = SetBoolRequest(data=False), True
        make = smach_ros.ServiceState
        state = make("set", SetBool, request=SetBoolRequest(data=True))
        self.assertEqual(state.get_registered_outcomes(), ("succeeded", "aborted", "preempted"))
        self.assertEqual(state.execute(self.ud), "succeeded")
        state = make("set", SetBool, request_key="whole", request_slots=["data"])
        self.assertEqual(set(state.get_registered_input_keys()), {"whole", "data"})
        self.assertEqual(state.execute(self.ud), "succeeded")
        state = make(
            "set",
            SetBool,
            request_cb=lambda ud, r, x, y=0: SetBoolRequest(data=bool(x and y)),
            request_cb_args=[1],
            request_cb_kwargs={"y": 1},
        )
        self.assertEqual(state.execute(self.ud), "succeeded")
        self.assertEqual(self.asked, [True] * 3)

    def test_aborted_by_service_key_or_callback(self):
        make = smach_ros.ServiceState
        self.assertEqual(make("set", SetBool).execute(self.ud), "aborted", "the service fails")
        self.assertEqual(make("set", SetBool, request_key="absent").execute(self.ud), "aborted")
        self.assertEqual(make("set", SetBool, request_cb=lambda ud, r: 1 / 0).execute(self.ud), "aborted")

    def test_response(self):
        @smach.cb_interface(outcomes=["special"], output_keys=["own"])
        def response_cb(ud, response):
            ud.own = response.message
            return "special"

        true = SetBoolRequest(data=True)
        state = smach_ros.ServiceState(
            "set",
            SetBool,
            true,
            response_cb=response_cb,
            response_key="whole",
            response_slots=["success"],
        )
        self.assertEqual(set(state.get_registered_output_keys()), {"own", "whole", "success"})
        self.assertEqual(state.execute(self.ud), "special")
        self.assertEqual((self.ud.own, self.ud.whole.message, self.ud.success), ("text", "text", True))
        for bad in (lambda ud, r: "nothing", lambda ud, r: 1 / 0):
            self.assertEqual(
                smach_ros.ServiceState("set", SetBool, true, response_cb=bad).execute(self.ud),
                "aborted",
            )

    def test_preempted_before_and_while_waiting_for_the_service(self):
        state = smach_ros.ServiceState("nobody", Trigger)
        state.request_preempt()
        self.assertEqual(state.execute(self.ud), "preempted")
        run = in_thread(state.execute, self.ud)
        time.sleep(0.2)
        state.request_preempt()
        run.join(LIMIT)
        self.assertEqual(run.result, "preempted")


class TestTopic(unittest.TestCase):
    def setUp(self):
        self.ud = smach.UserData()
        self.pub = rospy.Publisher("flag", Bool, queue_size=10)
        self.sending = True
        self.value = True
        self.thread = in_thread(self._send)

    def tearDown(self):
        self.sending = False
        self.thread.join(LIMIT)

    def _send(self):
        while self.sending:
            self.pub.publish(self.value)
            time.sleep(0.02)

    def test_monitor_valid_after_max_checks(self):
        count = []
        state = smach_ros.MonitorState("flag", Bool, lambda ud, msg: count.append(1) or msg.data, max_checks=3)
        self.assertEqual(state.get_registered_outcomes(), ("valid", "invalid", "preempted"))
        self.assertEqual(state.execute(self.ud), "valid")
        self.assertEqual(len(count), 3)
        self.assertEqual(state.execute(self.ud), "valid", "again")

    def test_monitor_invalid_by_false_and_by_an_error(self):
        state = smach_ros.MonitorState("flag", Bool, lambda ud, msg: msg.data)
        run = in_thread(state.execute, self.ud)
        time.sleep(0.3)
        self.assertTrue(run.is_alive(), "-1: only false ends it")
        self.value = False
        run.join(LIMIT)
        self.assertEqual(run.result, "invalid")
        self.assertEqual(smach_ros.MonitorState("flag", Bool, lambda ud, msg: 1 / 0).execute(self.ud), "invalid")

    def test_a_monitor_without_messages_is_woken_by_a_request(self):
        state = smach_ros.MonitorState("silence", Empty, lambda ud, msg: True)
        run = in_thread(state.execute, self.ud)
        time.sleep(0.1)
        asked = time.monotonic()
        state.request_preempt()
        run.join(LIMIT)
        self.assertEqual(run.result, "preempted")
        self.assertLess(time.monotonic() - asked, LIMIT)
        self.assertFalse(state.preempt_requested())


class TestCondition(unittest.TestCase):
    def run_state(self, cond, **kwargs):
        return smach_ros.ConditionState(cond, poll_rate=rospy.Duration(0.01), **kwargs).execute(smach.UserData())

    def test_condition_max_checks_allows_one_more(self):
        for checks, calls in ((1, 2), (3, 4)):
            count = []
            self.assertEqual(self.run_state(lambda ud, c=count: c.append(1), max_checks=checks), "false")
            self.assertEqual(len(count), calls)

    def test_condition_unlimited_with_timeout(self):
        count = []
        outcome = self.run_state(lambda ud: count.append(1), max_checks=-1, timeout=rospy.Duration(3.0))
        self.assertEqual(outcome, "false")
        self.assertGreater(len(count), 3)

    def test_condition_preempted(self):
        state = smach_ros.ConditionState(lambda ud: False, max_checks=-1, poll_rate=rospy.Duration(60))
        run = in_thread(state.execute, smach.UserData())
        time.sleep(0.1)
        state.request_preempt()
        run.join(LIMIT)
        self.assertEqual(run.result, "preempted")
        self.assertFalse(state.preempt_requested())

    def test_condition_that_raises(self):
        with self.assertRaises(smach.InvalidUserCodeError):
            self.run_state(lambda ud: 1 / 0)


if __name__ == "__main__":
    import rostest

    rospy.init_node("state_messages_rostest")
    rostest.rosrun("smach_ros", "state_messages", __name__)
