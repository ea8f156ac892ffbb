#!/usr/bin/python3
"""The ROS ports with real nodes: requests, refusals, reports, and frozen nodes."""

import os
import signal
import sys
import time
import unittest
import xmlrpc.client
from contextlib import contextmanager
from functools import wraps

import numpy as np
import rosgraph
import rospy
import rostest
from coglab_msgs.msg import ContactSignal, ControllerStatus, HandoverBelief, LwrState, ReasonCode, Recognition
from coglab_py.packages import package_path
from coglab_smach.ports.interfaces import Ahead, DmpRequest
from coglab_smach.ports.interfaces import Recognition as Recognised
from coglab_smach.ports.pending import PortError
from coglab_smach.ros.arm import RosArm
from coglab_smach.ros.hand import RosHand
from coglab_smach.ros.ports import RosContact, RosDatabase, RosPerception
from geometry_msgs.msg import Vector3, Wrench

sys.path.insert(0, str(package_path("coglab_controllers", "test")))
from lateness import LATE, say_again

CROWD = 4.0  # processes per core; with more the detector, which follows the torques, is late without a word
PATIENCE = 20.0  # factor on all time limits, for a busy computer
LIBRARY = str(package_path("coglab_controllers", "config", "primitives.xml"))
REACH = DmpRequest("take_board", "board", [0.0, -0.25, 0.45], dmp_ratio=4.0)


def until(condition, limit=5.0, what="it"):
    end = time.monotonic() + limit * PATIENCE
    while not condition():
        assert time.monotonic() < end, f"{what() if callable(what) else what} did not happen"
        time.sleep(0.01)


def known(ask, what):
    """The value of `ask()`, after it has one: none is known while a node, or this test, is late."""
    found = [None]

    def ready():
        found[0] = ask()
        return found[0] is not None and len(found[0]) > 0

    until(ready, what=what)
    return found[0]


def stays(condition, duration):
    end = time.monotonic() + duration
    while time.monotonic() < end:
        assert condition()
        time.sleep(0.01)


def settle(pending, limit=5.0):
    """The value of a call; fails after ``limit`` s."""
    until(pending.done, limit, "the answer")
    return pending.result()


def answered(ask):
    """The value of a call. Calls again if it fails, because a busy computer may see too late."""
    end = time.monotonic() + 5.0 * PATIENCE
    while True:
        try:
            return settle(ask())
        except PortError:
            if time.monotonic() > end:
                raise


def refused(pending, code):
    """The error of a call that must fail with this code."""
    try:
        value = settle(pending)
    except PortError as error:
        assert error.sentence and error.code == code, f"code {error.code}, expected {code}: {error.sentence}"
        return error
    raise AssertionError(f"it succeeded with {value!r}")


def cut_short(begin, act, code):
    """`act()` ends the call of `begin()` with this code. Again if a late computer acts after the call's own end."""
    for left in (4, 3, 2, 1, 0):
        pending = begin()
        act(pending)
        try:
            value = settle(pending)
        except PortError as error:
            assert error.code == code, f"code {error.code}, expected {code}: {error.sentence}"
            return
        assert left, f"it succeeded with {value!r}"
        say_again("a call that is cut short", "it had ended before")


@contextmanager
def frozen(node):
    """Inside the block, the process of this node is stopped."""
    api = rosgraph.Master("/port_contracts").lookupNode(node)
    pid = xmlrpc.client.ServerProxy(api).getPid("/port_contracts")[2]
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def again_if_late(test):
    """A test that is repeated if it fails and a late computer has ended a motion, or a node was late to answer, or
    more than CROWD processes per core want to run."""

    @wraps(test)
    def run(self):
        for left in (2, 1, 0):
            self.reasons.clear()
            try:
                return test(self)
            except (AssertionError, PortError) as error:
                time.sleep(0.5)  # the reason may be on its way
                late = getattr(error, "code", 0) in LATE or LATE & set(self.reasons)
                late = late or os.getloadavg()[0] > CROWD * os.cpu_count()
                if not left or not late:
                    raise
                say_again(test.__name__, error)
                self.tearDown()
                self.setUp()

    return run


