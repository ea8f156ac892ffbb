"""The world in one process, part by part: how it is put together, the hand's tasks in it, what a robot counts and
tells, and a process that stands still."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from coglab_py.packages import package_path
from coglab_py.pose import Pose, about_z
from coglab_sim.person.recorded_person import RecordedPerson
from coglab_sim.person.scene import shipped
from coglab_trials import world as virtual_world
from coglab_trials.conditions import CONSIDERATE, PATIENT, THE_WORLD_AS_IT_IS
from coglab_trials.world import BOARD, DT, Robot, World, manager_parameters
from ih2_hand.reasons import Reason

PRIMITIVES = str(package_path("coglab_controllers", "config", "primitives.xml"))


def test_figures_of_the_world():
    assert (DT, virtual_world.FLOAT32, virtual_world.TASK_LIMIT, virtual_world.OLDEST) == (0.005, 5e-4, 8.0, 1e9)
    assert BOARD.position == pytest.approx([0.45, -0.55, 0.05])
    assert BOARD.orientation == pytest.approx(about_z(-np.pi / 2))
    parameters = manager_parameters()
    assert parameters["feedback_file"].startswith("/") and yaml.safe_load(open(parameters["feedback_file"]))


def stepped(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step()
    return world


# -- put together -------------------------------------------------------------------------------------------------


@pytest.fixture
def told(monkeypatch):
    """The parameters of the cells that are made."""
    made, lockstep = [], virtual_world.LockstepRobot

    def make(urdf, limits, parameters, manager):
        made.append(parameters)
        return lockstep(urdf, limits, parameters, manager)

    monkeypatch.setattr(virtual_world, "LockstepRobot", make)
    return made


def test_a_world_by_default_is_the_one_as_it_is(told):
    world = World()
    assert world.human.participant == THE_WORLD_AS_IT_IS.participant(1) and world.human.holds()
    assert told[0]["seed"] == 1 and world.cell.period == DT
    assert np.abs(world.scene.object_turn) == pytest.approx([0, 0, 0, 1]) and world.object_frame == "object_mug"
    assert (world.t, world.ticks, world.speed_scale, world.blind) == (1.0, 0, 1.0, set())
    assert world.cell.truth()["object"]["position"] == pytest.approx([1.22, 0.20, 0.10], abs=1e-3)
    assert sorted(world.trackers) == ["human_hand", "object_mug"]


def test_conditions_reach_person_plant_and_tracker(told):
    conditions = replace(CONSIDERATE, object_id="bottle", mass=1.3, friction=0.7, person={"trust": 0.2})
    world = World(4, conditions, turned=0.4)
    bottle = shipped("bottle")
    assert world.human.participant.trust == 0.2 and world.human.participant.seed == 4
    assert told[0]["object/mass"] == pytest.approx(1.3 * bottle["mass"])
    assert told[0]["object/friction"] == pytest.approx(0.7 * bottle["friction"])
    assert told[0]["object/id"] == "bottle" and world.scene.object_mass == pytest.approx(1.3 * 0.53)
    assert told[0]["object/rotation"] == pytest.approx(about_z(0.4))
    assert told[0]["object/start"] == "human_hand"
    assert told[0]["object/position"] == pytest.approx(world.scene.object_in_hand)
    assert told[0]["contact/board_center"] == pytest.approx([0.45, -0.55, 0.05])
    assert world.trackers["human_hand"].settings.perfect and world.trackers["human_hand"].name == "human_hand"


def test_an_object_on_the_board_stands_in_its_middle():
    world = World(2, CONSIDERATE, object_on="world")
    assert not world.human.holds()
    assert world.cell.truth()["object"]["position"] == pytest.approx([0.45, -0.55, 0.052], abs=1e-6)
    assert abs(np.dot(world.cell.truth()["object"]["rotation"], BOARD.orientation)) == pytest.approx(1.0)


def test_a_recording_moves_the_persons_hand(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_text("t,x,y,z\n" + "".join(f"{0.1 * i},{1.3 - 0.04 * i},0.2,0.4\n" for i in range(11)))
    settings = {"file": str(path), "person": "no_wait", "object": "in_hand"}
    world = World(2, CONSIDERATE, recording=settings)
    assert isinstance(world.human, RecordedPerson) and world.human.way == "no_wait"
    assert world.human.rest == pytest.approx([1.3, 0.2, 0.4])
    assert world.scene.object_in_hand == pytest.approx([-0.08, 0.0, -0.05])


def test_person_and_tracker_look_at_every_second_period():
    world = World(2, CONSIDERATE)
    looks = []
    step = world.human.step
    world.human.step = lambda t, view: looks.append(t) or step(t, view)
    periods = []
    world.after_period.append(lambda: periods.append(world.t))
    stepped(world, 0.1)
    assert np.diff(looks) == pytest.approx([2 * DT] * (len(looks) - 1)) and len(looks) == 10
    assert world.ticks == 20 and world.t == pytest.approx(1.0 + 0.1)
    assert 17 <= len(periods) <= 20, "with a robot that is connected"


def test_what_is_seen_has_an_age_and_who_is_blind_sees_nothing():
    world = World(2, CONSIDERATE)
    assert world.newest("object_mug") == (None, 1e9)
    board, age = world.newest("board")
    assert age == 0.0 and board is world.board
    stepped(world, 0.2)
    seen, age = world.newest("object_mug")
    assert seen.distance(Pose(np.array([1.22, 0.2, 0.1])))[0] < 0.02 and 0.0 <= age <= 0.05
    world.blind.add("object_mug")
    stepped(world, 0.5)
    assert world.newest("object_mug")[1] == pytest.approx(age + 0.5) and world.newest("human_hand")[1] <= 0.05


# -- the hand -----------------------------------------------------------------------------------------------------


def hand_world():
    """A hand whose calibration is over; the object lies elsewhere."""
    world = World(3, PATIENT, object_on="world")
    assert world.hand.calibrate("fast force") is None and world.hand.calibrating
    begun = world.t
    while not world.hand.calibration_over(world.t):
        world.step()
        assert world.t < begun + 5.0
    assert world.t - begun > 0.5, "it takes its time in the world, too"
    assert world.hand.calibrated and not world.hand.calibrating
    return world


def finished(world, job, limit=10.0):
    for _ in range(round(limit / DT)):
        if job.verdict is not None:
            return job.verdict
        world.step()
    raise AssertionError("the task does not end")


def test_the_hand_preshapes_closes_on_nothing_and_opens():
    world = hand_world()
    job = world.hand.begin("hand_preshape", mode="cylindrical", level="medium")
    assert world.hand.job is job and job.verdict is None
    verdict = finished(world, job)
    assert verdict.ok and world.hand.job is None and world.hand.reason == verdict.reason == Reason.NONE
    assert world.hand.message == f"hand_preshape: {verdict.text}"
    close = world.hand.begin("hand_close", speed=255)
    assert finished(world, close).done and len(world.hand.positions) == 5
    assert min(world.hand.positions[2:]) > 200 and len(world.hand.readings) == 5
    assert world.cell.truth()["hand_closure"] > 0.8
    opening = world.hand.begin("hand_open", speed=255)
    assert finished(world, opening).ok and max(world.hand.positions[2:]) < 20


def test_a_new_goal_ends_the_one_that_runs():
    world = hand_world()
    first = world.hand.begin("hand_close", speed=50)
    stepped(world, 0.2)
    second = world.hand.begin("hand_open", speed=255)
    assert (first.verdict.text, first.verdict.reason) == ("replaced by a new goal; fingers stopped", Reason.SUPERSEDED)
    assert world.hand.job is second and first.verdict.done and first.verdict.stop
    world.hand.end(first, "late", Reason.CANCELLED if hasattr(Reason, "CANCELLED") else Reason.SUPERSEDED)
    assert world.hand.job is second, "one that has ended stays as it is"
    world.hand.end(second, "enough", Reason.SUPERSEDED)
    assert world.hand.job is None and world.hand.message.endswith(": enough") and world.hand.reason == Reason.SUPERSEDED
    before = world.cell.truth()["hand_closure"]
    assert stepped(world, 0.3).cell.truth()["hand_closure"] == pytest.approx(before, abs=0.05), "the fingers stop"


def test_a_hand_refuses_what_it_cannot_do_now():
    world = hand_world()
    why = world.hand.calibrate("fast")
    assert why and world.hand.message == f"calibration refused: {why}" and world.hand.reason == Reason.HAND_REFUSED
    fresh = World(3, PATIENT, object_on="world")
    running = fresh.hand.begin("hand_open", speed=255)
    assert "hand_open runs" in fresh.hand.calibrate("fast force") and running.verdict is None
    fresh.hand.end(running, "enough", Reason.SUPERSEDED)
    assert fresh.hand.calibrate("fast force") is None
    assert not fresh.hand.calibration_over(fresh.t), "it has just begun"
    with pytest.raises(Exception, match="the hand calibrates"):
        fresh.hand.begin("hand_open", speed=255)


@pytest.mark.parametrize("dead", [False, True])
def test_a_hand_is_polled_often_while_a_task_runs_and_seldom_else(dead):
    world = hand_world()
    world.hand.dead = dead
    polls = []
    look = world.hand.look
    world.hand.look = lambda readings: polls.append(world.t) or look(readings)
    stepped(world, 2.0)
    assert len(polls) == (0 if dead else pytest.approx(10, abs=1))
    polls.clear()
    world.hand.begin("hand_close", speed=20)
    stepped(world, 1.0)
    assert len(polls) == (0 if dead else pytest.approx(29, abs=3))


# -- the robot ----------------------------------------------------------------------------------------------------


class Still:
    """In the place of the robot in virtual time: it says what the test wants."""

    def __init__(self):
        self.cell = self
        self.position, self.fastest = np.zeros(7), np.zeros(7)
        self.told = {"fri_period": 0.005, "commanded_position": np.zeros(7), "motion_allowed": True}
        self.records, self.ends = [], []

    def tick(self):
        pass

    def report(self):
        return dict(self.told)

    def dmp_progress(self):
        return {"motion": "reached"}

    def ik_debug(self):
        return self.records

    def ptp_ends(self):
        return self.ends


@pytest.fixture
def robot():
    robot = Robot(1)
    robot.virtual = robot.cell = Still()
    robot.outside = dict.fromkeys(robot.outside, 0)
    return robot


def commanded(robot, joint, speed):
    """One period in which a joint is commanded so fast."""
    robot.virtual.told["commanded_position"] = robot.virtual.told["commanded_position"] + np.eye(7)[joint] * speed * DT
    robot.step()


def test_commands_are_judged_by_the_table_with_what_rounding_adds(robot):
    robot.step()
    assert robot.peak_share == 0.0
    for joint in range(7):
        limit = robot.limits.velocity[joint]
        robot.outside["commanded"] = 0
        commanded(robot, joint, -limit - 4e-4)
        assert robot.outside["commanded"] == 0
        commanded(robot, joint, limit + 6e-4)
        assert robot.outside["commanded"] == 1 and robot.peak_share >= 1.0
    assert robot.peak_share == pytest.approx(1.0, abs=1e-3) and robot.limit_violations == 1


def test_a_command_beyond_the_range_counts_and_a_leap_after_a_stop_does_not(robot):
    robot.step()
    robot.virtual.told["motion_allowed"] = False
    commanded(robot, 3, 50.0)
    commanded(robot, 3, 50.0)
    assert robot.outside["commanded"] == 0 and robot.peak_share == 0.0
    robot.virtual.told["motion_allowed"] = True
    commanded(robot, 3, 50.0)
    assert robot.outside["commanded"] == 0, "nothing to compare with"
    commanded(robot, 3, 50.0)
    assert robot.outside["commanded"] == 1
    ends = np.array(robot.limits.upper_position)
    for end, beyond in ((ends, 1.0), (np.array(robot.limits.lower_position), -1.0)):
        for joint in range(7):
            robot._commanded, robot.outside["commanded"] = None, 0
            robot.virtual.told["commanded_position"] = end.copy()
            robot.step()
            assert robot.outside["commanded"] == 0
            robot._commanded = None
            robot.virtual.told["commanded_position"] = end + beyond * 1e-9 * np.eye(7)[joint]
            robot.step()
            assert robot.outside["commanded"] == 1
    robot.virtual.told["fri_period"] = 0.0
    robot.step()
    assert robot.outside["commanded"] == 1, "nobody is connected"


def test_the_measured_share_is_the_largest_so_far(robot):
    robot.virtual.fastest = 0.5 * np.array(robot._fastest)
    robot.step()
    assert robot.measured_share == pytest.approx(0.5)
    robot.virtual.fastest = np.zeros(7)
    robot.step()
    assert robot.measured_share == pytest.approx(0.5) and robot.outside["measured"] == 0


def test_progress_and_ends_are_kept(robot):
    assert robot.progress["motion"] == "idle" and robot.progress["remaining_time"] == 0.0
    assert robot.progress == {
        **{"motion": "idle", "reason": "", "primitive": "", "phase": 0.0},
        **{"remaining_distance": 0.0, "remaining_time": 0.0},
    }
    robot.virtual.records = [{"time": 1.0}, {"time": 2.0}]
    assert robot.look_at_motion() == robot.virtual.records
    assert robot.debug == {"time": 2.0} and robot.progress == {"motion": "reached"}
    robot.virtual.records = []
    robot.look_at_motion()
    assert robot.debug == {"time": 2.0}
    robot.virtual.ends = [{"ptp_id": 4, "executed": True}]
    robot.step()
    assert robot.ended == {}, "no such controller is loaded"
    robot.loaded["ptp"] = "coglab/PtpController"
    robot.step()
    assert robot.ended == {4: {"ptp_id": 4, "executed": True}}


# -- lockstep -----------------------------------------------------------------------------------------------------


def test_time_goes_by_periods_and_a_frozen_process_answers_nothing():
    virtual = Robot(3, krc__period=0.002).virtual
    assert virtual.now == 1.0 and not virtual.frozen
    virtual.advance(0.5)
    assert virtual.now == pytest.approx(1.5) and virtual.cell.time == pytest.approx(0.5)
    assert virtual.cell.quality == 3
    virtual.frozen = True
    before = virtual.report()["cycles"]
    virtual.advance(0.5)
    assert virtual.cell.quality == 0 and virtual.report()["cycles"] == before and virtual.now == pytest.approx(2.0)
    virtual.frozen = False
    virtual.advance(0.5)
    assert virtual.cell.quality == 3 and virtual.report()["cycles"] > before


@pytest.mark.parametrize("period, periods", [(0.001, 5), (0.005, 1), (0.002, 3), (0.01, 1)])
def test_a_control_cycle_takes_whole_periods(period, periods):
    """5 ms of cycle time, rounded up."""
    virtual = Robot(3, krc__period=period).virtual
    virtual.advance(0.6)
    before, begin = virtual.report()["cycles"], virtual.now
    virtual.advance(0.6)
    assert virtual.report()["cycles"] - before == pytest.approx((virtual.now - begin) / (period * periods), abs=1.1)


def test_frames_are_known_from_when_they_are_told_until_they_are_forgotten():
    virtual = Robot(3).virtual
    assert virtual.load_controller("dmp", "coglab/DmpController")[0]
    assert virtual.load_dmps(PRIMITIVES)[0]
    virtual.advance(1.5)
    virtual.submit("start")
    virtual.advance(1.5)
    assert virtual.switch_controller("dmp")[0]
    for frame in ("a", "world", "lwr_base_link"):
        virtual.advance(0.02)
        good, message = virtual.execute_dmp("reach_human", goal_frame=frame)
        assert ("is not known" in message) is (frame == "a"), message
    virtual.set_frame("a", [0.6, 0.0, 0.5])
    assert "is not known" not in virtual.execute_dmp("reach_human", goal_frame="a")[1]
    virtual.forget_frame("a")
    assert "frame 'a' is not known" in virtual.execute_dmp("reach_human", goal_frame="a")[1]
    with pytest.raises(ValueError, match="no point-to-point controller is loaded under the id 'ptp'"):
        virtual.add_ptp([0.0] * 7)
    with pytest.raises(ValueError, match="no DMP controller is loaded under the id 'dmp'"):
        Robot(3).virtual.dmp_progress()
    good, message = virtual.load_controller("dmp", "coglab/DmpController")
    assert not good and message and virtual.reason_code != 0
