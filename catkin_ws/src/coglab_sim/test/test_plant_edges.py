"""The plant at its edges: depths that are accepted, grips that begin and end, hands that nobody speaks for, brakes,
blocks and pushes."""

import re

import numpy as np
import pytest
from coglab_sim import _plant
from grasp_trial import BOARD_TOP, BOX, HOME, STEP, URDF, G, objects, rotated, run
from scipy.spatial.transform import Rotation

MUG = objects()["mug"]
TURN = Rotation.from_euler("xyz", [0.3, -0.5, 1.1]).as_quat()
WEIGHT = MUG["mass"] * G


def still(thing=MUG, board=False, **parameters):
    """A plant whose arm stands on its brakes."""
    plant = _plant.Plant(URDF, HOME, thing, board=board, **parameters)
    plant.set_brakes(True)
    return plant


def same(one, two):
    """Whether two quaternions are the same rotation."""
    return abs(np.dot(one, two)) == pytest.approx(1.0, abs=1e-9)


# -- placing ------------------------------------------------------------------------------------------------------


def test_what_is_placed_is_there_turned_as_asked():
    plant = still()
    plant.place("world", [0.8, 0.2, 1.0], TURN)
    where, turn = plant.state()["object"]
    assert where == pytest.approx([0.8, 0.2, 1.0], abs=1e-12) and same(turn, TURN)
    plant.set_person([1.0, 0.3, 0.9], TURN)
    hand, turned = plant.state()["person_hand"]
    assert hand == pytest.approx([1.0, 0.3, 0.9]) and same(turned, TURN)
    plant.place("human_hand", [-0.08, 0.01, -0.05], TURN)
    where, turn = plant.state()["object"]
    assert where == pytest.approx(hand + rotated(TURN, np.array([-0.08, 0.01, -0.05])), abs=1e-9)
    twice = Rotation.from_quat(TURN) * Rotation.from_quat(TURN)
    assert same(turn, twice.as_quat())


@pytest.mark.parametrize("turn", [[0, 0, 0, 0.998], [0, 0, 0, 1.002], [0, 0, 0, np.nan]])
def test_poses_that_are_none_are_refused(turn):
    plant = still()
    for call in (lambda: plant.place("world", [1.0, 0.0, 1.0], turn), lambda: plant.set_person([1.0, 0.0, 1.0], turn)):
        with pytest.raises(ValueError, match="a pose needs finite numbers and a quaternion x y z w of length 1"):
            call()
    with pytest.raises(ValueError, match="a pose needs finite numbers"):
        plant.place("world", [1.0, np.inf, 1.0])
    plant.place("world", [1.0, 0.0, 1.0], [0, 0, 0, 1.0005])


def test_calls_that_nobody_can_answer():
    plant = still()
    with pytest.raises(ValueError, match="an object has no 'colour'; known: id, mass, shape, size, center, friction"):
        plant.set_object({"colour": "red"})
    for motor in (-1, 5):
        with pytest.raises(ValueError, match=f"motor is {motor}, expected 0 .. 4"):
            plant.command_motor(motor, 1.0)
    plant.command_motor(4, 1.0)
    plant.command_motor(0, 1.0)
    for dt in (0.0, -1e-3, 1.01e-3):
        with pytest.raises(ValueError, match="a step of the plant is at most 0.001 s"):
            plant.step(np.zeros(7), dt)
    with pytest.raises(ValueError, match="unknown placement 'moon'; known: human_hand, robot_hand, world"):
        plant.place("moon", [0, 0, 0])


@pytest.mark.parametrize("depth, accepted", [(0.0028, True), (0.0032, False)])
def test_three_millimetres_inside_the_board_are_accepted(depth, accepted):
    plant = still(BOX, board=True)
    place = BOARD_TOP - [0.0, 0.0, depth]
    if accepted:
        plant.place("world", place)
        return
    before = plant.bytes()
    with pytest.raises(ValueError) as refusal:
        plant.place("world", place)
    assert str(refusal.value) == (
        "object 'box' would stand 3.2 mm inside board there, at most 3 mm are accepted; place it elsewhere"
    )
    assert plant.bytes() == before


