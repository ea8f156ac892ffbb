"""What the port of the arm promises; see port_contracts."""

from dataclasses import replace

import numpy as np
import yaml
from coglab_msgs.msg import ReasonCode
from coglab_py.packages import package_path
from coglab_smach.ports.interfaces import DmpRequest
from contract import CONTROLLERS, Contract

NAN = float("nan")
REACH = DmpRequest("take_board", "board", [0.0, -0.25, 0.45], dmp_ratio=2.0)
NO_REACHES = (
    ({"primitive_id": "to_the_moon"}, ReasonCode.UNKNOWN_NAME, "to_the_moon"),
    ({"dmp_ratio": 0.0}, ReasonCode.OUT_OF_RANGE, "dmp_ratio"),
    ({"dmp_ratio": NAN}, ReasonCode.OUT_OF_RANGE, "dmp_ratio"),
    ({"goal_offset": [0.0, NAN, 0.4]}, ReasonCode.INVALID_ARGUMENT, "goal_offset"),
    ({"goal_approach": (0.0, 0.0, 0.5)}, ReasonCode.INVALID_ARGUMENT, "goal_approach"),
    ({"arrival_speed": 9.0}, ReasonCode.INVALID_ARGUMENT, "arrival_speed"),
    ({"goal_drop": -1.0}, ReasonCode.INVALID_ARGUMENT, "goal_drop"),
    ({"goal_region_low": (1.0, 0.0, 0.0)}, ReasonCode.INVALID_ARGUMENT, "goal_region_low"),
    (
        {"orientation_control": True, "target_orientation": (0.0, 0.0, 0.0, 2.0)},
        ReasonCode.INVALID_ARGUMENT,
        "target_orientation",
    ),
    ({"goal_frame": "nowhere"}, ReasonCode.UNKNOWN_NAME, "nowhere"),
    ({"goal_frame": ""}, ReasonCode.GOAL_MISSING, "goal_frame"),
    ({"goal_offset": [0.0, 0.0, 9.0]}, ReasonCode.GOAL_OUTSIDE_WORKSPACE, "outside the workspace"),
)
"""what is wrong with a reach, the code of its refusal, and a word of it"""


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
        self.enable(self.port)

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
        motion = self.port.move_ptp(target, [0.05] * 7)  # slow: a test may be late
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
        self.ready("dmp")
        self.refused(self.port.execute_dmp(REACH), ReasonCode.UNKNOWN_NAME)  # no primitive is loaded yet
        assert self.settle(self.port.load_dmps(self.place.library)) >= 5
        self.settle(self.port.execute_dmp(REACH))
        self.until(lambda: self.port.dmp_progress().primitive_id == "take_board", 1.0, "news of the motion")
        assert self.port.dmp_progress().state == "running" and self.port.dmp_progress().remaining_distance > 0.05
        self.until(lambda: not self.port.standing().ok, 1.0, "the motion")
        self.settle(self.port.cancel_motion("the contract"), 2.5)
        assert self.port.standing().ok
        self.until(lambda: self.port.dmp_progress().state == "aborted", 1.0, "news of the end")
        assert self.port.dmp_progress().code == ReasonCode.CANCELLED

    def test_another_primitive_goes_on_in_the_phase_of_the_motion(self):
        port = self.port
        self.settle(port.load_dmps(self.place.library))
        self.ready("dmp")
        self.settle(port.execute_dmp(replace(REACH, dmp_ratio=4.0)))
        self.until(lambda: 0.0 < port.dmp_progress().phase < 0.95, 3.0, "the way")
        self.refused(port.switch_dmp(DmpRequest("to_the_moon", "", REACH.goal_offset)), ReasonCode.UNKNOWN_NAME)
        self.refused(port.switch_dmp(replace(REACH, dmp_ratio=0.0)), ReasonCode.OUT_OF_RANGE)
        before = port.dmp_progress()
        assert (before.state, before.primitive_id) == ("running", "take_board")
        self.settle(port.switch_dmp(DmpRequest("put_board", "", REACH.goal_offset, dmp_ratio=4.0)))
        self.until(lambda: port.dmp_progress().primitive_id == "put_board", 1.0, "news of the other primitive")
        after = port.dmp_progress()
        assert after.state == "running" and before.phase - 0.3 * self.place.patience < after.phase <= before.phase
        self.until(lambda: not port.standing().ok, 1.0, "the motion")
        self.settle(port.cancel_motion("the contract"), 2.5)

    def test_profiles_of_feedback_are_applied_and_come_with_a_controller(self):
        port = self.port
        self.ready("dmp")
        self.until(lambda: port.profile_settled("dmp").ok, 3.0, "the controller's own profile")
        self.settle(port.apply_profile("dmp_compliant"))
        self.until(lambda: port.profile_settled("dmp_compliant").ok, 3.0, "the profile")
        error = self.refused(port.apply_profile("nobody"), ReasonCode.UNKNOWN_NAME)
        assert "nobody" in error.sentence
        other = port.profile_settled("dmp")
        assert not other.ok and "dmp_compliant" in other.why, "a refused one changes nothing"
        self.settle(port.apply_profile("dmp"))
        self.until(lambda: port.profile_settled("dmp").ok, 3.0, "the end of the other profile")
        self.settle(port.apply_profile("dmp_compliant"))
        self.ready("ptp")
        self.until(lambda: port.profile_settled("ptp").ok, 3.0, "the profile of the other controller")

    def test_refusals_have_codes(self):
        port = self.port
        self.refused(port.switch_controller("nobody"), ReasonCode.UNKNOWN_NAME)
        for name, kind, code, word in (
            ("x", "coglab/NoController", ReasonCode.UNKNOWN_NAME, "coglab/NoController"),
            ("dmp", "coglab/PtpController", ReasonCode.INVALID_ARGUMENT, "in use"),
            ("9 x/", "coglab/DmpController", ReasonCode.INVALID_ARGUMENT, "beginning with a letter"),
        ):
            assert word in self.refused(port.load_controller(name, kind), code).sentence
        assert "/no/such.xml" in self.refused(port.load_dmps("/no/such.xml"), ReasonCode.BAD_FILE).sentence
        self.ready("dmp")
        self.refused(port.move_ptp(self.away(), []), ReasonCode.NOT_ACTIVE)
        self.settle(port.load_dmps(self.place.library))
        self.refused(port.switch_dmp(DmpRequest("put_board", "board", [0, 0, 0.4])), ReasonCode.NOTHING_RUNS)
        self.ready()
        self.refused(port.execute_dmp(DmpRequest("take_board", "board", [0, 0, 0.4])), ReasonCode.NOT_ACTIVE)
        self.refused(port.lwr_command("dance"))
        assert port.standing().ok

    def test_reaches_that_make_no_sense_are_refused(self):
        self.settle(self.port.load_dmps(self.place.library))
        self.ready("dmp")
        for fields, code, word in NO_REACHES:
            error = self.refused(self.port.execute_dmp(replace(REACH, **fields)), code)
            assert word in error.sentence, (fields, error.sentence)
        assert self.port.standing().ok

    def test_postures_and_speeds_beyond_the_limits_are_refused(self):
        self.ready()
        here = self.away()
        for position, velocity, code, word in (
            (here[:6], [], ReasonCode.INVALID_ARGUMENT, "6 numbers"),
            ([NAN, *here[1:]], [], ReasonCode.INVALID_ARGUMENT, "lwr_a1"),
            ([3.5, *here[1:]], [], ReasonCode.OUT_OF_RANGE, "lwr_a1"),
            ([here[0], 2.5, *here[2:]], [], ReasonCode.OUT_OF_RANGE, "lwr_a2"),
            # Within the table, and nearer to its end than the margin.
            ([*here[:6], 2.96], [], ReasonCode.OUT_OF_RANGE, "lwr_a6"),
            ([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0], [], ReasonCode.GOAL_OUTSIDE_WORKSPACE, "outside the workspace"),
            (here, [0.1] * 3, ReasonCode.INVALID_ARGUMENT, "3 numbers"),
            (here, [*[0.1] * 6, NAN], ReasonCode.INVALID_ARGUMENT, "lwr_a6"),
            (here, [9.0, *[0.1] * 6], ReasonCode.OUT_OF_RANGE, "lwr_a1"),
            (here, [*[0.1] * 6, 0.0], ReasonCode.OUT_OF_RANGE, "lwr_a6"),
        ):
            error = self.refused(self.port.move_ptp(position, velocity), code)
            assert word in error.sentence, error.sentence
        assert self.port.standing().ok

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

    def test_limits_are_those_of_the_table(self):
        table = yaml.safe_load(package_path("lwr_description", "config", "joint_limits.yaml").read_text())["default"]
        limits = self.port.motion_limits()
        # Commanded is no more than what a servo that overshoots keeps within the table.
        for mine, whole in ((limits.velocity, table["velocity"]), (limits.acceleration, table["acceleration"])):
            assert len(mine) == len(whole) == 7
            assert np.all(np.array(mine) <= whole) and np.all(np.array(mine) > 0.95 * np.array(whole)), mine
        manager = package_path("coglab_controllers", "config", "controllers.yaml").read_text()
        ptp = yaml.safe_load(manager)["ptp"]
        assert np.allclose(limits.ptp_velocity, ptp["default_speed"] * np.array(limits.velocity))
        assert np.allclose(limits.ptp_acceleration, ptp["default_acceleration"] * np.array(limits.acceleration))

    def test_the_speed_scale_is_told_as_it_is_set(self):
        assert self.port.speed_scale() == 1.0
        if self.place.slow is None:
            return
        try:
            for scale in (0.25, 0.5):
                self.place.slow(scale)
                self.until(lambda scale=scale: self.port.speed_scale() == scale, 2.0, f"speed scale {scale}")
            # A motion is slowed down by it, too: at full speed it takes half as long.
            at_half = self.duration(0.3)
        finally:
            self.place.slow(1.0)
        self.until(lambda: self.port.speed_scale() == 1.0, 2.0, "the full speed scale")
        at_full = self.duration(0.3)
        assert self.place.patience > 1.0 or 1.5 < at_half / at_full < 2.5

    def duration(self, by):
        """s that a motion in the last joint takes."""
        self.ready()
        begun = self.place.now()
        self.settle(self.port.move_ptp(self.away(by), []), 10.0)
        return self.place.now() - begun

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
