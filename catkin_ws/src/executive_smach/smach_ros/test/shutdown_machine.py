#!/usr/bin/python3
"""A node with one machine of the given kind; prints READY, and at its end OUTCOME and the outcome."""

import sys
import threading
import time

import rospy
import smach
import smach_ros
from actionlib.msg import TestAction, TestGoal
from std_msgs.msg import Empty
from std_srvs.srv import Trigger


class Polls(smach.State):
    """Runs until a request to end; does not check rospy."""

    def __init__(self):
        super().__init__(["done", "preempted"])

    def execute(self, ud):
        while not self.preempt_requested():
            time.sleep(0.01)
        self.service_preempt()
        return "preempted"


def action(name):
    return smach_ros.SimpleActionState(name, TestAction, goal=TestGoal(goal=3))


def monitor():
    return smach_ros.MonitorState("silence", Empty, lambda ud, msg: True)


def concurrence():
    both = smach.Concurrence(["done", "preempted"], "done")
    with both:
        smach.Concurrence.add("MONITOR", monitor())
        smach.Concurrence.add("POLLS", Polls())
    return both


KINDS = {
    "action_without_server": lambda: action("nobody"),
    "action_under_way": lambda: action("reference"),
    "monitor": monitor,
    "condition": lambda: smach_ros.ConditionState(lambda ud: False, max_checks=-1),
    "service": lambda: smach_ros.ServiceState("nobody", Trigger),
    "service_that_hangs": lambda: smach_ros.ServiceState("hangs", Trigger),
    "concurrence": concurrence,
    "handler": Polls,
    "handler_in_main_thread": Polls,
}


def main():
    kind = sys.argv[1]
    rospy.init_node("shutdown_machine", anonymous=True)
    state = KINDS[kind]()
    machine = smach.StateMachine(["end"])
    with machine:
        edges = dict.fromkeys(state.get_registered_outcomes(), "end")
        smach.StateMachine.add("STATE", state, edges)
    server = smach_ros.IntrospectionServer("shutdown", machine, "/SM_ROOT")
    server.start()
    if kind.startswith("handler"):
        smach_ros.set_preempt_handler(machine)
    machine.register_start_cb(lambda *args: threading.Timer(0.5, print, ["READY"], {"flush": True}).start())
    if kind == "handler_in_main_thread":
        print("OUTCOME", machine.execute(), flush=True)
        return
    thread = threading.Thread(target=lambda: print("OUTCOME", machine.execute(), flush=True))
    thread.start()
    rospy.spin()
    thread.join()


if __name__ == "__main__":
    main()
