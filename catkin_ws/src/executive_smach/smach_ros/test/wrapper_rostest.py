#!/usr/bin/python3
"""A machine as an action server."""

import os
import sys
import time
import unittest

import actionlib
import rospy
import smach
import smach_ros
from actionlib.msg import TestAction, TestFeedback, TestGoal, TestResult
from actionlib_msgs.msg import GoalStatus

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from reference_server import ABORT, SUCCEED, UNTIL_CANCELLED
from states_support import LIMIT, wait_for


def action_state(goal, name="reference", **kwargs):
    return smach_ros.SimpleActionState(name, TestAction, goal=TestGoal(goal=goal), **kwargs)


class Work(smach.State):
    """What the wrapped machine does, by the number in the goal."""

    def __init__(self):
        super().__init__(["succeeded", "aborted", "preempted", "other"], ["action_goal"], ["action_result"])
        self.seen = []

    def execute(self, ud):
        goal = ud.action_goal.goal
        self.seen.append((goal, self.preempt_requested()))
        ud.action_result = TestResult(result=goal + 1000)
        while goal == UNTIL_CANCELLED and not self.preempt_requested() and not rospy.is_shutdown():
            time.sleep(0.005)
        if self.preempt_requested():
            self.service_preempt()
            return "preempted"
        if goal == 99:
            raise ValueError("broken state")
        return {SUCCEED: "succeeded", ABORT: "aborted"}.get(goal, "other")


class TestWrapper(unittest.TestCase):
    count = 0

    def serve(self, machine, **kwargs):
        type(self).count += 1
        name = f"wrapped_{self.count}"
        wrapper = smach_ros.ActionServerWrapper(
            name, TestAction, machine, ["succeeded"], ["aborted"], ["preempted"], **kwargs
        )
        wrapper.run_server()
        client = actionlib.SimpleActionClient(name, TestAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(LIMIT)))
        # The client has seen the server, but the server may not know the client yet and would lose messages to it.
        server = wrapper._action_server.action_server
        self.assertTrue(wait_for(lambda: server.feedback_pub.get_num_connections() > 0))
        self.assertTrue(wait_for(lambda: server.result_pub.get_num_connections() > 0))
        return client

    def machine(self, state=None):
        machine = smach.StateMachine(["succeeded", "aborted", "preempted", "other"], ["action_goal"], ["action_result"])
        with machine:
            smach.StateMachine.add("WORK", state or Work())
        return machine

    def send(self, client, goal, **kwargs):
        client.send_goal(TestGoal(goal=goal), **kwargs)
        self.assertTrue(client.wait_for_result(rospy.Duration(LIMIT)))
        return client.get_state(), client.get_result().result if client.get_result() else None

    def test_wrapper_outcomes(self):
        client = self.serve(self.machine())
        self.assertEqual(self.send(client, SUCCEED), (GoalStatus.SUCCEEDED, 1000 + SUCCEED))
        self.assertEqual(self.send(client, ABORT), (GoalStatus.ABORTED, 1000 + ABORT))
        self.assertEqual(self.send(client, 50), (GoalStatus.ABORTED, 1050), "in none of the lists")
        self.assertEqual(self.send(client, 99)[0], GoalStatus.ABORTED, "an error")
        self.assertEqual(self.send(client, SUCCEED)[0], GoalStatus.SUCCEEDED, "works after an error")

    def test_wrapper_cancel_and_nothing_left_over(self):
        state = Work()
        client = self.serve(self.machine(state))
        for _ in range(5):
            client.send_goal(TestGoal(goal=UNTIL_CANCELLED))
            before = len(state.seen)
            self.assertTrue(wait_for(lambda before=before: len(state.seen) > before or rospy.is_shutdown()))
            # actionlib takes a goal for lost if an older status arrives after the cancel.
            self.assertTrue(wait_for(lambda: client.get_state() == GoalStatus.ACTIVE))
            client.cancel_goal()
            self.assertTrue(client.wait_for_result(rospy.Duration(LIMIT)))
            self.assertEqual(client.get_state(), GoalStatus.PREEMPTED)
            self.assertEqual(self.send(client, SUCCEED)[0], GoalStatus.SUCCEEDED)
        self.assertFalse(any(asked for goal, asked in state.seen if goal == SUCCEED))

    def test_wrapper_a_new_goal_preempts_the_old(self):
        state = Work()
        client = self.serve(self.machine(state))
        client.send_goal(TestGoal(goal=UNTIL_CANCELLED))
        self.assertTrue(wait_for(lambda: state.seen))
        self.assertEqual(self.send(client, SUCCEED)[0], GoalStatus.SUCCEEDED)

    def test_wrapper_slots_and_feedback(self):
        machine = smach.StateMachine(["succeeded", "aborted", "preempted"], ["n"], ["m", "result"])
        got = []

        # Feedback and result have separate topics, and a client ignores feedback after its result.
        def heard(ud):
            wait_for(lambda: got)
            return "succeeded"

        @smach.cb_interface(outcomes=["ok"], input_keys=["n"], output_keys=["action_feedback", "m"])
        def first(ud):
            ud.action_feedback = TestFeedback(feedback=ud.n + 1)
            ud.m = ud.n * 2
            return "ok"

        with machine:
            smach.StateMachine.add("A", smach.CBState(first), {"ok": "B"})
            smach.StateMachine.add("B", smach.CBState(heard, outcomes=["succeeded"]))
        client = self.serve(machine, goal_slots_map={"goal": "n"}, result_slots_map={"result": "m"})
        state = self.send(client, 21, feedback_cb=lambda feedback: got.append(feedback.feedback))
        self.assertEqual(state, (GoalStatus.SUCCEEDED, 42))
        self.assertTrue(wait_for(lambda: got == [22]))

    def test_wrapper_expand_and_pack(self):
        machine = smach.StateMachine(["succeeded", "aborted", "preempted"], ["goal"], ["result"])

        @smach.cb_interface(outcomes=["succeeded"], input_keys=["goal"], output_keys=["result"])
        def work(ud):
            ud.result = ud.goal + 5
            return "succeeded"

        with machine:
            smach.StateMachine.add("A", smach.CBState(work))
        client = self.serve(machine, expand_goal_slots=True, pack_result_slots=True)
        self.assertEqual(self.send(client, 1), (GoalStatus.SUCCEEDED, 6))

    def test_wrapper_a_fresh_result_is_there_to_be_filled_in(self):
        """As in machines of other authors: the result is an input and an output key."""

        def fill(ud):
            seen.append(ud.action_result.result)
            ud.action_result.result += ud.action_goal.goal + 40
            return "succeeded"

        seen = []
        machine = smach.StateMachine(["succeeded"], ["action_goal", "action_result"], ["action_result"])
        with machine:
            keys = {"input_keys": ["action_goal"], "io_keys": ["action_result"]}
            smach.StateMachine.add("FILL", smach.CBState(fill, outcomes=["succeeded"], **keys))
        client = self.serve(machine)
        for goal in (1, 2):
            self.assertEqual(self.send(client, goal), (GoalStatus.SUCCEEDED, 40 + goal))
        self.assertEqual(seen, [0, 0], "no goal sees the result of another")

    def test_wrapper_bad_slots(self):
        with self.assertRaises(smach.InvalidStateError):
            smach_ros.ActionServerWrapper("x", TestAction, self.machine(), goal_slots_map={"nothing": "n"})


if __name__ == "__main__":
    import rostest

    rospy.init_node("wrapper_rostest")
    rostest.rosrun("smach_ros", "wrapper", __name__)
