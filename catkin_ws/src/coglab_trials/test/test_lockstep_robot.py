"""A whole handover in virtual time: person, object, FRI, DMP and point-to-point, in one thread."""

from dataclasses import replace

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode, Say
from coglab_py.packages import package_path
from coglab_sim.person.in_cell import move_person, seen_in
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_smach.ports.interfaces import DmpRequest
from coglab_smach.ports.pending import PortError
from coglab_trials.virtual_arm import VirtualArm
from coglab_trials.world import DT, Robot, World

PRIMITIVES = str(package_path("coglab_controllers", "config", "primitives.xml"))
GRASP = {"goal_offset": [0.0, -0.065, 0.05], "target_orientation": [0.5, 0.5, 0.5, 0.5]}  # 25 mm before the mug


class Trial:
    """Robot and person; the fingers go where they are told, a stroke per second."""

    def __init__(self, seed=3, behaviour="normal", **cell):
        self.robot = Robot(seed, **cell).virtual
        self.human = VirtualHuman(Participant.draw(seed, behaviour, "accustomed"), Scene())
        self.wanted, self.current = [245 / 255, 5 / 255, 30 / 255, 50 / 255, 50 / 255], 640.0
        self.peak = 0.0

    def tick(self):
        cell = self.robot.cell
        view, _ = seen_in(cell)
        move_person(cell, self.human.step(self.robot.now, view))
        cell.set_motors([1.0] * 5, self.wanted, [self.current] * 5)
        self.robot.set_frame("object_mug", view.object.position, view.object.orientation)
        self.robot.tick()
        self.peak = max(self.peak, float(np.abs(cell.velocity).max()))
        return self.robot.report()

    def until(self, condition, limit):
        """Ticks until the condition on (report, truth) holds; fails after `limit` s of simulated time."""
        end = self.robot.now + limit
        while self.robot.now < end:
            report = self.tick()
            if condition(report, self.robot.cell.truth()):
                return report
        raise AssertionError(
            f"not within {limit} s: {report}, {self.robot.cell.truth()['held_by']}, "
            f"{self.human.phase}, {self.robot.cell.messages[-3:]}"
        )

    def request(self, event):
        ticket, ended = self.robot.submit(event), []

        def over(*_):
            outcome = self.robot.outcome(ticket)
            if outcome is not None:
                ended.append(outcome)
            return bool(ended)

        self.until(over, 10)
        assert ended[0][0], ended

    def start(self):
        for controller, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
            good, message = self.robot.load_controller(controller, kind)
            assert good, message
        good, message, count = self.robot.load_dmps(PRIMITIVES)
        assert good and count > 0, message
        self.until(lambda *_: self.robot.cell.quality == 3, 5)
        self.request("start")
        assert self.robot.switch_controller("dmp")[0]

    def handover(self):
        self.start()
        self.human.command("give mug")
        self.until(lambda *_: self.human.phase == "waiting", 6)
        good, message = self.robot.execute_dmp(
            "reach_human", orientation_control=True, goal_frame="object_mug", **GRASP
        )
        assert good, message
        self.until(lambda report, _: report["motion"] == "reached", 8)
        self.reached = self.robot.cell.truth()
        assert self.robot.switch_controller("ptp")[0]
        self.until(lambda _, truth: np.linalg.norm(truth["palm_force"]) > 0.5, 8)
        self.wanted, self.current = [245 / 255, 1.0, 1.0, 1.0, 1.0], 240.0
        self.until(lambda _, truth: truth["held_by"] == "both", 3)
        self.human.hear(self.robot.now, Say.I_HAVE_IT)  # as the brain does
        self.until(lambda _, truth: truth["held_by"] == "robot", 10)
        status, _, message = self.robot.add_ptp([-1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782])
        assert status == 0, message
        self.until(lambda report, _: report["motion"] == "reached", 10)
        return self.robot.cell.truth()


