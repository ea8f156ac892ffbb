"""What every port promises, checked on the real adapter (port_contracts_rostest.py, on a running system) and on its
double (test_port_contracts.py): what it takes, what it refuses, how it runs out of time, what cancel does, and what
happens while its node is frozen. A double that is kinder than the real port fails here.

A suite gets a Place: the port, the clock that it lives on, and how its node is frozen and thawed.
"""

from contextlib import contextmanager

import numpy as np
from arm_contract import ArmContract
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import Ahead, Recognition
from contract import Contract, Place

__all__ = ["SUITES", "Place"]


class HandContract(Contract):
    """HandPort. The hand is empty and has just started."""

    def calibrated(self):
        if not self.port.state().calibrated:
            self.settle(self.port.calibrate("fast"), 12.0)
        assert self.port.state().calibrated

    def test_a_newcomer_can_open_but_not_grasp(self):
        self.until(lambda: self.port.state().connected, 15.0, "the hand")
        if not self.port.state().calibrated:
            self.refused(self.port.preshape("cylindrical", "medium"), ReasonCode.HAND_NOT_CALIBRATED)
            self.settle(self.port.open(511), 8.0)
        self.calibrated()
        assert not self.port.state().holding

    def test_refusals(self):
        self.calibrated()
        self.refused(self.port.preshape("fist", "medium"), ReasonCode.UNKNOWN_NAME)
        for speed in (9999, 0, -1):
            self.refused(self.port.open(speed), ReasonCode.OUT_OF_RANGE)
        self.settle(self.port.open(511), 8.0)
        self.refused(self.port.close_on_object(), ReasonCode.HAND_REFUSED)

    def test_preshape_close_on_nothing_and_open(self):
        self.calibrated()
        self.settle(self.port.preshape("cylindrical", "medium"), 8.0)
        closing = self.port.close_on_object()
        assert not closing.done()
        self.settle(closing, 8.0)
        self.until(lambda: self.port.state().positions[2] > 100, 1.0, "the closed fingers")
        self.settle(self.port.open(511), 8.0)
        self.until(lambda: self.port.state().positions[2] < 60 and not self.port.state().holding, 2.0, "the open hand")

    def test_a_slow_opening_that_is_cancelled_leaves_the_fingers_there_and_they_close_again(self):
        self.calibrated()
        finger = lambda: self.port.state().positions[2]  # noqa: E731
        for speed in (9999, 0, -1):
            self.refused(self.port.close(speed), ReasonCode.OUT_OF_RANGE)
        self.settle(self.port.preshape("cylindrical", "medium"), 8.0)
        self.settle(self.port.close_on_object(), 8.0)
        self.until(lambda: finger() > 100, 1.0, "the closed fingers")
        closed, opening = finger(), self.port.open(100)
        self.until(lambda: finger() < closed - 10, 2.0, "the loosening")
        opening.cancel()
        self.refused(opening, ReasonCode.CANCELLED)
        self.place.sleep(0.4)
        there = finger()
        assert closed - 60 * self.place.patience < there < closed - 9
        self.stays(lambda: abs(finger() - there) <= 1, 0.4)
        self.settle(self.port.close(200), 8.0)
        self.until(lambda: finger() >= closed - 5, 1.0, "the closed fingers")
        self.settle(self.port.open(511), 8.0)

    def test_cancelled_it_ends_without_success(self):
        self.calibrated()
        self.settle(self.port.preshape("cylindrical", "medium"), 8.0)
        closing = self.port.close_on_object()
        self.place.sleep(0.1)
        closing.cancel()
        self.refused(closing, ReasonCode.CANCELLED)
        self.settle(self.port.open(511), 8.0)

    def test_a_newer_order_ends_the_older(self):
        self.calibrated()
        self.settle(self.port.preshape("cylindrical", "medium"), 8.0)
        closing = self.port.close_on_object()
        self.place.sleep(0.1)
        opening = self.port.open(511)
        self.refused(closing, ReasonCode.SUPERSEDED)
        self.settle(opening, 8.0)
        assert not self.port.state().holding

    def test_a_calibrated_hand_calibrates_only_by_force(self):
        self.calibrated()
        self.refused(self.port.calibrate("fast"), ReasonCode.HAND_REFUSED)
        again = self.port.calibrate("fast force")
        self.until(lambda: again.done() or self.port.state().calibrating, 1.0, "the calibration")
        assert not again.done()
        self.refused(self.port.preshape("cylindrical", "medium"), ReasonCode.HAND_CALIBRATING)
        self.settle(again, 12.0)
        assert self.port.state().calibrated

    def test_a_frozen_node_shows(self):
        self.calibrated()
        self.place.freeze()
        try:
            self.until(lambda: not self.port.state().connected, 2.5, "silence")
            state = self.port.state()
            assert state.message and state.event == ReasonCode.NODE_SILENT
            # What was true of the hand before is not known any more.
            assert not state.calibrated and not state.holding and state.positions == ()
            opening = self.port.open(400)
            self.place.sleep(0.3)
            assert not opening.done()
            opening.cancel()
        finally:
            self.place.thaw()
        self.until(lambda: self.port.state().connected, 5.0, "the node's return")


