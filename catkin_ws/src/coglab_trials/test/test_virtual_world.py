"""The world in one process: what tracker and person are shown of it is what is there."""

import dataclasses
import importlib
import sys

import numpy as np
import pytest
from coglab_sim.person.in_cell import pose_of_truth
from coglab_sim.tracker.tracker import PerceptionSettings
from coglab_trials.conditions import CONSIDERATE
from coglab_trials.world import BOARD, DT, Robot, World


def test_the_tracker_sees_the_hand_where_it_is():
    """An arm is compliant: on the way, the hand is not where the person wants it."""
    world = World(2, CONSIDERATE)
    world.human.command("give mug")
    true, wanted = {}, {}
    step = world.human.step

    def remember(t, view):
        sample = step(t, view)
        wanted[t] = sample.frame
        return sample

    world.human.step = remember
    apart = []
    for _ in range(round(2.5 / DT)):
        t = world.t
        if world.ticks % 2 == 0:
            true[t] = pose_of_truth(world.cell.truth()["human_hand"])
        world.step()
        sight = world.sights["human_hand"]
        assert sight.frame.distance(true[sight.captured]) == pytest.approx((0.0, 0.0), abs=1e-9)
        apart.append(sight.frame.distance(wanted[sight.captured])[0])
    assert max(apart) > 0.002


def test_the_board_is_off_as_much_as_everything_that_the_tracker_sees():
    only_bias = PerceptionSettings(
        position_noise=(0, 0, 0),
        orientation_noise=0.0,
        dropout_start=0.0,
        occlusion_distance=0.0,
        swap_probability=0.0,
    )
    world = World(4, dataclasses.replace(CONSIDERATE, perception=only_bias), object_on="world")
    for _ in range(60):
        world.step()
    board, age = world.newest("board")
    assert age == 0.0 and board.distance(BOARD)[0] > 0.001
    assert np.degrees(board.distance(BOARD)[1]) == pytest.approx(1.0)
    lies = BOARD.inverse() * pose_of_truth(world.truth["object"])
    seen = board.inverse() * world.sights["object_mug"].frame
    assert seen.distance(lies) == pytest.approx((0.0, 0.0), abs=1e-4)
    perfect = World(4, CONSIDERATE)
    assert perfect.newest("board")[0].distance(BOARD) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_the_closure_that_is_seen_is_that_of_the_fingers_joints():
    """Not of the motors: a tendon that is let go gives way before its finger does."""
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


@pytest.mark.parametrize("module", ["coglab_sim._cell", "coglab_sim._virtual"])
def test_a_library_that_is_missing_is_named_with_what_to_do(monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "coglab_trials.world", raising=False)
    with pytest.raises(ImportError, match=rf"cannot be loaded \(.*{module}.*\): .*run ./coglab build.* libmujoco-dev"):
        importlib.import_module("coglab_trials.world")