class WithArm(unittest.TestCase):
    """A RosArm that may move, with its controllers loaded. Only push() touches the hand."""

    arm = None
    reasons = []  # ReasonCodes of the arm and its controllers

    @classmethod
    def setUpClass(cls):
        for service in ("/lwr/command", "/controller_manager/list_controllers", "/contact_detector/arm"):
            rospy.wait_for_service(service, 60.0)
        pushes = rospy.Publisher("/coglab_sim/cell/push", Wrench, queue_size=1, latch=True)
        cls.push = staticmethod(lambda force: pushes.publish(Wrench(force=Vector3(0.0, 0.0, force))))
        if WithArm.arm is not None:
            return
        for topic, kind in (("/lwr/state", LwrState), ("/controller_manager/status", ControllerStatus)):
            rospy.Subscriber(topic, kind, lambda message: cls.reasons.append(message.reason_code))
        arm = WithArm.arm = RosArm()
        until(lambda: arm.standing().ok, 10.0, "the arm at rest")
        refused(arm.switch_controller("ptp"), ReasonCode.UNKNOWN_NAME)
        for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
            settle(arm.load_controller(name, kind), 20.0)
        assert settle(arm.load_dmps(LIBRARY)) >= 5
        settle(arm.lwr_command("position"))

    def setUp(self):
        self.push(0.0)
        until(self.may_move, 10.0, "command mode")
        self.ready("ptp")

    def may_move(self):
        """True if the arm may move. Otherwise asks for command mode; on a busy computer the first time may fail."""
        if self.arm.motion_allowed().ok:
            return True
        start = self.arm.lwr_command("start")
        until(start.done, 20.0, "the answer")
        return False

    def ready(self, controller):
        settle(self.arm.switch_controller(controller))
        until(lambda: self.arm.standing().ok, 3.0, "rest")

    def joints(self):
        """The joint angles, rad."""
        return np.array(known(self.arm.joint_positions, "the joint angles"))

    def start_ptp(self, by=0.4):
        """A slow motion of the last joint that has begun, and its target."""
        target = list(self.joints())
        target[6] += by if target[6] < 0.5 else -by
        motion = self.arm.move_ptp(target, [0.1] * 7)
        until(lambda: not self.arm.standing().ok, 2.0, "the motion")
        return motion, target


class Motions(WithArm):
    """RosArm."""

    def stands_before(self, target):
        until(lambda: self.arm.standing().ok, 2.0, "rest")
        time.sleep(0.1)
        place = self.joints()
        assert np.max(np.abs(place - target)) > 0.02, "it went to its target"
        time.sleep(0.3)
        assert np.max(np.abs(place - self.joints())) < 0.01, "it moved on"

    @again_if_late
    def test_a_motion_is_executed_to_its_end(self):
        motion, target = self.start_ptp(0.1)
        assert not motion.done() and settle(motion) is None
        assert np.max(np.abs(self.joints() - target)) < 0.03

    @again_if_late
    def test_cancelling_ends_motions_that_run_and_wait(self):
        _, target = self.start_ptp()
        queued = self.arm.move_ptp(target, [])
        time.sleep(0.5)  # until it is queued
        settle(self.arm.cancel_motion("the test"), 2.5)
        assert self.arm.standing().ok, "cancel is answered when the arm stands"
        refused(queued, ReasonCode.CANCELLED)
        self.stands_before(target)
        settle(self.arm.cancel_motion("the test"), 2.5)  # succeeds without a motion too

    @again_if_late
    def test_cancel_of_the_handle_and_a_switch_end_a_motion(self):
        motion, target = self.start_ptp()
        motion.cancel()
        refused(motion, ReasonCode.CANCELLED)
        self.stands_before(target)
        motion, target = self.start_ptp()
        assert settle(self.arm.switch_controller("dmp")) == "coglab/DmpController"
        refused(motion, ReasonCode.SWITCHED)
        self.stands_before(target)

    @again_if_late
    def test_a_hold_ends_the_motion_and_latches(self):
        motion, target = self.start_ptp()
        settle(self.arm.hold("the test"))
        until(lambda: self.arm.motion_allowed().code == ReasonCode.HELD, 1.0, "the hold")
        refused(self.arm.lwr_command("start"), ReasonCode.HELD)
        until(motion.done)
        self.stands_before(target)
        settle(self.arm.lwr_command("reset"))
        until(lambda: self.arm.motion_allowed().ok, 2.0, "the end of the hold")
        stays(lambda: self.arm.standing().ok, 0.2)

    @again_if_late
    def test_a_reach_reports_progress_changes_its_primitive_and_is_cancelled(self):
        self.ready("dmp")
        refused(self.arm.execute_dmp(DmpRequest("to_the_moon", "board", REACH.goal_offset)), ReasonCode.UNKNOWN_NAME)
        refused(self.arm.switch_dmp(REACH), ReasonCode.NOTHING_RUNS)
        settle(self.arm.execute_dmp(REACH))
        progress = self.arm.dmp_progress
        until(lambda: progress().primitive_id == "take_board" and progress().phase < 0.95, 3.0, "news of the motion")
        assert progress().state == "running" and progress().remaining_distance > 0.05
        before = progress().phase
        settle(self.arm.switch_dmp(DmpRequest("put_board", "", REACH.goal_offset, dmp_ratio=4.0)))
        until(lambda: progress().primitive_id == "put_board", 1.0, "news of the other primitive")
        assert progress().state == "running" and progress().phase <= before
        settle(self.arm.cancel_motion("the test"), 2.5)
        until(lambda: progress().state == "aborted", 1.0, "news of the end")
        assert progress().code == ReasonCode.CANCELLED

    @again_if_late
    def test_feedback_profiles_are_applied_and_a_controller_brings_its_own(self):
        self.ready("dmp")
        until(lambda: self.arm.profile_settled("dmp").ok, 3.0, "the controller's own profile")
        settle(self.arm.apply_profile("dmp_compliant"))
        until(lambda: self.arm.profile_settled("dmp_compliant").ok, 3.0, "the profile")
        refused(self.arm.apply_profile("nobody"), ReasonCode.UNKNOWN_NAME)
        assert not self.arm.profile_settled("dmp").ok

    def test_requests_cancelled_while_the_node_is_frozen_never_act(self):
        before = self.joints()
        with frozen("/robot"):
            motion = self.arm.move_ptp([*before[:6], 0.0], [])
            until(lambda: self.arm.joint_positions() is None, 2.0, "silence")
            until(lambda: self.arm.motion_allowed().code == ReasonCode.NODE_SILENT, 2.0, "silence")
            assert not self.arm.standing().ok
            motion.cancel()
        until(lambda: self.arm.joint_positions() is not None, 5.0, "the node's return")
        self.setUp()
        stays(lambda: np.max(np.abs(before - self.joints())) < 0.05, 0.6)