@pytest.mark.parametrize("seed", [1, 3])
def test_handover_from_person_to_robot(seed):
    trial = Trial(seed)
    truth = trial.handover()
    assert truth["held_by"] == "robot" and not truth["dropped"]
    assert truth["robot_load_share"] == pytest.approx(1.0, abs=0.05)
    place = trial.reached["robot_hand"]["position"] - trial.reached["object"]["position"]
    assert np.linalg.norm(place - GRASP["goal_offset"]) < 0.005
    assert trial.peak < 2.0 and trial.robot.cell.messages == []
    assert trial.robot.finished_ptps() == [(0, True)]


def test_the_same_trial_twice_is_the_same():
    first, second = Trial(5).handover(), Trial(5).handover()
    assert first["time"] == second["time"]
    assert np.array_equal(first["object"]["position"], second["object"]["position"])
    assert np.array_equal(first["position"], second["position"])


def test_faults_reach_the_controllers():
    trial = Trial(2)
    trial.start()
    trial.robot.add_ptp([0.0] * 7)
    assert trial.robot.switch_controller("ptp")[0]
    status, _, message = trial.robot.add_ptp([-1.2, -0.6, 1.4, 1.6, 0.1, 0.2, 0.7])
    assert status == 0, message
    trial.until(lambda *_: np.abs(trial.robot.cell.velocity).max() > 0.05, 3)
    trial.robot.cell.leave_command_mode("fault injected")
    report = trial.until(lambda report, _: not report["motion_allowed"], 1)
    assert report["motion"] == "aborted"
    trial.until(lambda *_: np.abs(trial.robot.cell.velocity).max() == 0.0, 1)
    assert trial.robot.add_ptp([0.0] * 7)[0] == 2


# --- lockstep ---------------------------------------------------------------------------------------------------------


def test_time_goes_by_periods_and_a_frozen_process_answers_nothing():
    robot = Robot(3, krc__period=0.002).virtual
    robot.advance(0.5)
    assert robot.now == pytest.approx(1.5) and robot.cell.time == pytest.approx(0.5) and robot.cell.quality == 3
    robot.frozen = True
    before = robot.report()["cycles"]
    robot.advance(0.5)
    assert robot.cell.quality == 0 and robot.report()["cycles"] == before and robot.now == pytest.approx(2.0)
    robot.frozen = False
    robot.advance(0.5)
    assert robot.cell.quality == 3 and robot.report()["cycles"] > before


@pytest.mark.parametrize("period, periods", [(0.001, 5), (0.002, 3), (0.01, 1)])
def test_a_control_cycle_takes_whole_periods(period, periods):
    """5 ms of cycle time, rounded up."""
    robot = Robot(3, krc__period=period).virtual
    robot.advance(0.6)
    before, begin = robot.report()["cycles"], robot.now
    robot.advance(0.6)
    assert robot.report()["cycles"] - before == pytest.approx((robot.now - begin) / (period * periods), abs=1.1)


def test_frames_are_known_from_when_they_are_told_until_they_are_forgotten():
    trial = Trial()
    trial.start()
    robot = trial.robot
    for frame, known in (("a", False), ("world", True), ("lwr_base_link", True)):
        assert ("is not known" in robot.execute_dmp("reach_human", goal_frame=frame)[1]) != known
    robot.set_frame("a", [0.6, 0.0, 0.5])
    assert "is not known" not in robot.execute_dmp("reach_human", goal_frame="a")[1]
    robot.forget_frame("a")
    assert "frame 'a' is not known" in robot.execute_dmp("reach_human", goal_frame="a")[1]
    with pytest.raises(ValueError, match="no DMP controller is loaded"):
        Robot(3).virtual.dmp_progress()


# --- refusals ---------------------------------------------------------------------------------------------------------

REACH = DmpRequest("take_board", "board", [0.0, -0.25, 0.45], dmp_ratio=2.0)
NAN = float("nan")


