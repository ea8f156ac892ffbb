"""What every port promises, checked on the real adapter (port_contracts_rostest.py, on a running system) and on its
double (test_port_contracts.py): what it takes, what it refuses, how it runs out of time, what cancel does, and what
happens while its node is frozen. A double that is kinder than the real port fails here.

A suite gets a Place: the port, the clock that it lives on, and how its node is frozen and thawed.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import DmpRequest
from coglab_smach.ports.pending import PortError

CONTROLLERS = {"dmp": "coglab/DmpController", "ptp": "coglab/PtpController"}


@dataclass
class Place:
    """Where a suite runs."""

    port: Any
    now: Callable[[], float]
    sleep: Callable[[float], None]
    freeze: Callable[[], None]
    """the node behind the port stops as it stands"""
    thaw: Callable[[], None]
    library: str = "library.xml"
    push: Callable[[float], None] = lambda force: None
    """somebody lifts the hand with so many N from now on, or presses it down if negative; 0 lets go"""
    arm_rests: AbstractContextManager = field(default_factory=nullcontext)
    """within it nobody else moves the arm"""


class Contract:
    """Methods named test_* run in the order in which they are written."""

    def __init__(self, place: Place) -> None:
        self.place, self.port = place, place.port

    def begin(self) -> None:
        """Before each test."""

    def until(self, condition, limit=5.0, what="it"):
        end = self.place.now() + limit
        while not condition():
            assert self.place.now() < end, f"{what} did not happen within {limit} s"
            self.place.sleep(0.01)

    def settle(self, pending, limit=5.0):
        """The value of a call, which has to come in time."""
        self.until(pending.done, limit, "the answer")
        return pending.result()

    def refused(self, pending, *codes, limit=5.0):
        """The error of a call that must not succeed, with one of these codes."""
        try:
            value = self.settle(pending, limit)
        except PortError as error:
            assert error.sentence, "a refusal says why"
            assert not codes or error.code in codes, f"code {error.code}, expected one of {codes}: {error.sentence}"
            return error
        raise AssertionError(f"it succeeded with {value!r}")

    def stays(self, condition, duration):
        end = self.place.now() + duration
        while self.place.now() < end:
            assert condition()
            self.place.sleep(0.01)


class ArmContract(Contract):
    """ArmPort. The robot node has just started."""

    loaded = False

    def begin(self):
        if not self.loaded:
            # A node that has just started has nothing to cancel.
            self.until(lambda: self.port.standing().ok, 10.0, "the arm at rest")
            self.refused(self.port.switch_controller("ptp"), ReasonCode.UNKNOWN_NAME)
            self.settle(self.port.cancel_motion("the contract"), 4.0)
            self.loaded = True
        for name, kind in CONTROLLERS.items():
            self.settle(self.port.load_controller(name, kind), 20.0)
        if self.port.motion_allowed().ok:
            return
        self.settle(self.port.lwr_command("reset"))
        if not self.port.motion_allowed().ok:
            self.settle(self.port.lwr_command("position"))
            self.settle(self.port.lwr_command("start"), 20.0)
        self.until(lambda: self.port.motion_allowed().ok, 10.0, "command mode")

    def away(self, by=0.4):
        """A posture ``by`` rad from here, in the last joint alone."""
        q = list(self.port.joint_positions())
        q[6] += by if q[6] < 0.5 else -by
        return q

    def ready(self, controller="ptp"):
        self.settle(self.port.switch_controller(controller))
        self.until(lambda: self.port.standing().ok, 3.0, "rest")

    def start_ptp(self, by=0.4):
        self.ready()
        target = self.away(by)
        motion = self.port.move_ptp(target, [])
        self.until(lambda: not self.port.standing().ok, 2.0, "the motion")
        return motion, target

    def assert_ended(self, motion, target, *codes):
        """The motion is over, the arm stands short of its target, and stays."""
        if motion is not None:
            self.refused(motion, *codes)
        self.until(lambda: self.port.standing().ok, 2.0, "rest")
        self.place.sleep(0.1)
        place = np.array(self.port.joint_positions())
        assert np.max(np.abs(place - target)) > 0.02, "it went to its target all the same"
        self.place.sleep(0.3)
        assert np.max(np.abs(place - self.port.joint_positions())) < 0.01, "it moved on"

    def test_a_motion_is_executed_to_its_end(self):
        motion, target = self.start_ptp(0.2)
        assert not motion.done()
        assert self.settle(motion) is None
        assert np.max(np.abs(np.subtract(self.port.joint_positions(), target))) < 0.03
        self.until(lambda: self.port.standing().ok, 1.0, "rest")

    def test_a_motion_goes_on_when_nobody_waits_until_it_is_cancelled(self):
        motion, target = self.start_ptp()
        self.place.sleep(0.2)
        assert not self.port.standing().ok
        queued = self.port.move_ptp(target, [])
        self.place.sleep(0.1)
        self.settle(self.port.cancel_motion("the contract"), 2.5)
        assert self.port.standing().ok, "cancel is answered when the arm stands"
        self.refused(queued, ReasonCode.CANCELLED)
        self.assert_ended(None, target)

    def test_the_handle_of_a_motion_ends_it(self):
        motion, target = self.start_ptp()
        motion.cancel()
        self.assert_ended(motion, target, ReasonCode.CANCELLED)

    def test_cancelling_nothing_succeeds(self):
        self.ready()
        self.settle(self.port.cancel_motion("the contract"), 2.5)
        self.ready("dmp")
        self.settle(self.port.cancel_motion("the contract"), 2.5)

    def test_a_switch_ends_a_motion(self):
        motion, target = self.start_ptp()
        assert self.settle(self.port.switch_controller("dmp")) == CONTROLLERS["dmp"]
        self.assert_ended(motion, target, ReasonCode.SWITCHED)

    def test_a_reach_goes_on_until_it_is_cancelled(self):
        assert self.settle(self.port.load_dmps(self.place.library)) >= 5
        self.ready("dmp")
        request = DmpRequest("take_board", "board", [0.0, -0.25, 0.45], dmp_ratio=2.0)
        self.settle(self.port.execute_dmp(request))
        self.until(lambda: self.port.dmp_progress().primitive_id == "take_board", 1.0, "news of the motion")
        assert self.port.dmp_progress().state == "running" and self.port.dmp_progress().remaining_distance > 0.05
        self.until(lambda: not self.port.standing().ok, 1.0, "the motion")
        self.settle(self.port.cancel_motion("the contract"), 2.5)
        assert self.port.standing().ok
        self.until(lambda: self.port.dmp_progress().state == "aborted", 1.0, "news of the end")
        assert self.port.dmp_progress().code == ReasonCode.CANCELLED

    def test_refusals_have_codes(self):
        port = self.port
        self.refused(port.switch_controller("nobody"), ReasonCode.UNKNOWN_NAME)
        self.refused(port.load_controller("x", "coglab/NoController"))
        self.ready("dmp")
        self.refused(port.move_ptp(self.away(), []), ReasonCode.NOT_ACTIVE)
        self.refused(port.execute_dmp(DmpRequest("to_the_moon", "board", [0, 0, 0.4])), ReasonCode.UNKNOWN_NAME)
        self.refused(port.switch_dmp(DmpRequest("put_board", "board", [0, 0, 0.4])), ReasonCode.NOTHING_RUNS)
        self.ready()
        self.refused(port.execute_dmp(DmpRequest("take_board", "board", [0, 0, 0.4])), ReasonCode.NOT_ACTIVE)
        self.refused(port.move_ptp(self.away()[:6], []), ReasonCode.INVALID_ARGUMENT)
        self.refused(port.move_ptp([float("nan"), *self.away()[1:]], []), ReasonCode.INVALID_ARGUMENT)
        self.refused(port.move_ptp([3.5, *self.away()[1:]], []), ReasonCode.OUT_OF_RANGE)
        self.refused(port.lwr_command("dance"))
        assert port.standing().ok

    def test_a_hold_ends_the_motion_and_latches(self):
        motion, target = self.start_ptp()
        self.settle(self.port.hold("the contract"))
        self.until(lambda: not self.port.motion_allowed().ok, 1.0, "the hold")
        assert self.port.motion_allowed().code == ReasonCode.HELD
        self.refused(self.port.lwr_command("start"), ReasonCode.HELD)
        self.assert_ended(motion, target)
        self.refused(self.port.move_ptp(target, []), ReasonCode.HELD)
        self.settle(self.port.lwr_command("reset"))
        self.until(lambda: self.port.motion_allowed().ok, 2.0, "the end of the hold")
        self.stays(lambda: self.port.standing().ok, 0.2)

    def test_limits_and_speed_are_known(self):
        limits = self.port.motion_limits()
        assert len(limits.velocity) == len(limits.ptp_acceleration) == 7 and min(limits.ptp_velocity) > 0.0
        assert self.port.speed_scale() == 1.0

    def test_given_up_while_its_node_is_frozen_it_never_acts(self):
        self.ready()
        before, target = np.array(self.port.joint_positions()), self.away()
        self.place.freeze()
        try:
            motion = self.port.move_ptp(target, [])
            self.until(lambda: self.port.joint_positions() is None, 2.0, "silence")
            self.until(lambda: not self.port.motion_allowed().ok, 2.0, "silence")
            assert self.port.motion_allowed().code == ReasonCode.NODE_SILENT and not self.port.standing().ok
            motion.cancel()
        finally:
            self.place.thaw()
        self.until(lambda: self.port.joint_positions() is not None, 5.0, "the node's return")
        self.begin()
        self.stays(lambda: np.max(np.abs(before - self.port.joint_positions())) < 0.05, 0.6)


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
        assert board.frame == "board" and board.parent == "world" and board.age < 0.5
        assert np.linalg.norm(board.quaternion) > 0.99

    def test_what_is_not_there_is_refused_in_time(self):
        begin = self.place.now()
        error = self.refused(self.port.locate_object("elephant", 0.5), limit=2.5)
        assert "elephant" in error.sentence and self.place.now() - begin < 2.5

    def test_free_places_are_on_the_board(self):
        places = self.settle(self.port.free_places("mug", 2.0), 4.0)
        assert places and all(place.parent == "board" for place in places)

    def test_recognition_never_waits(self):
        assert 0.0 <= self.port.recognition().confidence <= 1.0

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

    def watches(self, mode, time_limit=20.0, **settings):
        """Armed, and the detector has seen enough of the arm at rest."""
        self.settle(self.port.arm(mode, time_limit, settings))
        self.place.sleep(1.2)
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
        # Nobody has watched for a contact yet.
        self.refused(self.port.arm("load", 1.0, {"mass": 0.3}), ReasonCode.INVALID_ARGUMENT)
        self.refused(self.port.arm("contact", -1.0, {}), ReasonCode.INVALID_ARGUMENT)
        assert self.port.event() is None

    def test_touch_weight_and_release_are_found_once_each(self):
        with self.place.arm_rests:
            self.watches("contact", k=20.0)
            self.place.push(-8.0)
            self.happens(True, ReasonCode.CONTACT_FOUND)
            self.place.push(0.0)
            self.stays(lambda: self.port.event().code == ReasonCode.CONTACT_FOUND, 0.3)
            self.watches("load", mass=0.8, load_share=0.5)
            self.place.push(-8.0)
            self.happens(True, ReasonCode.LOAD_CARRIED)
            self.watches("release", mass=0.8, load_share=0.5)
            self.place.push(0.0)
            self.happens(False, ReasonCode.LOAD_RELEASED)

    def test_no_event_without_a_touch_and_none_after_the_limit(self):
        self.settle(self.port.arm("contact", 0.4, {"k": 50.0}))
        self.stays(lambda: self.port.event() is None, 1.0)

    def test_disarmed_it_says_nothing(self):
        with self.place.arm_rests:
            self.watches("contact", k=20.0)
            self.port.disarm()
            self.place.push(-8.0)
            self.stays(lambda: self.port.event() is None, 0.3)
            self.place.push(0.0)

    def test_armed_again_at_once_it_watches(self):
        with self.place.arm_rests:
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