class PerceptionContract(Contract):
    """PerceptionPort."""

    def test_it_starts(self):
        assert isinstance(self.settle(self.port.init_vision(5.0), 8.0), str)

    def test_the_board_is_seen(self):
        board = self.settle(self.port.locate_object("board", 2.0), 4.0)
        assert board.frame == "board" and board.parent == "world" and board.age < 0.5 * self.place.patience
        assert np.linalg.norm(board.quaternion) > 0.99

    def test_what_is_not_there_is_refused_in_time(self):
        begin = self.place.now()
        error = self.refused(self.port.locate_object("elephant", 0.5), limit=2.5)
        assert "elephant" in error.sentence and self.place.now() - begin < 2.5 * self.place.patience

    def test_free_places_are_on_the_board(self):
        places = self.settle(self.port.free_places("mug", 2.0), 4.0)
        assert places and all(place.parent == "board" for place in places)

    def test_recognition_never_waits(self):
        assert 0.0 <= self.port.recognition().confidence <= 1.0

    def test_an_offer_is_believed_while_perception_says_so(self):
        nothing = Ahead()
        self.until(lambda: self.port.ahead() == nothing, 1.0, "the end of what was believed before")
        self.place.believe(0.75)
        self.until(lambda: self.port.ahead().offer > 0.5, 2.0, "the belief")
        seen = self.port.ahead()
        assert (seen.offer, seen.object_id) == (0.75, "mug") and 0.0 <= seen.request <= 0.25
        assert seen.deviation >= 0.0 and np.all(np.isfinite(seen.place))
        self.stays(lambda: self.port.ahead().offer == 0.75, 0.5)
        self.place.freeze()
        try:
            self.until(lambda: self.port.ahead() == nothing, 1.0, "silence")
            self.until(lambda: self.port.recognition() == Recognition(), 1.0, "silence")
        finally:
            self.place.thaw()
        self.until(lambda: self.port.ahead().offer == 0.75, 2.0, "its return")
        self.place.believe(0.0)
        self.until(lambda: self.port.ahead().offer == 0.0, 2.0, "the end of the offer")

    def test_nothing_is_believed_nor_recognised_of_a_hand_that_is_not_seen(self):
        self.place.believe(0.75)
        self.until(lambda: self.port.ahead().offer == 0.75, 2.0, "the belief")
        self.until(lambda: self.port.recognition().confidence > 0.5, 2.0, "the recognition")
        self.place.show_hand(False)
        try:
            self.until(lambda: self.port.ahead() == Ahead(), 1.0, "the end of what was believed")
            self.until(lambda: self.port.recognition() == Recognition(), 1.0, "the end of what was recognised")
            self.stays(lambda: self.port.ahead() == Ahead() and self.port.recognition() == Recognition(), 0.5)
        finally:
            self.place.show_hand(True)
        self.until(lambda: self.port.ahead().offer == 0.75, 2.0, "its return")
        self.place.believe(0.0)
        self.until(lambda: self.port.ahead().offer == 0.0, 2.0, "the end of the offer")

    def test_a_frozen_node_does_not_answer(self):
        self.place.freeze()
        try:
            sight = self.port.locate_object("board", 0.2)
            self.place.sleep(0.6)
            assert not sight.done()
            sight.cancel()
        finally:
            self.place.thaw()
        self.test_the_board_is_seen()