@pytest.fixture(scope="module")
def arm():
    """The port of the arm, ready to move, and a posture near the one it is in."""
    world = World(1, object_on="world")
    port = VirtualArm(world)

    def wait(condition, limit=10.0):
        while not condition():
            assert (limit := limit - DT) > 0.0
            world.step()

    for name, kind in (("dmp", "coglab/DmpController"), ("ptp", "coglab/PtpController")):
        port.load_controller(name, kind).result()
    port.load_dmps(PRIMITIVES).result()
    wait(lambda: world.cell.quality == 3)
    port.lwr_command("position")
    start = port.lwr_command("start")
    wait(start.done)
    start.result()
    wait(lambda: port.motion_allowed().ok and world.t > 3.0)
    q = list(port.joint_positions())
    return port, [*q[:6], q[6] + 0.1]


def refused(pending):
    assert pending.done()
    with pytest.raises(PortError) as error:
        pending.result()
    return error.value.code


@pytest.mark.parametrize(
    "fields, code",
    [
        ({"primitive_id": "to_the_moon"}, ReasonCode.UNKNOWN_NAME),
        ({"goal_frame": "nowhere"}, ReasonCode.UNKNOWN_NAME),
        ({"goal_frame": ""}, ReasonCode.GOAL_MISSING),
        ({"goal_offset": [0.0, 0.0, 9.0]}, ReasonCode.GOAL_OUTSIDE_WORKSPACE),
        ({"goal_offset": [0.0, NAN, 0.4]}, ReasonCode.INVALID_ARGUMENT),
        ({"dmp_ratio": NAN}, ReasonCode.OUT_OF_RANGE),
        ({"goal_approach": (0.0, 0.0, 0.5)}, ReasonCode.INVALID_ARGUMENT),
        ({"arrival_speed": 9.0}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_drop": -1.0}, ReasonCode.INVALID_ARGUMENT),
        ({"goal_region_low": (1.0, 0.0, 0.0)}, ReasonCode.INVALID_ARGUMENT),
        ({"orientation_control": True, "target_orientation": (0.0, 0.0, 0.0, 2.0)}, ReasonCode.INVALID_ARGUMENT),
    ],
)
def test_reaches_that_make_no_sense_are_refused_with_their_code(arm, fields, code):
    port, _ = arm
    port.switch_controller("dmp").result()
    assert refused(port.execute_dmp(replace(REACH, **fields))) == code


def test_other_requests_that_make_no_sense_are_refused_with_their_code(arm):
    port, near = arm
    assert refused(port.switch_controller("nobody")) == ReasonCode.UNKNOWN_NAME
    assert refused(port.load_controller("x", "coglab/NoController")) == ReasonCode.UNKNOWN_NAME
    assert refused(port.load_controller("9 x/", "coglab/DmpController")) == ReasonCode.INVALID_ARGUMENT
    assert refused(port.load_dmps("/no/such.xml")) == ReasonCode.BAD_FILE
    assert refused(port.apply_profile("nobody")) == ReasonCode.UNKNOWN_NAME
    assert refused(port.lwr_command("dance")) == ReasonCode.UNKNOWN_NAME
    port.switch_controller("dmp").result()
    assert refused(port.move_ptp(near, [])) == ReasonCode.NOT_ACTIVE
    assert refused(port.switch_dmp(REACH)) == ReasonCode.NOTHING_RUNS
    port.switch_controller("ptp").result()
    assert refused(port.execute_dmp(REACH)) == ReasonCode.NOT_ACTIVE
    for position, speed, code in (
        (near[:6], [], ReasonCode.INVALID_ARGUMENT),
        ([NAN, *near[1:]], [], ReasonCode.INVALID_ARGUMENT),
        ([3.5, *near[1:]], [], ReasonCode.OUT_OF_RANGE),
        ([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0], [], ReasonCode.GOAL_OUTSIDE_WORKSPACE),
        (near, [9.0, *[0.1] * 6], ReasonCode.OUT_OF_RANGE),
        (near, [*[0.1] * 6, NAN], ReasonCode.INVALID_ARGUMENT),
    ):
        assert refused(port.move_ptp(position, speed)) == code