def test_a_finger_may_stand_eight_millimetres_in_an_object():
    """A ball of 15 mm before the middle of the index's last phalanx, whose radius is 8 mm."""
    ball = {"id": "ball", "mass": 0.1, "shape": "sphere", "size": [0.03] * 3, "center": [0, 0, 0], "friction": 0.6}
    plant = still(ball)
    palm, turn = plant.state()["palm"]
    for away, accepted in ((0.0155, True), (0.0145, False)):
        # The palm's frame lies (17.5, 0, 75) mm in the hand, the phalanx from 154 to 194 mm, 30 mm aside.
        where = palm + rotated(turn, np.array([away - 0.0175, 0.03, 0.174 - 0.075]))
        try:
            plant.place("world", where)
            found = ""
        except ValueError as error:
            found = str(error)
        depths = re.findall(r"would stand ([\d.]+) mm inside (\w+) there, at most (\d+) mm", found)
        assert bool(depths) is not accepted, found
        if depths:
            assert (
                depths[0][1].startswith("index_")
                and depths[0][2] == "8"
                and float(depths[0][0]) == pytest.approx(8.5, abs=0.2)
            )


def test_the_person_is_named_and_the_floor_too():
    plant = still()
    plant.set_person([0.9, 0.3, 0.9])
    with pytest.raises(
        ValueError, match=r"object 'mug' would stand \d+(\.\d)? mm inside the person's hand there, at most 3"
    ):
        plant.place("world", [1.05, 0.3, 0.85])
    with pytest.raises(ValueError, match="object 'mug' would stand .* mm inside floor there"):
        plant.place("world", [1.5, 1.0, -0.79])
    plant.place("world", [1.5, 1.0, -0.752])


def test_nothing_is_known_of_an_object_that_has_just_been_placed():
    plant = still()
    plant.set_person([0.9, 0.3, 0.9], grip=1.0)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    run(plant, 0.3)
    assert plant.state()["person_share"] > 0.9
    plant.place("world", [1.5, 1.0, -0.749])
    run(plant, 0.2)
    assert plant.state()["dropped"] and plant.state()["held_by"] == "floor"
    plant.place("world", [1.5, 1.0, 0.5])
    state = plant.state()
    assert not state["dropped"] and state["held_by"] == "none"
    assert (state["robot_share"], state["person_share"]) == (0.0, 0.0)
    assert not state["person_force"].any() and not state["object_force"].any()


def test_before_the_person_has_come_hand_and_object_stand_still():
    plant = still()
    for placed in (False, True):
        if placed:
            plant.place("human_hand", [-0.09, 0.02, -0.04], TURN)
        state = run(plant, 0.2)
        # Gravity acts for one step, and is undone before the next one.
        assert state["held_by"] == "human" and np.linalg.norm(state["object_velocity"]) < 1.1 * G * STEP
        assert state["person_hand"][0] == pytest.approx([1.30, 0.20, 0.15], abs=2e-5)
        where = [-0.09, 0.02, -0.04] if placed else [-0.08, 0.0, -0.05]
        assert state["object"][0] == pytest.approx(np.array([1.30, 0.20, 0.15]) + where, abs=2e-5)


def test_a_hand_that_was_refused_is_not_there():
    plant = still()
    with pytest.raises(ValueError, match="the person's hand would stand"):
        plant.set_person(plant.state()["palm"][0] - [0.15, 0.0, 0.0])
    state = run(plant, 0.1)
    assert state["person_hand"][0] == pytest.approx([1.30, 0.20, 0.15], abs=2e-5)
    assert state["object"][0] == pytest.approx([1.22, 0.20, 0.10], abs=2e-5), "what it holds stands with it"


def test_a_person_who_would_bring_the_object_into_something_is_not_there():
    plant = still(board=True)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    with pytest.raises(ValueError, match="object 'mug' would stand .* inside board in that hand"):
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


