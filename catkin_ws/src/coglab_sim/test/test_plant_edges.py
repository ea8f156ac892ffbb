"""Edge cases of the plant: accepted depths, begin and end of grips, hands without messages, brakes, blocks, pushes."""

import numpy as np
import pytest
from coglab_sim import _cell
from grasp_trial import BOARD_TOP, HOME, STEP, URDF, G, objects, run

MUG = objects()["mug"]
WEIGHT = MUG["mass"] * G


def still(thing=MUG, board=False, **parameters):
    """A plant whose arm stands on its brakes."""
    plant = _cell.Plant(URDF, HOME, thing, board=board, **parameters)
    plant.set_brakes(True)
    return plant


def same(one, two):
    """True if two quaternions are the same rotation."""
    return abs(np.dot(one, two)) == pytest.approx(1.0, abs=1e-9)


# -- placing ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [[0, 0, 0, 0.998], [0, 0, 0, 1.002], [0, 0, 0, np.nan]])
def test_invalid_poses_are_refused(turn):
    plant = still()
    for call in (lambda: plant.place("world", [1.0, 0.0, 1.0], turn), lambda: plant.set_person([1.0, 0.0, 1.0], turn)):
        with pytest.raises(ValueError, match="quaternion"):
            call()
    with pytest.raises(ValueError, match="finite"):
        plant.place("world", [1.0, np.inf, 1.0])
    plant.place("world", [1.0, 0.0, 1.0], [0, 0, 0, 1.0005])


def test_a_hand_that_was_refused_is_not_there():
    plant = still()
    with pytest.raises(ValueError, match="person's hand"):
        plant.set_person(plant.state()["palm"][0] - [0.15, 0.0, 0.0])
    state = run(plant, 0.1)
    assert state["person_hand"][0] == pytest.approx([1.30, 0.20, 0.15], abs=2e-5)
    assert state["object"][0] == pytest.approx([1.22, 0.20, 0.10], abs=2e-5), "what it holds stands with it"


def test_a_person_who_would_bring_the_object_into_something_is_not_there():
    plant = still(board=True)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    with pytest.raises(ValueError, match="'mug'.* board"):
        plant.set_person(BOARD_TOP + [0.08, 0.0, 0.04])
    plant.set_person(BOARD_TOP + [0.08, 0.0, 0.06])
    assert plant.state()["object"][0] == pytest.approx(BOARD_TOP + [0.0, 0.0, 0.01])


def test_an_object_that_is_put_into_a_moving_hand_goes_with_it():
    plant = still()
    here = np.array([0.9, 0.3, 0.9])
    for step in range(200):
        plant.set_person(here + [0.0, 0.0, 0.0002 * step], velocity=[0.0, 0.0, 0.2])
        run(plant, STEP)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    assert plant.state()["object_velocity"] == pytest.approx([0.0, 0.0, 0.2], abs=0.02)
    plant.place("world", [1.5, 1.0, 0.5])
    assert not plant.state()["object_velocity"].any()


def test_an_object_in_the_robots_hand_is_held_from_the_beginning():
    plant = still()
    plant.place("robot_hand", [0.04, 0.0, 0.0], [-0.5, -0.5, -0.5, 0.5])
    state = plant.state()
    assert state["held_by"] == "robot" and state["robot_share"] == pytest.approx(1.0, abs=0.1)
    assert np.linalg.norm(state["object_force"] - [0, 0, -WEIGHT]) < 0.2 and not state["object_velocity"].any()
    motors = plant.motors()
    assert motors[0]["position"] == pytest.approx(245 / 255, abs=1e-6)
    assert all(motor["locked"] and 0.1 < motor["position"] < 0.95 for motor in motors[1:])
    speeds = np.frombuffer(plant.bytes())[-len(plant.terms()["mass"]) :]
    assert not speeds[plant.terms()["fingers"]].any() and not speeds[plant.terms()["arm"]].any()
    where = plant.state()["object"][0].copy()
    assert np.linalg.norm(run(plant, 0.5)["object"][0] - where) < 0.002


# -- the person's hand --------------------------------------------------------------------------------------------


def test_a_hand_goes_on_for_100_ms_after_its_message_and_then_stands():
    plant = still()
    here = np.array([0.9, 0.3, 0.9])
    plant.set_person(here, velocity=[0.4, 0.0, 0.0])
    run(plant, 0.03)
    plant.set_person(here + [0.012, 0.0, 0.0], velocity=[0.4, 0.0, 0.0])
    state = run(plant, 1.0)
    # It ends 0.4 m/s x 100 ms beyond the pose of the last message.
    assert state["person_hand"][0] == pytest.approx(here + [0.012 + 0.040, 0.0, 0.0], abs=6e-4)