class Contact(WithArm):
    """RosContact, before the first motion of the arm."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.contact = RosContact()
        cls.signal = ContactSignal()
        rospy.Subscriber("/contact_detector/signal", ContactSignal, lambda message: setattr(cls, "signal", message))

    def tearDown(self):
        self.push(0.0)
        self.contact.disarm()
        time.sleep(1.0)  # s at rest for the detector, while nobody touches the arm

    def watch(self, mode, **settings):
        """Arm the detector and wait until it has enough samples of the arm at rest."""
        settle(self.contact.arm(mode, 600.0, settings))
        until(lambda: (self.signal.state, self.signal.mode) == ("watching", mode), 3.0, "watching")
        assert self.contact.event() is None, self.contact.event()

    def happens(self, contact, code):
        until(lambda: self.contact.event() is not None, 2.0, "the event")
        event = self.contact.event()
        assert (event.contact, event.code) == (contact, code), event
        assert event.margin >= 1.0 and 0.5 <= event.confidence <= 1.0 and event.source, event

    @again_if_late
    def test_touch_weight_and_release_are_each_detected_once(self):
        refused(self.contact.arm("juggle", 1.0, {}), ReasonCode.INVALID_ARGUMENT)
        self.watch("contact", k=20.0)
        self.push(-8.0)
        self.happens(True, ReasonCode.CONTACT_FOUND)
        self.push(0.0)
        stays(lambda: self.contact.event().code == ReasonCode.CONTACT_FOUND, 0.3)
        self.watch("load", mass=0.8, load_share=0.5)
        self.push(-8.0)
        self.happens(True, ReasonCode.LOAD_CARRIED)
        assert self.contact.share_gone() is None and self.contact.grip() is None, "this hand has no force sensors"
        self.watch("release", mass=0.8, load_share=0.5)
        until(lambda: abs(self.contact.share_gone() or 0.0) < 0.1, 1.0, "the whole load")
        self.push(0.0)
        self.happens(False, ReasonCode.LOAD_RELEASED)
        until(lambda: self.contact.share_gone() > 0.7, 2.0, "the load")
        self.contact.disarm()
        assert self.contact.share_gone() is None

    @again_if_late
    def test_a_disarmed_detector_is_silent_and_a_frozen_one_does_not_answer(self):
        with frozen("/contact_detector"):
            armed = self.contact.arm("contact", 1.0, {})
            time.sleep(0.4)
            assert not armed.done()
            armed.cancel()
        self.watch("contact", k=20.0)
        self.contact.disarm()
        self.push(-8.0)
        stays(lambda: self.contact.event() is None, 0.5)

    @again_if_late
    def test_touch_is_detected_while_the_arm_moves(self):
        self.start_ptp(0.8)
        time.sleep(0.3)
        settle(self.contact.arm("contact_in_motion", 600.0, {}))
        stays(lambda: self.contact.event() is None, 0.7)
        forces = []

        def felt():
            forces.append((self.contact.force() or (0.0, 0.0, 0.0))[2])
            return min(forces) < -5.0 and self.contact.event() is not None

        self.push(-15.0)
        until(felt, 2.0, lambda: f"the force, {min(forces)} N so far, or the event {self.contact.event()}")
        self.happens(True, ReasonCode.CONTACT_FOUND)
        settle(self.arm.cancel_motion("the test"), 4.0)


class Hand(unittest.TestCase):
    """RosHand. The hand is empty and has just started."""

    def test_hand(self):
        hand = RosHand()
        until(lambda: hand.state().connected, 15.0, "the hand")
        if not hand.state().calibrated:
            refused(hand.preshape("cylindrical", "medium"), ReasonCode.HAND_NOT_CALIBRATED)
            settle(hand.calibrate("fast"), 12.0)
        until(lambda: hand.state().calibrated and not hand.state().holding, 5.0, "the calibrated, empty hand")
        refused(hand.calibrate("fast"), ReasonCode.HAND_REFUSED)
        refused(hand.preshape("fist", "medium"), ReasonCode.UNKNOWN_NAME)
        refused(hand.open(9999), ReasonCode.OUT_OF_RANGE)
        finger = lambda: known(lambda: hand.state().positions, "the fingers")[2]  # noqa: E731

        settle(hand.preshape("cylindrical", "medium"), 8.0)

        def loosens():
            settle(hand.close_on_object(), 8.0)
            until(lambda: finger() > 100, 1.0, "the closed fingers")
            return hand.open(60)  # slow: it runs when it is cancelled

        def is_cancelled(opening):
            until(lambda: finger() < 100, 2.0, "the loosening")
            opening.cancel()

        cut_short(loosens, is_cancelled, ReasonCode.CANCELLED)
        time.sleep(1.0)
        there = finger()
        stays(lambda: abs(finger() - there) <= 1, 0.4)

        def is_superseded(_closing):
            until(lambda: finger() > there + 5, 2.0, "the closing")
            settle(hand.open(511), 8.0)

        cut_short(lambda: hand.close(60), is_superseded, ReasonCode.SUPERSEDED)
        until(lambda: finger() < 60 and not hand.state().holding, 2.0, "the open hand")

        with frozen("/ih2_hand"):
            until(lambda: not hand.state().connected, 2.5, "silence")
            state = hand.state()
            assert state.event == ReasonCode.NODE_SILENT and state.positions == () and not state.calibrated
            opening = hand.open(400)
            time.sleep(0.3)
            assert not opening.done()
            opening.cancel()
        until(lambda: hand.state().connected, 5.0, "the node's return")


class PerceptionAndDatabase(unittest.TestCase):
    """RosPerception and RosDatabase."""

    def test_perception(self):
        rospy.wait_for_service("/perception/locate_object", 60.0)
        perception = RosPerception()
        assert isinstance(answered(lambda: perception.init_vision(5.0)), str)
        with frozen("/perception"):
            sight = perception.locate_object("board", 0.2)
            time.sleep(0.6)
            assert not sight.done()
            sight.cancel()
        board = answered(lambda: perception.locate_object("board", 2.0))
        assert (board.frame, board.parent) == ("board", "world") and np.linalg.norm(board.quaternion) > 0.99
        assert "elephant" in refused(perception.locate_object("elephant", 0.5), ReasonCode.OBJECT_NOT_SEEN).sentence
        places = answered(lambda: perception.free_places("mug", 2.0))
        assert places and all(place.parent == "board" for place in places)

    def test_an_offer_and_a_pattern_expire_when_no_longer_published(self):
        perception = RosPerception()
        beliefs = rospy.Publisher("perception/belief", HandoverBelief, queue_size=1)
        patterns = rospy.Publisher("perception/recognition", Recognition, queue_size=1)

        def publish(_event):
            patterns.publish(Recognition(pattern="mug", confidence=0.9, decided=True))
            message = HandoverBelief(offer=0.75, hand="human_hand", object_id="mug")
            message.place_covariance[0] = -1.0
            message.header.stamp = rospy.Time.now()
            beliefs.publish(message)

        timer = rospy.Timer(rospy.Duration(0.05), publish)

        def both():
            ahead, recognition = perception.ahead(), perception.recognition()
            known = ahead.offer == 0.75 and recognition.decided
            return known and (ahead.object_id, recognition.pattern) == ("mug", "mug")

        until(both, 2.0, "the belief")
        timer.shutdown()
        until(lambda: perception.ahead() == Ahead() and perception.recognition() == Recognised(), 1.0, "silence")

    def test_database(self):
        rospy.wait_for_service("/object_database/get_object", 60.0)
        database = RosDatabase()
        with frozen("/object_database"):
            entry, ids = database.get_object("mug"), database.list_objects()
            time.sleep(0.4)
            assert not entry.done() and not ids.done()
            entry.cancel()
        assert "mug" in settle(ids), "a request that was not cancelled is answered in the end"
        assert settle(database.get_object("mug"))["mass"] == 0.31
        assert "elephant" in refused(database.get_object("elephant"), ReasonCode.OBJECT_UNKNOWN).sentence


if __name__ == "__main__":
    rospy.init_node("port_contracts")
    rostest.rosrun("coglab_smach", "port_contracts", "__main__", sys.argv)
