"""The world in one process: its parts, sights of tracker and person, tasks of the hand, and counted violations of the
arm's limits."""

import importlib
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from coglab_objects.database import ObjectError
from coglab_py.pose import Pose
from coglab_sim.person.in_cell import pose_of_truth
from coglab_sim.person.scene import shipped
from coglab_trials import Conditions, World
from coglab_trials.conditions import CONSIDERATE, PATIENT
from coglab_trials.world import DT, Robot
from ih2_hand.reasons import Reason


def stepped(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step()
    return world


# --- parts ------------------------------------------------------------------------------------------------------------


def test_conditions_reach_person_plant_and_tracker():
    conditions = replace(CONSIDERATE, object_id="bottle", mass=1.3, friction=0.7, person={"trust": 0.2})
    world = World(4, conditions)
    assert world.human.participant.trust == 0.2 and world.human.participant.seed == 4 and world.human.holds()
    assert world.object_frame == "object_bottle" and world.trackers["human_hand"].settings.perfect
    assert world.scene.object_mass == pytest.approx(1.3 * shipped("bottle")["mass"])
    with pytest.raises(ObjectError):
        World(4, Conditions(object_id="elephant"))


@pytest.mark.parametrize("module", ["coglab_sim._cell", "coglab_sim._virtual"])
def test_a_missing_library_is_named_with_a_remedy(monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "coglab_trials.world", raising=False)
    with pytest.raises(ImportError, match=rf"{module}.* \./coglab build.* libmujoco-dev"):
        importlib.import_module("coglab_trials.world")


# --- sights -----------------------------------------------------------------------------------------------------------


def test_the_tracker_sees_the_true_place_of_the_hand():
    """A person's arm is compliant: during a motion, the hand is not at its wanted place."""
    world = World(2, CONSIDERATE)
    world.human.command("give mug")
    true, wanted, apart = {}, {}, []
    step = world.human.step

    def remember(t, view):
        sample = step(t, view)
        wanted[t] = sample.frame
        return sample

    world.human.step = remember
    for _ in range(round(2.5 / DT)):
        t = world.t
        if world.ticks % 2 == 0:
            true[t] = pose_of_truth(world.cell.truth()["human_hand"])
        world.step()
        sight = world.sights["human_hand"]
        assert sight.frame.distance(true[sight.captured]) == pytest.approx((0.0, 0.0), abs=1e-9)
        apart.append(sight.frame.distance(wanted[sight.captured])[0])
    assert max(apart) > 0.002


def test_sights_have_an_age_and_a_blind_tracker_sees_nothing():
    world = World(2, CONSIDERATE)
    assert world.newest("object_mug")[0] is None
    stepped(world, 0.2)
    seen, age = world.newest("object_mug")
    assert seen.distance(Pose(np.array([1.22, 0.2, 0.1])))[0] < 0.02 and 0.0 <= age <= 0.05
    world.blind.add("object_mug")
    stepped(world, 0.5)
    assert world.newest("object_mug")[1] == pytest.approx(age + 0.5) and world.newest("human_hand")[1] <= 0.05


def test_the_seen_closure_is_that_of_the_finger_joints():
    """Not of the motors: a released tendon moves before its finger does."""
    robot = Robot(3, object__start="world", object__position=[1.5, 1.0, 0.0])
    cell = robot.cell  # only a view

    def after(target, seconds):
        cell.set_motors([1.0] * 5, [0.0, 0.0, target, target, target], [1000.0] * 5)
        shown = []
        for _ in range(round(seconds / cell.period)):
            cell.step(None)
            motors = np.mean([motor["position"] for motor in cell.motors()[2:]])
            shown.append((cell.truth()["hand_closure"], motors))
        return shown

    assert after(0.0, 2.0)[-1][0] == pytest.approx(0.0, abs=0.03)
    closing = after(1.0, 2.0)
    assert closing[-1][0] == pytest.approx(1.0, abs=0.03)
    assert max(b[0] - a[0] for a, b in zip(closing, closing[1:], strict=False)) < 0.05
    opening = after(0.0, 2.0)
    assert opening[-1][0] == pytest.approx(0.0, abs=0.05)
    assert max(abs(seen - motors) for seen, motors in closing + opening) > 0.005, "fingers, not motors"


# --- the hand ---------------------------------------------------------------------------------------------------------


def calibrated():
    """Returns a world with a calibrated hand; the object is elsewhere."""
    world = World(3, PATIENT, "world")
    assert world.hand.calibrate("fast force") is None
    with pytest.raises(Exception, match="calibrates"):
        world.hand.begin("hand_open", speed=255)
    begun = world.t
    while not world.hand.calibration_over(world.t):
        world.step()
        assert world.t < begun + 5.0
    assert world.t - begun > 0.5, "it takes time in the world too"
    return world


def finished(world, job):
    for _ in range(round(10.0 / DT)):
        if job.verdict is not None:
            return job.verdict
        world.step()
    raise AssertionError("the task does not end")


def test_the_hand_preshapes_closes_on_nothing_and_opens():
    world = calibrated()
    assert world.hand.calibrate("fast") and world.hand.reason == Reason.HAND_REFUSED, "only by force"
    assert finished(world, world.hand.begin("hand_preshape", mode="cylindrical", level="medium")).ok
    assert finished(world, world.hand.begin("hand_close", speed=255)).done
    assert min(world.hand.positions[2:]) > 200 and world.cell.truth()["hand_closure"] > 0.8
    assert finished(world, world.hand.begin("hand_open", speed=255)).ok and max(world.hand.positions[2:]) < 20


def test_a_new_goal_ends_the_running_one():
    world = calibrated()
    first = world.hand.begin("hand_close", speed=50)
    stepped(world, 0.2)
    second = world.hand.begin("hand_open", speed=255)
    assert first.verdict.reason == Reason.SUPERSEDED and world.hand.job is second
    world.hand.end(first, "late", Reason.CANCELLED)
    assert world.hand.job is second, "an ended goal does not change"
    world.hand.end(second, "enough", Reason.CANCELLED)
    before = world.cell.truth()["hand_closure"]
    assert stepped(world, 0.3).cell.truth()["hand_closure"] == pytest.approx(before, abs=0.05), "the fingers stop"


def test_a_locale_with_decimal_commas_changes_no_number(tmp_path):
    (tmp_path / "source").write_text(
        'LC_NUMERIC\ndecimal_point "<U002C>"\nthousands_sep ""\ngrouping -1\nEND LC_NUMERIC\n'
    )
    (tmp_path / "letters").write_text("<escape_char> /\n<mb_cur_max> 1\nCHARMAP\n<U002C> /x2c COMMA\nEND CHARMAP\n")
    made = ["localedef", "-c", "-i", tmp_path / "source", "-f", tmp_path / "letters", tmp_path / "xx_XX"]
    subprocess.run(made, capture_output=True, check=False)  # it warns of missing categories
    program = (
        "import locale, lwr_fri_bridge\n"
        "from coglab_py.packages import package_path\n"
        "from coglab_trials import Conditions, World\n"
        "locale.setlocale(locale.LC_NUMERIC, 'xx_XX'); assert locale.localeconv()['decimal_point'] == ','\n"
        "limits = str(package_path('lwr_description', 'config', 'joint_limits.yaml'))\n"
        "lwr_fri_bridge.Bridge(limits, control_mode='joint_impedance stiffness 500.5'); World(3, Conditions())\n"
    )
    subprocess.run([sys.executable, "-c", program], env={**os.environ, "LOCPATH": str(tmp_path)}, check=True)
