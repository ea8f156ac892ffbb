"""A whole handover in virtual time: person, object, FRI, DMP and point-to-point, in one thread."""

import numpy as np
import pytest
from coglab_msgs.msg import Say
from coglab_py.packages import package_path
from coglab_sim.person.in_cell import move_person, view_of
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene
from coglab_sim.person.virtual_human import VirtualHuman
from coglab_trials.world import Robot

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
        truth = cell.truth()
        obj = truth["object"]
        move_person(cell, self.human.step(self.robot.now, view_of(truth)))
        cell.set_motors([1.0] * 5, self.wanted, [self.current] * 5)
        self.robot.set_frame("object_mug", obj["position"], obj["rotation"])
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
