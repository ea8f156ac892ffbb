"""The kinematic cell: how long each request takes, how its arm moves and brakes, what it refuses at the edge of a
limit, and when its person touches, takes and lets go."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_objects.database import ObjectDatabase, objects_folder
from coglab_py.pose import Pose
from coglab_smach.kinematics.reachability import default_arm, joint_limits
from coglab_smach.ports.interfaces import Ahead, DmpRequest, Recognition, Verdict
from coglab_smach.ports.pending import PortError
from coglab_trials.scripted import arm_requests
from coglab_trials.scripted.arm import SimulatedArm
from coglab_trials.scripted.arm_model import REACH
from coglab_trials.scripted.cell import HAND_AT_WORK, SimulatedCell
from coglab_trials.scripted.contact import SimulatedContact
from coglab_trials.scripted.ports import SimulatedDatabase, SimulatedHand, SimulatedPerception
from conftest import LIBRARY

DMP = DmpRequest("reach_human", "object_mug", (0.0, -0.04, 0.07))
WEIGHT = 0.4 * 9.81


class Cell:
    """All its ports, on a clock that goes on as the test says."""

    def __init__(self):
        self.t = 100.0
        self.cell = SimulatedCell(self)
        database = ObjectDatabase(objects_folder())
        database.reload()
        self.arm, self.hand = SimulatedArm(self.cell), SimulatedHand(self.cell)
        self.perception, self.contact = SimulatedPerception(self.cell), SimulatedContact(self.cell)
        self.database = SimulatedDatabase(self.cell, database)

    def now(self):
        return self.t

    def sleep(self, seconds):
        for _ in range(round(seconds / 0.005)):
            self.t += 0.005
            self.cell.advance()

    def took(self, pending, limit=30.0):
        """s until it is done."""
        begin = self.t
        while not pending.done():
            assert self.t < begin + limit
            self.sleep(0.005)
        return pytest.approx(self.t - begin, abs=0.006)

    def settle(self, pending):
        self.took(pending)
        return pending.result()

    def ready(self, controller="ptp"):
        for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
            self.settle(self.arm.load_controller(name, kind))
        self.settle(self.arm.load_dmps(LIBRARY))
        self.settle(self.arm.lwr_command("start"))
        self.settle(self.arm.switch_controller(controller))
        self.settle(self.hand.calibrate("fast"))
        return self


@pytest.fixture
def cell():
    return Cell()


def test_what_is_asked_of_the_arm_takes_its_time(cell):
    assert cell.took(cell.arm.load_controller("dmp", "coglab/DmpController")) == 0.1
    assert cell.took(cell.arm.load_dmps(LIBRARY)) == 0.1 and cell.took(cell.arm.lwr_command("start")) == 0.05
    assert cell.took(cell.arm.switch_controller("dmp")) == 0.02 and cell.took(cell.arm.apply_profile("ptp")) == 0.01
    assert cell.took(cell.arm.execute_dmp(DMP)) == 0.02 and cell.took(cell.arm.switch_dmp(DMP)) == 0.02
    assert cell.took(cell.arm.hold("x")) == 0.05


def test_what_is_asked_of_the_others_takes_its_time(cell):
    assert cell.took(cell.hand.calibrate("fast")) == 1.7
    assert cell.took(cell.hand.preshape("cylindrical", "low")) == 0.8 and cell.took(cell.hand.close_on_object()) == 1.0
    assert cell.took(cell.hand.close(200)) == 0.8
    assert [cell.took(cell.hand.open(speed)) == s for speed, s in ((511, 0.8), (400, 0.8), (200, 1.6))] == [True] * 3
    assert cell.took(cell.perception.init_vision(9.0)) == 0.5 and cell.took(cell.perception.free_places("x", 1)) == 0.1
    assert cell.took(cell.perception.locate_object("mug", 1.0)) == 0.05
    assert cell.took(cell.perception.locate_object("gnu", 1.0)) == 1.0
    assert cell.took(cell.database.get_object("mug")) == 0.02 and cell.took(cell.database.list_objects()) == 0.02
    assert cell.took(cell.contact.arm("contact", 1.0, {})) == 0.01


def test_a_motion_is_of_minimum_jerk_and_its_reach_tells_what_is_left(cell):
    cell.ready("dmp")
    begin = np.array(cell.arm.joint_positions())
    cell.settle(cell.arm.execute_dmp(DMP))
    since = cell.t
    cell.sleep(0.3)
    s = (cell.t - since) / 1.3
    share = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    assert np.array(cell.arm.joint_positions()) == pytest.approx(begin + share * REACH)
    assert cell.cell.arm.velocity() == pytest.approx(30.0 * s * s * (1 - s) ** 2 / 1.3 * REACH)
    told = cell.arm.dmp_progress()
    assert (told.state, told.primitive_id) == ("running", "reach_human") and told.phase == pytest.approx(1.0 - share)
    assert told.remaining_distance == pytest.approx(0.45 * (1.0 - share))
    assert told.remaining_time == pytest.approx(1.3 * (1.0 - share))
    cell.sleep(1.1)
    assert cell.arm.dmp_progress().state == "reached" and cell.arm.standing() == Verdict(True)
    cell.settle(cell.arm.execute_dmp(replace(DMP, dmp_ratio=2.0)))
    assert cell.arm.dmp_progress().remaining_time == pytest.approx(2.6, abs=0.01)
    cell.sleep(2.7)
    assert np.array(cell.arm.joint_positions()) == pytest.approx(begin), "and back"


def test_an_arm_that_is_ended_brakes_within_its_limits(cell):
    cell.ready("dmp")
    cell.settle(cell.arm.execute_dmp(DMP))
    cell.sleep(0.5)
    before, speed = np.array(cell.arm.joint_positions()), cell.cell.arm.velocity()
    assert cell.cell.arm.end("why", ReasonCode.CANCELLED) and not cell.arm.standing().ok
    longest = np.abs(speed).max() / 10.0
    cell.sleep(0.05)
    share = 0.05 / longest
    assert cell.cell.arm.velocity() == pytest.approx(speed * (1.0 - share), rel=0.05)
    assert np.array(cell.arm.joint_positions()) == pytest.approx(before + speed * 0.05 * (1.0 - share / 2.0), rel=0.02)
    cell.sleep(longest)
    assert np.array(cell.arm.joint_positions()) == pytest.approx(before + 0.5 * longest * speed, abs=1e-6)
    told = cell.arm.dmp_progress()
    assert (told.state, told.reason, told.code) == ("aborted", "why", ReasonCode.CANCELLED) and told.phase < 1.0
    assert not cell.cell.arm.end("again", 1), "there was nothing"


def test_two_motions_are_executed_one_after_the_other_and_a_slow_scale_takes_longer(cell):
    cell.ready()
    here = np.array(cell.arm.joint_positions())
    first, second = (cell.arm.move_ptp(here + [0, 0, 0, 0, 0, 0, by], []) for by in (0.2, 0.1))
    took = cell.took(first).expected
    assert not second.done()
    cell.took(second)
    cell.cell.arm.speed_scale = 0.5
    assert cell.took(cell.arm.move_ptp(here + [0, 0, 0, 0, 0, 0, 0.3], [])).expected == pytest.approx(
        2 * took, abs=0.05
    )


def test_faults_of_the_arm(cell):
    cell.ready("dmp")
    cell.cell.faults.abort_dmp_after = 0.4
    cell.settle(cell.arm.execute_dmp(DMP))
    cell.sleep(0.38)
    assert cell.arm.dmp_progress().state == "running"
    cell.sleep(0.03)
    assert (cell.arm.dmp_progress().state, cell.arm.dmp_progress().code) == ("aborted", ReasonCode.GOAL_LOST)
    cell.cell.faults.arm_disabled = "why"
    assert cell.arm.motion_allowed() == Verdict(False, "why", ReasonCode.NOT_IN_COMMAND_MODE)
    cell.cell.faults.arm_disabled = ""
    cell.cell.faults.dead.add("arm")
    assert cell.arm.motion_allowed() == Verdict(False, "/lwr/state is silent", ReasonCode.NODE_SILENT)
    assert cell.arm.joint_positions() is None and not cell.arm.standing().ok
    cell.cell.faults.dead.clear()
    assert cell.arm.motion_allowed().code == ReasonCode.NOT_STARTED, "it has left command mode"


def test_commands_to_the_robot(cell):
    cell.ready()
    for command, ok, held in (
        ("stop", False, False),
        ("start", True, False),
        ("hold", False, True),
        ("reset", True, False),
    ):
        assert cell.settle(cell.arm.lwr_command(command)) == command
        assert (cell.arm.motion_allowed().ok, cell.cell.arm.held) == (ok, held)
    cell.settle(cell.arm.lwr_command("hold"))
    for command, code in (("start", ReasonCode.HELD), ("dance", ReasonCode.UNKNOWN_NAME)):
        with pytest.raises(PortError) as error:
            cell.settle(cell.arm.lwr_command(command))
        assert error.value.code == code


def test_the_correction_of_a_profile_fades_within_a_fifth_of_a_second(cell):
    cell.ready("dmp")
    cell.sleep(0.3)
    assert cell.arm.profile_settled("dmp") == Verdict(True)
    cell.settle(cell.arm.apply_profile("dmp_compliant"))
    cell.sleep(0.18)
    assert cell.arm.profile_settled("dmp_compliant") == Verdict(False, "ee_admittance is stopping")
    cell.sleep(0.03)
    assert cell.arm.profile_settled("dmp_compliant").ok and "is in force" in cell.arm.profile_settled("dmp").why


# --- what is refused --------------------------------------------------------------------------------------------------


def refuses(check, *arguments):
    """The code of a refusal; None."""
    try:
        check(*arguments)
    except PortError as error:
        return error.code
    return None


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"dmp_ratio": 0.05}, None),
        ({"dmp_ratio": 0.049}, ReasonCode.OUT_OF_RANGE),
        ({"dmp_ratio": 100.0}, None),
        ({"dmp_ratio": 100.1}, ReasonCode.OUT_OF_RANGE),
        ({"arrival_speed": 0.02}, None),
        ({"arrival_speed": 0.019}, ReasonCode.INVALID_ARGUMENT),
        ({"arrival_speed": 0.45}, None),
        ({"arrival_speed": 0.451}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_approach": (0.3, 0.0, 0.0)}, None),
        ({"goal_approach": (0.0, 0.301, 0.0)}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_retreat": -0.001}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_drop": np.inf}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_region_high": (0.0, -0.1, 0.0)}, ReasonCode.INVALID_ARGUMENT),
        ({"orientation_control": True, "target_orientation": (0.0, 0.0, 0.0, 1.0009)}, None),
        ({"orientation_control": True, "target_orientation": (0, 0, 0, 1.0011)}, ReasonCode.INVALID_ARGUMENT),
        ({"orientation_control": True, "target_orientation": (0, 0, 0, 0.9989)}, ReasonCode.INVALID_ARGUMENT),
        ({"orientation_control": True}, None),
        ({"target_orientation": (0.0, 0.0, 0.0, 2.0)}, None),
    ],
)
def test_reaches_at_the_edge_of_what_is_taken(fields, code):
    assert refuses(arm_requests.check_primitive, replace(DMP, **fields), ["reach_human"]) == code


def test_goals_may_be_half_a_metre_outside_the_workspace():
    frames = {"f": Pose(np.array([0.6, 0.0, 0.4]))}
    request = replace(DMP, goal_frame="f", goal_offset=(0.0, 0.0, 0.0))
    at = lambda z: replace(request, goal_offset=(0.0, 0.0, z))  # noqa: E731
    edge = next(z for z in np.arange(0.0, 3.0, 0.01) if refuses(arm_requests.check_goal, at(z), frames))
    place = np.array([0.6, 0.0, 0.4 + edge])
    assert np.linalg.norm(arm_requests._workspace().project(place) - place) == pytest.approx(0.505, abs=0.006)
    assert refuses(arm_requests.check_goal, at(edge), frames) == ReasonCode.GOAL_OUTSIDE_WORKSPACE
    for frame, code in (("", ReasonCode.GOAL_MISSING), ("g", ReasonCode.UNKNOWN_NAME)):
        assert refuses(arm_requests.check_goal, replace(request, goal_frame=frame), frames) == code


def test_names_of_controllers_and_profiles():
    kind = "coglab/PtpController"
    for name, code in (("a" * 48, None), ("a" * 49, ReasonCode.INVALID_ARGUMENT), ("A9_", None), ("", 1)):
        assert bool(refuses(arm_requests.check_load, name, kind, [])) == bool(code), name
    assert refuses(arm_requests.check_profile, "ptp") is None
    assert refuses(arm_requests.check_profile, "x") == ReasonCode.UNKNOWN_NAME


def test_postures_keep_12_mrad_from_the_ends_of_the_range():
    limits, fast = joint_limits(), [1.0] * 7
    bent = [0.0, 0.5, 0.0, 1.2, 0.0, 0.5, 0.0]
    assert refuses(arm_requests.check_ptp, bent, [], fast) is None
    for end, out in ((limits.upper_position, 1.0), (limits.lower_position, -1.0)):
        for inside, code in ((0.0121, None), (0.0119, ReasonCode.OUT_OF_RANGE)):
            assert refuses(arm_requests.check_ptp, [*bent[:6], end[6] - out * inside], [], fast) == code
    for speed, code in ((1e-4, None), (0.9e-4, ReasonCode.OUT_OF_RANGE), (1.0, None), (1.01, ReasonCode.OUT_OF_RANGE)):
        assert refuses(arm_requests.check_ptp, bent, [0.5, speed, *[0.5] * 5], fast) == code
    assert refuses(arm_requests.check_ptp, bent, [np.nan] * 7, fast) == ReasonCode.INVALID_ARGUMENT


# --- hand and person --------------------------------------------------------------------------------------------------


def test_fingers_open_at_their_speed_and_stand_when_they_are_cancelled(cell):
    cell.ready()
    cell.settle(cell.hand.preshape("cylindrical", "low"))
    assert cell.hand.state().positions == (200, 40, 40, 40, 40) and not cell.hand.state().holding
    cell.settle(cell.hand.close_on_object())
    assert cell.hand.state().positions == (200, 150, 160, 155, 170) and cell.hand.state().holding
    opening = cell.hand.open(100)
    cell.sleep(0.8)
    there = cell.hand.state().positions
    assert there == pytest.approx((150, 112.5, 120, 116, 128), abs=1), "a quarter of 3.2 s"
    opening.cancel()
    cell.sleep(1.0)
    assert cell.hand.state().positions == there
    cell.settle(cell.hand.open(511))
    cell.settle(cell.hand.preshape("cylindrical", "low"))
    cell.cell.faults.empty_grasp = True
    for close in (cell.hand.close_on_object, lambda: cell.hand.close(1)):
        cell.settle(close())
        assert cell.hand.state().positions == (200, 254, 254, 254, 254) and not cell.hand.state().holding
    for speed, good in ((0, False), (1, True), (511, True), (512, False)):
        assert (refuses(cell.hand.open(speed).result) != ReasonCode.OUT_OF_RANGE) == good
    for order, good in (
        ("fast force", True),
        ("complete force", True),
        ("fast", False),
        ("slow force", False),
        ("fast x", False),
    ):
        cell.sleep(5.0)
        assert (refuses(lambda order=order: cell.settle(cell.hand.calibrate(order))) is None) == good, order


def test_a_hand_that_calibrates_tells_so(cell):
    cell.ready()
    again = cell.hand.calibrate("fast force")
    cell.sleep(1.6)
    state = cell.hand.state()
    assert state.calibrating and not state.calibrated and state.positions == () and not again.done()
    assert refuses(cell.hand.preshape("lateral", "low").result) == ReasonCode.HAND_CALIBRATING
    cell.sleep(0.2)
    assert cell.hand.state().calibrated and again.done() and cell.hand.state().positions == (0,) * 5


@pytest.mark.parametrize(
    ("mode", "after", "contact", "code"),
    [
        ("contact", 0.8, True, ReasonCode.CONTACT_FOUND),
        ("contact_in_motion", 0.8, True, ReasonCode.CONTACT_FOUND),
        ("lift", 0.2, True, ReasonCode.LOAD_CARRIED),
        ("load", 0.2, True, ReasonCode.LOAD_CARRIED),
        ("release", 1.0, False, ReasonCode.LOAD_RELEASED),
    ],
)
def test_the_persons_script_is_followed_from_arming_on(cell, mode, after, contact, code):
    cell.settle(cell.contact.arm("contact", 9.0, {}))
    cell.settle(cell.contact.arm(mode, 9.0, {"mass": 0.4}))
    cell.sleep(after - 0.02)
    assert cell.contact.event() is None
    cell.sleep(0.03)
    event = cell.contact.event()
    assert (event.contact, event.code, event.margin, event.source) == (contact, code, 2.0, "simulated")
    cell.settle(cell.contact.arm(mode, after - 0.05, {"mass": 0.4}))
    cell.sleep(after + 1.0)
    assert cell.contact.event() is None, "its time was over before"


@pytest.mark.parametrize(
    ("mode", "least", "sign"), [("contact", 1.0, 1), ("contact", 1.0, -1), ("lift", 0.5, -1), ("release", 0.5, 1)]
)
def test_a_push_is_felt_from_one_newton_or_half_of_the_weight_on(cell, mode, least, sign):
    cell.cell.partner.touch_after = cell.cell.partner.take_after = cell.cell.partner.let_go_after = None
    needed = sign * least * (1.0 if mode == "contact" else WEIGHT)
    cell.cell.push(0.3)
    cell.settle(cell.contact.arm(mode, 9.0, {"mass": 0.4}))
    for share, felt in ((0.99, False), (-1.5 if mode != "contact" else 0.5, False), (1.01, True)):
        cell.cell.push(0.3 + share * needed)
        assert (cell.contact.event() is not None) == felt, share
    if mode == "release":
        assert cell.contact.share_gone() == pytest.approx(0.505)
        cell.settle(cell.contact.arm(mode, 9.0, {"mass": 0.4, "load_share": 0.9}))
        cell.cell.push(cell.cell.lifted + 0.25 * WEIGHT)
        assert cell.contact.share_gone() == pytest.approx(0.25) and cell.contact.event() is None
    else:
        assert cell.contact.share_gone() is None


def test_grip_force_and_hand_of_the_person(cell):
    cell.ready()
    assert cell.contact.grip() is None and cell.contact.force() == (0.0, 0.0, 0.0)
    cell.cell.touch, cell.cell.hand_positions, cell.cell.pulled = 4.0, (0, 0, 157, 0, 0), (1.0, 2.0, 3.0)
    cell.cell.push(-2.0)
    assert cell.contact.grip() == 28.0 and cell.contact.force() == (1.0, 2.0, 1.0)
    cell.cell.hand_positions = (0, 0, 100, 254, 254)
    assert cell.contact.grip() == 0.0 and not cell.hand.state().holding
    cell.cell.hand_positions = (0, 0, 101, 0, 0)
    assert cell.hand.state().holding
    cell.cell.faults.dead.add("contact")
    assert cell.contact.grip() is None and cell.contact.force() is None
    cell.cell.let_go()
    for after, away in ((0.1, 0.1), (0.19, 0.29), (0.02, 0.3), (0.67, 0.3), (0.12, 0.2), (0.21, 0.0)):
        cell.sleep(after)
        assert cell.cell.joints
        place = cell.cell.objects["human_hand"].position
        assert place == pytest.approx(HAND_AT_WORK + [away, 0.0, 0.0], abs=0.025), "1 m/s, for a second"


def test_what_is_seen_believed_and_recognised_in_the_cell(cell):
    cell.ready("dmp")
    assert cell.perception.ahead() == Ahead() and cell.perception.recognition() == Recognition()
    cell.cell.partner.request, cell.cell.partner.pattern, cell.cell.partner.pattern_at = 0.4, "high", 0.5
    assert cell.perception.ahead() == Ahead(0.0, 0.4, "")
    cell.cell.partner.offer = 0.9
    assert cell.perception.ahead() == Ahead(0.9, 0.4, "mug")
    cell.settle(cell.arm.execute_dmp(DMP))
    cell.sleep(0.48)
    assert cell.perception.recognition() == Recognition()
    cell.sleep(0.03)
    assert cell.perception.recognition() == Recognition("high", 0.95, True)
    place = cell.settle(cell.perception.free_places("mug", 1.0))[0]
    assert (place.frame, place.parent, place.xyz, place.age) == ("", "board", (0.0, 0.0, 0.05), 0.05)
    seen = cell.settle(cell.perception.locate_object("mug", 1.0))
    assert (seen.frame, seen.xyz, seen.quaternion) == ("object_mug", (0.78, 0.03, 0.43), (0.0, 0.0, 0.0, 1.0))
    cell.cell.at_palm = ("mug", Pose(np.array([-0.07, 0.0, 0.0])))
    palm = Pose(*default_arm().fk(np.array(cell.arm.joint_positions())))
    assert cell.cell.pose("mug").position == pytest.approx(palm.position + 0.07 * palm.axis(0))
