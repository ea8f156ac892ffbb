#!/usr/bin/python3
"""The contracts of the ports on the real adapters. The suites of different nodes run side by side, to be quick."""

import os
import signal
import sys
import threading
import time
import traceback
import unittest
import xmlrpc.client
from contextlib import nullcontext
from pathlib import Path

import rosgraph
import rospkg
import rospy
import rostest
from coglab_msgs.msg import HandoverBelief, Recognition
from coglab_msgs.srv import SetSpeedScale
from coglab_smach.ros.arm import RosArm
from coglab_smach.ros.hand import RosHand
from coglab_smach.ros.ports import RosContact, RosDatabase, RosPerception
from geometry_msgs.msg import Vector3, Wrench

sys.path.insert(0, str(Path(__file__).resolve().parent))
from port_contracts import SUITES, Place

LIMIT = 500.0
"""s, of the whole"""
PATIENCE = 20.0
NODES = {
    "arm": "/robot",
    "hand": "/ih2_hand",
    "perception": "/perception",
    "database": "/object_database",
    "contact": "/contact_detector",
}
PORTS = {"arm": RosArm, "hand": RosHand, "perception": RosPerception, "database": RosDatabase, "contact": RosContact}


def pid_of(node):
    """Process id of a node."""
    api = rosgraph.Master("/port_contracts").lookupNode(node)
    return xmlrpc.client.ServerProxy(api).getPid("/port_contracts")[2]


class Recogniser:
    """Tells of a belief in an offer, as the node that recognises intentions does, while it believes in one: with each
    sight of the hand."""

    def __init__(self):
        self.offer, self.frozen, self.sees = 0.0, False, True
        self.publisher = rospy.Publisher("perception/belief", HandoverBelief, queue_size=1)
        self.patterns = rospy.Publisher("perception/recognition", Recognition, queue_size=1)
        rospy.Timer(rospy.Duration(0.05), self.tell)

    def believe(self, offer):
        self.offer = offer

    def show_hand(self, seen):
        self.sees = seen

    def tell(self, _event):
        if self.offer > 0.0 and self.sees and not self.frozen:
            self.patterns.publish(Recognition(pattern="mug", confidence=0.9, decided=True))
            message = HandoverBelief(offer=self.offer, hand="human_hand", object_id="mug")
            message.place_covariance[0] = -1.0
            message.header.stamp = rospy.Time.now()
            self.publisher.publish(message)


def place_of(name, arm_may_freeze, arm_is_used, recogniser):
    """The real port; the arm's node is frozen only when nobody else needs it, and moves only when nobody else wants it
    to rest."""
    pid = pid_of(NODES[name])

    def freeze():
        if name == "arm":
            assert arm_may_freeze.wait(LIMIT)
        os.kill(pid, signal.SIGSTOP)
        recogniser.frozen = recogniser.frozen or name == "perception"

    def thaw():
        os.kill(pid, signal.SIGCONT)
        recogniser.frozen = recogniser.frozen and name != "perception"

    library = rospkg.RosPack().get_path("coglab_controllers") + "/config/primitives.xml"
    publisher = rospy.Publisher("/coglab_sim/cell/push", Wrench, queue_size=1, latch=True)
    push = lambda force: publisher.publish(Wrench(force=Vector3(0.0, 0.0, force)))  # noqa: E731
    arm = RosArm() if name == "contact" else None
    clock = time.monotonic, time.sleep
    person = recogniser.believe, recogniser.show_hand
    scale = rospy.ServiceProxy("/controller_manager/speed_scale", SetSpeedScale)
    return Place(PORTS[name](), *clock, freeze, thaw, library, push, arm_is_used, arm, *person, PATIENCE, scale)


class PortContracts(unittest.TestCase):
    """One test per port."""

    @classmethod
    def setUpClass(cls):
        cls.failures = {name: [] for name in SUITES}
        cls.ran = dict.fromkeys(SUITES, 0)
        cls.arm_may_freeze = threading.Event()
        cls.arm_is_used = threading.Lock()
        cls.recogniser = Recogniser()
        waits = (
            "/lwr/command",
            "/controller_manager/list_controllers",
            "/perception/locate_object",
            "/object_database/get_object",
            "/contact_detector/arm",
        )
        for service in waits:
            rospy.wait_for_service(service, 60.0)
        cls.threads = {name: threading.Thread(target=cls.run_suite, args=(name,), daemon=True) for name in SUITES}
        for thread in cls.threads.values():
            thread.start()

    @classmethod
    def run_suite(cls, name):
        try:
            contract = SUITES[name](place_of(name, cls.arm_may_freeze, cls.arm_is_used, cls.recogniser))
            moves = cls.arm_is_used if name == "arm" else nullcontext()
            for test in [t for t in vars(SUITES[name]) if t.startswith("test_")]:
                cls.ran[name] += 1
                begun = time.monotonic()
                try:
                    # The arm's own suite waits for the others before it freezes the arm, without keeping them out.
                    with nullcontext() if "frozen" in test else moves:
                        contract.begin()
                        getattr(contract, test)()
                except Exception:
                    cls.failures[name].append(f"{test}:\n{traceback.format_exc()}")
                time.sleep(0.05)  # for who waits for the arm to rest
                print(f"{name}: {test}: {time.monotonic() - begun:.1f} s", flush=True)
        except Exception:
            cls.failures[name].append(traceback.format_exc())
        finally:
            if name == "contact":
                cls.arm_may_freeze.set()

    def judge(self, name):
        self.threads[name].join(LIMIT)
        self.assertFalse(self.threads[name].is_alive(), f"the suite of the {name} hangs")
        self.assertFalse(self.failures[name], "\n".join(self.failures[name]))
        self.assertGreater(self.ran[name], 2)


for port in SUITES:
    setattr(PortContracts, f"test_{port}", lambda self, port=port: self.judge(port))

if __name__ == "__main__":
    rospy.init_node("port_contracts")
    rostest.rosrun("coglab_smach", "port_contracts", PortContracts, sys.argv)
