#!/usr/bin/python3
"""The states on actions, services and topics."""

import os
import signal
import subprocess
import sys
import time
import unittest

import rospy
import smach
import smach_ros
from actionlib.msg import TestAction, TestGoal
from actionlib_msgs.msg import GoalStatus

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from reference_server import (
    ABORT,
    DEAF,
    SUCCEED,
    SUCCEED_WHEN_CANCELLED,
    UNTIL_CANCELLED,
    ReferenceServer,
)
from states_support import LIMIT, in_thread, wait_for

HERE = os.path.dirname(os.path.abspath(__file__))


def action_state(goal, name="reference", **kwargs):
    return smach_ros.SimpleActionState(name, TestAction, goal=TestGoal(goal=goal), **kwargs)


class TestActionState(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = ReferenceServer("reference")

    def setUp(self):
        self.server.goals.clear()
        self.ud = smach.UserData()

    def test_succeeded_and_aborted(self):
        self.assertEqual(action_state(SUCCEED).execute(self.ud), "succeeded")
        self.assertEqual(action_state(ABORT).execute(self.ud), "aborted")

    def test_goal_key_slots_and_callback_in_this_order(self):
        self.ud.whole, self.ud.goal = TestGoal(goal=ABORT), SUCCEED
        make = smach_ros.SimpleActionState
        state = make("reference", TestAction, goal=TestGoal(goal=DEAF), goal_key="whole")
        self.assertEqual(state.get_registered_input_keys(), ("whole",))
        self.assertEqual(state.execute(self.ud), "aborted")
        state = make("reference", TestAction, goal_key="whole", goal_slots=["goal"])
        self.assertEqual(state.execute(self.ud), "succeeded")
        self.assertEqual(self.ud.whole.goal, ABORT)

        def goal_cb(ud, goal, more, twice=1):
            return TestGoal(goal=goal.goal + more * twice)

        state = make(
            "reference",
            TestAction,
            goal_slots=["goal"],
            goal_cb=goal_cb,
            goal_cb_args=[1],
            goal_cb_kwargs={"twice": 1},
        )
        self.assertEqual(state.execute(self.ud), "aborted")
        self.assertEqual(self.server.goals, [ABORT, SUCCEED, ABORT])

    def test_goal_cb_in_place_and_raising(self):
        def in_place(ud, goal):
            goal.goal = SUCCEED

        default = TestGoal(goal=ABORT)
        state = smach_ros.SimpleActionState("reference", TestAction, goal=default, goal_cb=in_place)
        self.assertEqual(state.execute(self.ud), "succeeded")
        self.assertEqual(default.goal, ABORT, "the default goal is not shared")
        state = smach_ros.SimpleActionState("reference", TestAction, goal_cb=lambda ud, goal: 1 / 0)
        self.assertEqual(state.execute(self.ud), "aborted")
        state = smach_ros.SimpleActionState("reference", TestAction, goal_slots=["goal"])
        self.assertEqual(state.execute(self.ud), "aborted", "a missing key")
        state = smach_ros.SimpleActionState("reference", TestAction, goal_cb=lambda ud, goal: "text")
        self.assertEqual(state.execute(self.ud), "aborted", "no goal")

    def test_result_key_slots_and_callback(self):
        got = []

        @smach.cb_interface(outcomes=["special"], output_keys=["own"])
        def result_cb(ud, status, result):
            got.append((status, result.result))
            ud.own = 1
            return "special"

        state = action_state(SUCCEED, result_key="whole", result_slots=["result"], result_cb=result_cb)
        self.assertEqual(set(state.get_registered_output_keys()), {"own", "whole", "result"})
        self.assertEqual(state.execute(self.ud), "special")
        self.assertEqual(got, [(GoalStatus.SUCCEEDED, 101)])
        self.assertEqual((self.ud.own, self.ud.whole.result, self.ud.result), (1, 101, 101))

    def test_result_cb_unregistered_raising_and_with_arguments(self):
        self.assertEqual(action_state(SUCCEED, result_cb=lambda *a: "nothing").execute(self.ud), "aborted")
        self.assertEqual(action_state(SUCCEED, result_cb=lambda *a: 1 / 0).execute(self.ud), "aborted")
        got = []
        state = action_state(
            SUCCEED,
            result_cb=lambda ud, s, r, x, y=0: got.append((x, y)),
            result_cb_args=[1],
            result_cb_kwargs={"y": 2},
        )
        self.assertEqual(state.execute(self.ud), "succeeded")
        self.assertEqual(got, [(1, 2)])

    def test_bad_construction(self):
        for wrong in (
            {"goal": lambda: 1},
            {"goal_slots": ["nothing"]},
            {"result_slots": ["nothing"]},
            {"goal_cb": 3},
            {"result_cb": "text"},
        ):
            with self.assertRaises(smach.InvalidStateError):
                smach_ros.SimpleActionState("reference", TestAction, **wrong)

    def test_preempted_right_after_the_goal_was_sent(self):
        for delay in [0.0, 0.0005, 0.002, 0.005, 0.01] * 8:
            state = action_state(UNTIL_CANCELLED)
            run = in_thread(state.execute, self.ud)
            self.assertTrue(wait_for(lambda s=state: s.status == s.ACTIVE))
            time.sleep(delay)
            state.request_preempt()
            run.join(LIMIT)
            self.assertEqual(run.result, "preempted", f"{delay} s after the goal")

    def test_preempted_before_the_start_sends_nothing(self):
        state = action_state(SUCCEED)
        state.request_preempt()
        self.assertEqual(state.execute(self.ud), "preempted")
        self.assertEqual(self.server.goals, [])
        self.assertEqual(state.execute(self.ud), "succeeded")

    def test_cancelled_but_succeeded_does_not_poison_the_next_run(self):
        state = smach_ros.SimpleActionState("reference", TestAction, goal_key="whole")
        self.ud.whole = TestGoal(goal=SUCCEED_WHEN_CANCELLED)
        run = in_thread(state.execute, self.ud)
        self.assertTrue(wait_for(lambda: self.server.goals))
        state.request_preempt()
        run.join(LIMIT)
        self.assertEqual(run.result, "succeeded")
        self.ud.whole = TestGoal(goal=SUCCEED)
        self.assertEqual(state.execute(self.ud), "succeeded")

    def test_cancelled_but_succeeded_the_machine_carries_the_request_on(self):
        machine = smach.StateMachine(["done", "preempted", "aborted"])
        with machine:
            smach.StateMachine.add("ACT", action_state(SUCCEED_WHEN_CANCELLED), {"succeeded": "NEXT"})
            smach.StateMachine.add("NEXT", action_state(UNTIL_CANCELLED), {"succeeded": "done"})
        run = in_thread(machine.execute)
        self.assertTrue(wait_for(lambda: self.server.goals))
        machine.request_preempt()
        run.join(LIMIT)
        self.assertEqual(run.result, "preempted")
        self.assertEqual(self.server.goals, [SUCCEED_WHEN_CANCELLED])

    def test_exec_timeout_cancels_and_aborts(self):
        before = self.server.cancelled
        state = action_state(UNTIL_CANCELLED, exec_timeout=rospy.Duration(3.0))  # the goal has begun by then
        self.assertEqual(state.execute(self.ud), "aborted")
        self.assertEqual(self.server.cancelled, before + 1)
        self.assertFalse(state.preempt_requested())

    def test_preempt_timeout_gives_up(self):
        for how in ("exec_timeout", "request"):
            state = action_state(DEAF, preempt_timeout=0.3, exec_timeout=0.2 if how == "exec_timeout" else None)
            run = in_thread(state.execute, self.ud)
            self.assertTrue(wait_for(lambda: self.server.goals))
            if how == "request":
                state.request_preempt()
            run.join(LIMIT)
            self.assertEqual(run.result, "aborted")
            self.server.release.set()
            self.assertEqual(action_state(SUCCEED).execute(self.ud), "succeeded")
            self.server.release.clear()
            self.server.goals.clear()

    def test_no_server(self):
        state = action_state(SUCCEED, name="nobody", server_wait_timeout=rospy.Duration(0.3))
        self.assertEqual(state.execute(self.ud), "aborted")

    def test_waiting_for_the_server_is_preemptible(self):
        state = action_state(SUCCEED, name="nobody")
        run = in_thread(state.execute, self.ud)
        time.sleep(0.1)
        state.request_preempt()
        run.join(LIMIT)
        self.assertEqual(run.result, "preempted")

    def test_the_server_dies(self):
        process = subprocess.Popen([sys.executable, os.path.join(HERE, "reference_server.py"), "mortal"])
        try:
            state = action_state(UNTIL_CANCELLED, name="mortal")
            run = in_thread(state.execute, self.ud)
            self.assertTrue(wait_for(lambda: state.status == state.ACTIVE))
            time.sleep(0.5)
            process.send_signal(signal.SIGKILL)
            run.join(LIMIT)
            self.assertEqual(run.result, "aborted")
        finally:
            process.kill()
            process.wait()


if __name__ == "__main__":
    import rostest

    rospy.init_node("states_rostest")
    rostest.rosrun("smach_ros", "states", __name__)