def test_another_object_leaves_everything_else_as_it_was():
    plant = still()
    plant.set_gravity([0.0, 0.0, -3.0])
    plant.set_person([0.9, 0.3, 0.9])
    before = plant.bytes()
    plant.set_object({**BOX, "mass": 0.2})
    assert plant.bytes() == before
    plant.place("world", [1.5, 1.0, 0.9])
    assert run(plant, 0.1)["object_velocity"][2] == pytest.approx(-0.3, rel=1e-6)
    with pytest.raises(ValueError, match="object 'box' would stand"):
        plant.place("world", [1.5, 1.0, -0.79])


# -- the person's hand --------------------------------------------------------------------------------------------


def test_a_hand_goes_on_for_50_ms_after_its_message_and_then_stands():
    plant = still()
    here = np.array([0.9, 0.3, 0.9])
    plant.set_person(here, velocity=[0.4, 0.0, 0.0])
    run(plant, 0.03)
    plant.set_person(here + [0.012, 0.0, 0.0], velocity=[0.4, 0.0, 0.0])
    state = run(plant, 1.0)
    # It was wanted 0.4 m/s x 50 ms farther than the last message said.
    assert state["person_hand"][0] == pytest.approx(here + [0.012 + 0.020, 0.0, 0.0], abs=6e-4)


def test_a_hand_is_held_where_it_is_wanted_and_gives_way_to_force():
    """0.5 kg at 40 rad/s, critically damped; 60 N at most; its weight is carried."""
    plant = still()
    here = np.array([0.9, 0.3, 0.9])
    plant.set_person(here)
    assert run(plant, 0.5)["person_hand"][0] == pytest.approx(here, abs=1e-4)
    times, way = [], []
    for step in range(200):
        plant.set_person(here + [0.001, 0.0, 0.0])
        way.append(run(plant, STEP)["person_hand"][0][0] - here[0])
        times.append(STEP * (step + 1))
    expected = 0.001 * (1.0 - (1.0 + 40.0 * np.array(times)) * np.exp(-40.0 * np.array(times)))
    assert way == pytest.approx(expected, abs=6e-5)
    far = still()
    far.set_person(here)
    speeds = []
    for _ in range(20):
        far.set_person(here + [3.0, 0.0, 0.0])
        speeds.append(run(far, STEP)["person_hand"][0][0] - here[0])
    acceleration = (speeds[4] - 2 * speeds[3] + speeds[2]) / STEP**2
    assert acceleration == pytest.approx(60.0 / 0.5, rel=0.15), "60 N, however far it is wanted"


def test_a_hand_that_is_wanted_far_away_lags_15_cm_at_most():
    """So that the force of its arm is at most 0.5 kg (40 rad/s)^2 0.15 m, were it not limited to less."""
    plant = still()
    plant.set_person([0.9, 0.3, 0.9])
    for _ in range(600):
        plant.set_person([1.9, 0.3, 0.9])
        state = run(plant, STEP)
    speed = np.diff([state["person_hand"][0][0], run(plant, STEP)["person_hand"][0][0]])[0] / STEP
    assert 0.0 <= speed < 5.0 and state["person_hand"][0][0] > 1.5


@pytest.mark.parametrize("grip, holds", [(0.049, False), (0.051, True)])
def test_a_grip_begins_at_a_twentieth(grip, holds):
    plant = still()
    plant.set_person([0.9, 0.3, 0.9])
    plant.place("world", [0.82, 0.3, 0.85])
    plant.set_gravity([0.0, 0.0, 0.0])
    plant.set_person([0.9, 0.3, 0.9], grip=grip)
    assert (run(plant, 0.01)["held_by"] == "human") is holds