class DatabaseContract(Contract):
    """DatabasePort."""

    def test_entries(self):
        ids = self.settle(self.port.list_objects())
        assert "mug" in ids
        mug = self.settle(self.port.get_object("mug"))
        assert mug["mass"] == 0.31 and mug["default_grasp"] in mug["grasps"]

    def test_an_unknown_one_is_refused_by_name_with_what_there_is(self):
        error = self.refused(self.port.get_object("elephant"))
        assert "elephant" in error.sentence and "mug" in error.sentence

    def test_a_frozen_node_does_not_answer(self):
        self.place.freeze()
        try:
            entry, ids = self.port.get_object("mug"), self.port.list_objects()
            self.place.sleep(0.4)
            assert not entry.done() and not ids.done()
            entry.cancel()
        finally:
            self.place.thaw()
        assert "mug" in self.settle(ids), "what was not given up is answered in the end"
        self.test_entries()


class ContactContract(Contract):
    """ContactPort. Nothing but push() touches the hand, and the arm may move."""

    def begin(self):
        self.place.push(0.0)
        self.port.disarm()
        self.place.sleep(0.3)  # what was pushed is at rest again

    @contextmanager
    def resting(self):
        """The arm rests until nothing of a push is left: where it rested before a motion, it felt nothing."""
        with self.place.arm_rests:
            yield
            self.place.push(0.0)
            self.place.sleep(0.5)

    def watches(self, mode, time_limit=20.0, **settings):
        """Armed, and the detector has seen enough of the arm at rest."""
        self.settle(self.port.arm(mode, time_limit, settings))
        self.place.sleep(min(1.2 * self.place.patience, 3.0))
        assert self.port.event() is None, self.port.event()

    def happens(self, contact, code):
        """The event, which has to come soon."""
        self.until(lambda: self.port.event() is not None, 2.0, "the event")
        event = self.port.event()
        assert event.contact == contact and event.code == code, event
        assert event.margin >= 1.0 and 0.5 <= event.confidence <= 1.0 and event.source and event.message, event

    def test_requests_that_make_no_sense_are_refused(self):
        self.refused(self.port.arm("juggle", 1.0, {}), ReasonCode.INVALID_ARGUMENT)
        self.refused(self.port.arm("release", 1.0, {}), ReasonCode.INVALID_ARGUMENT)
        self.refused(self.port.arm("lift", 1.0, {}), ReasonCode.INVALID_ARGUMENT)
        # Nobody has watched for a contact yet.
        self.refused(self.port.arm("load", 1.0, {"mass": 0.3}), ReasonCode.INVALID_ARGUMENT)
        self.refused(self.port.arm("contact", -1.0, {}), ReasonCode.INVALID_ARGUMENT)
        assert self.port.event() is None

    def test_touch_weight_and_release_are_found_once_each(self):
        with self.resting():
            self.watches("contact", k=20.0)
            self.place.push(-8.0)
            self.happens(True, ReasonCode.CONTACT_FOUND)
            self.place.push(0.0)
            self.stays(lambda: self.port.event().code == ReasonCode.CONTACT_FOUND, 0.3)
            self.watches("load", mass=0.8, load_share=0.5)
            self.place.push(-8.0)
            self.happens(True, ReasonCode.LOAD_CARRIED)
            assert self.port.share_gone() is None
            assert self.port.grip() is None, "this hand does not feel"
            self.watches("release", mass=0.8, load_share=0.5)
            self.until(
                lambda: abs(1.0 if (gone := self.port.share_gone()) is None else gone) < 0.1, 1.0, "the whole load"
            )
            self.place.push(0.0)
            self.happens(False, ReasonCode.LOAD_RELEASED)
            self.until(lambda: self.port.share_gone() > 0.7, 2.0, "the load")
            self.port.disarm()
            assert self.port.share_gone() is None

    def test_a_weight_that_comes_while_the_arm_lifts_is_found(self):
        with self.resting():
            self.watches("lift", mass=0.8, load_share=0.5)
            self.place.push(-2.0)
            self.stays(lambda: self.port.event() is None, 0.5)
            self.place.push(-8.0)
            self.happens(True, ReasonCode.LOAD_CARRIED)

    @contextmanager
    def moving(self):
        """The arm goes for some seconds, slowly, and is stopped in the end."""
        arm = self.place.arm
        with self.resting():
            self.enable(arm)
            self.settle(arm.switch_controller("ptp"))
            self.until(lambda: arm.standing().ok, 3.0, "rest")
            self.place.sleep(1.0)  # what the arm feels while nobody touches it
            target = list(arm.joint_positions())
            target[6] += 0.8 if target[6] < 0.5 else -0.8

            def go():
                arm.move_ptp(target, [0.1] * 7)
                self.until(lambda: not arm.standing().ok, 2.0, "the motion")

            try:
                yield go
            finally:
                self.settle(arm.cancel_motion("the contract"), 4.0)
                self.until(lambda: arm.standing().ok, 2.0, "rest")

    def test_contact_says_nothing_while_the_arm_moves(self):
        with self.moving() as go:
            self.settle(self.port.arm("contact", 20.0, {"k": 20.0}))
            go()
            self.place.sleep(0.3)
            self.place.push(-8.0)
            self.stays(lambda: self.port.event() is None and not self.place.arm.standing().ok, 1.0)
            self.settle(self.place.arm.cancel_motion("the contract"), 4.0)
            self.happens(True, ReasonCode.CONTACT_CAME_EARLY)

    def test_contact_in_motion_is_found_while_the_arm_moves_and_while_it_rests(self):
        with self.moving() as go:
            self.watches("contact_in_motion")
            self.place.push(-15.0)
            self.happens(True, ReasonCode.CONTACT_FOUND)
            self.place.push(0.0)
            self.place.sleep(1.0)
            go()
            self.place.sleep(0.3)
            self.settle(self.port.arm("contact_in_motion", 20.0, {}))
            self.stays(lambda: self.port.event() is None, 0.7)
            self.place.push(-15.0)
            self.happens(True, ReasonCode.CONTACT_FOUND)
            assert not self.place.arm.standing().ok

    def test_no_event_without_a_touch_and_none_after_the_limit(self):
        self.settle(self.port.arm("contact", 0.4, {"k": 50.0}))
        self.stays(lambda: self.port.event() is None, 1.0)

    def test_disarmed_it_says_nothing(self):
        with self.resting():
            self.watches("contact", k=20.0)
            self.port.disarm()
            self.place.push(-8.0)
            self.stays(lambda: self.port.event() is None, 0.3)
            self.place.push(0.0)

    def test_armed_again_at_once_it_watches(self):
        with self.resting():
            self.settle(self.port.arm("contact", 20.0, {"k": 20.0}))
            self.port.disarm()
            self.watches("contact", k=20.0)
            self.place.push(-8.0)
            self.happens(True, ReasonCode.CONTACT_FOUND)
            self.place.push(0.0)

    def test_a_frozen_node_does_not_answer(self):
        self.place.freeze()
        try:
            armed = self.port.arm("contact", 1.0, {})
            self.place.sleep(0.4)
            assert not armed.done()
            armed.cancel()
        finally:
            self.place.thaw()
        self.test_disarmed_it_says_nothing()


SUITES = {
    "arm": ArmContract,
    "hand": HandContract,
    "perception": PerceptionContract,
    "database": DatabaseContract,
    "contact": ContactContract,
}
