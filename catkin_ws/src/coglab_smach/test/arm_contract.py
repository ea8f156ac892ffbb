"""What the port of the arm promises; see port_contracts."""

import numpy as np
from coglab_msgs.msg import ReasonCode
from coglab_smach.ports.interfaces import DmpRequest
from contract import Contract

CONTROLLERS = {"dmp": "coglab/DmpController", "ptp": "coglab/PtpController"}


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