@pytest.mark.parametrize("grip, holds", [(0.021, True), (0.019, False)])
def test_a_grip_ends_at_a_fiftieth(grip, holds):
    plant = still()
    plant.set_gravity([0.0, 0.0, 0.0])
    plant.set_person([0.9, 0.3, 0.9], grip=1.0)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    run(plant, 0.05)
    plant.set_person([0.9, 0.3, 0.9], grip=grip)
    assert (run(plant, 0.01)["held_by"] == "human") is holds


@pytest.mark.parametrize("away, finds", [(0.059, True), (0.061, False)])
def test_fingers_find_an_object_within_six_centimetres(away, finds):
    plant = still()
    plant.set_gravity([0.0, 0.0, 0.0])
    plant.set_person([0.9, 0.3, 0.9])
    plant.place("world", [0.9 - 0.04 - away, 0.3, 0.85])
    plant.set_person([0.9, 0.3, 0.9], grip=1.0)
    assert (run(plant, 0.01)["held_by"] == "human") is finds


def slid(away, first=0.04):
    """Who holds a mug that is pulled out of the hand, which closed ``first`` m from its surface, so far in all."""
    plant = still()
    plant.set_gravity([0.0, 0.0, 0.0])
    hand = np.array([0.9, 0.3, 0.9])
    plant.set_person(hand, grip=0.06, grip_force=1.0)
    plant.place("human_hand", [-0.04 - first, 0.0, -0.05])
    run(plant, 0.02)
    for x in np.arange(0.0, away - first, 0.0005):
        plant.set_person(hand + [x, 0.0, 0.0], grip=0.06, grip_force=0.01)
        run(plant, 0.002)
    run(plant, 0.2)
    state = plant.state()
    gap = abs(state["object"][0][0] - state["person_hand"][0][0]) - 0.04
    return state["held_by"], gap, plant


def test_an_object_has_slid_out_two_centimetres_beyond_the_reach_of_the_grip():
    for first, reach in ((0.04, 0.06), (0.10, 0.10)):
        held, gap, _ = slid(reach + 0.015, first)
        assert held == "human", gap
        lost, gap, plant = slid(reach + 0.03, first)
        assert lost == "none" and gap > reach + 0.015
    # A closed hand that has lost it has to open first.
    where = plant.state()["object"][0] + [0.08, 0.0, 0.05]
    for grip, held in ((1.0, "none"), (0.0, "none"), (1.0, "human")):
        for _ in range(300):
            plant.set_person(where, grip=grip, grip_force=1.0)
            run(plant, STEP)
        assert plant.state()["held_by"] == held


def test_shares_and_forces_are_means_over_20_ms():
    plant = still()
    plant.set_person([0.9, 0.3, 0.9], grip=1.0)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    run(plant, 0.5)
    assert plant.state()["person_share"] == pytest.approx(1.0, abs=1e-3)
    plant.set_person([0.9, 0.3, 0.9], grip=0.0)
    for milliseconds in (10, 20, 40):
        shares = run(plant, 0.01 if milliseconds < 40 else 0.02)
        assert shares["person_share"] == pytest.approx(np.exp(-milliseconds / 20), rel=0.03)
        assert shares["person_force"][2] == pytest.approx(-WEIGHT * np.exp(-milliseconds / 20), rel=0.05)


def test_a_turning_hand_takes_the_object_along():
    """Held 80 mm before the hand and turned by 0.5 rad about the vertical: it ends where it belongs."""
    plant = still()
    here = np.array([0.9, 0.3, 0.9])
    plant.set_person(here, grip=1.0, grip_force=40.0)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    for step in range(1000):
        turn = Rotation.from_rotvec([0.0, 0.0, min(0.5, 0.001 * step)])
        plant.set_person(here, turn.as_quat(), grip=1.0, grip_force=40.0)
        state = run(plant, STEP)
        where = state["person_hand"][0] + Rotation.from_quat(state["person_hand"][1]).apply([-0.08, 0.0, -0.05])
        assert np.linalg.norm(state["object"][0] - where) < 0.004
    assert same(state["object"][1], turn.as_quat()) or np.abs(np.dot(state["object"][1], turn.as_quat())) > 0.9999
