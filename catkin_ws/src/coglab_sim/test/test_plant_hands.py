"""Objects that the robot's and the person's hand can hold in the plant, or not: contact, friction, limited grip."""

import numpy as np
import pytest
from coglab_sim import _cell
from grasp_trial import BOX, DIRECTIONS, HOME, STEP, URDF, G, GraspTrial, objects, rotated, run
from ih2_hand.clock import SteppedClock
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.physical_motor import MotorState


@pytest.mark.parametrize("name", ["mug", "ball", "tea_box"])
def test_a_grasp_holds_under_shaking_and_lets_go(name):
    trial = GraspTrial(objects()[name], "index up")
    outcome = trial.run()
    assert not outcome.lost and outcome.slip <= 0.003 and outcome.released <= 0.3
    assert trial.plant.state()["person_share"] == 0.0


def test_a_grasp_without_friction_is_lost():
    """The fingers close around a bottle; then its friction is set to zero."""
    bottle = objects()["bottle"]
    with pytest.raises(ValueError, match="'bottle'"):
        GraspTrial({**bottle, "friction": 0.02}, "index up")
    trial = GraspTrial(bottle, "index up")
    trial.close()
    trial.plant.set_object({**bottle, "friction": 0.02})
    slip, _, lost = trial.shake(seconds=0.5)
    assert lost or slip > 0.02


INDEX, MIDDLE = (3, 4), (5, 6)
"""phalanges of the hand's table, from the thumb's three on"""


def bent(plant, phalanges):
    """rad, of these joints together; fingers stand before all that is free, so that both numberings agree."""
    positions, joints = np.frombuffer(plant.bytes()), plant.terms()["fingers"]
    return sum(positions[joints[i]] for i in phalanges)


def test_relaxed_by_the_hands_own_command_a_grasp_lets_go():
    """The bytes 6F 00 to the emulated hand, whose motors the plant turns: the tendons unwind, the object is free."""
    trial, clock = GraspTrial(objects()["mug"], "index up"), SteppedClock()
    trial.close()
    plant, hand = trial.plant, EmulatedHand(clock, greeting=True, physical=True)
    states = ("position", "current", "effort", "moving", "locked")

    def go(seconds):
        for _ in range(round(seconds / 0.005)):
            clock.now += 0.005
            hand.follow([MotorState(*(motor[name] for name in states)) for motor in plant.motors()])
            hand.advance()
            for motor, (speed, target, current) in enumerate(hand.orders()):
                plant.command_motor(motor, target, speed, current)
            plant.hold(HOME, steps=5)

    go(0.5)
    held, _ = trial.in_palm()
    assert plant.state()["held_by"] == "robot", "a hand that was told nothing holds on"
    hand.receive(bytes([0x6F, 0x00, 0x00, 0x14]))
    go(0.5)
    assert plant.state()["held_by"] == "none"
    go(1.2)
    assert np.linalg.norm(trial.in_palm()[0] - held) > 0.1
    assert all(motor["position"] < 0.001 for motor in plant.motors()[1:])
    assert bent(plant, INDEX + MIDDLE) < 0.05


def test_in_the_robots_hand_nothing_but_contact_holds():
    """From the moment on at which it is placed: the same plant whose fingers then open lets it go."""
    trial = GraspTrial(objects()["mug"], "palm down")
    assert trial.plant.state()["held_by"] == "robot"
    held, _ = trial.in_palm()
    trial.plant.hold(HOME, steps=1000)
    assert np.linalg.norm(trial.in_palm()[0] - held) < 0.003
    assert trial.open() <= 0.3
    trial.plant.hold(HOME, steps=300)
    assert np.linalg.norm(trial.in_palm()[0] - held) > 0.1


@pytest.mark.parametrize("place", [[0.04, 0.30, 0.0], [0.25, 0.0, 0.05], [-0.12, 0.0, 0.05]])
def test_out_of_the_fingers_reach_nothing_is_placed_in_the_robots_hand(place):
    """Beside the hand, before it, behind it."""
    plant = _cell.Plant(URDF, HOME, objects()["mug"], board=False)
    before = plant.bytes()
    with pytest.raises(ValueError, match="'mug'.*closed"):
        plant.place("robot_hand", place, [-0.5, -0.5, -0.5, 0.5])
    assert plant.bytes() == before, "nothing has changed"


def test_motors_stop_at_contact_and_lock():
    trial = GraspTrial(objects()["mug"], "index up")
    trial.close()
    motors = trial.plant.motors()
    for motor, limit in zip(motors[1:], (90.0, 90.0, 90.0, 180.0), strict=True):
        assert motor["locked"] and motor["current"] == 0.0 and 0.1 < motor["position"] < 0.9
        # 240 counts are half of the limit; fingers that close later pull a locked gear further.
        assert 0.7 * 0.5 * limit < motor["tension"] < 1.25 * 0.5 * limit
    alone = GraspTrial(objects()["mug"], "index up", grasped=False)
    where, turn = alone.before_palm()
    alone.plant.place("human_hand", [-0.08, 0.0, -0.05], turn)  # somebody holds it against the finger
    alone.plant.set_person(where + [0.08, 0.0, 0.05], grip=1.0, grip_force=40.0)
    alone.plant.command_motor(2, 1.0, 1.0, 240.0)
    alone.plant.hold(HOME, steps=1600)
    index = alone.plant.motors()[2]
    assert index["locked"] and 0.9 * 0.5 * 90.0 < index["tension"] <= 0.5 * 90.0  # the object gives way a little
    empty = _cell.Plant(URDF, HOME, BOX)
    for motor in range(1, 5):
        empty.command_motor(motor, 1.0)
    empty.hold(HOME, steps=1600)
    assert all(motor["position"] > 0.999 and motor["current"] == 0.0 for motor in empty.motors()[1:])


def test_touch_is_where_the_object_is():
    trial = GraspTrial(objects()["mug"], "palm up")
    trial.close()
    touch = trial.plant.touch()
    assert touch["palm"][0] < -5.0  # the object presses into the palm
    for finger in ("index", "middle", "ring", "little"):
        assert touch[f"{finger}_distal"][0] > 1.0  # fingers are pushed away from it
    assert touch["thumb_distal"][2] < -1.0
    # Everything that touches the object is the robot's: the forces carry its weight.
    total = sum(np.asarray(force) for force in touch.values())
    assert np.linalg.norm(total) == pytest.approx(objects()["mug"]["mass"] * G, rel=0.05)


WEIGHT = 0.31 * G


def carried(grip_force, weight, seconds=1.5):
    """A mug of ``weight`` N in a person's hand: the state after a time, or when it has fallen."""
    plant = _cell.Plant(URDF, HOME, {**objects()["mug"], "mass": weight / G}, board=False)
    plant.set_brakes(True)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    for _ in range(int(seconds / STEP / 10)):
        plant.set_person([0.9, 0.3, 0.9], grip=1.0, grip_force=grip_force)
        state = run(plant, 0.01)
        if state["object"][0][2] < 0.0:
            break
    return state


@pytest.mark.parametrize("grip_force", [1.0, 4.0, 10.0, 20.0])
def test_a_persons_hold_lets_go_of_what_grip_and_friction_do_not_carry(grip_force):
    """Two sides press: 2 mu F. Below the weight too, and it is gone for good: a closed hand does not find it again."""
    limit = 2.0 * objects()["mug"]["friction"] * grip_force
    held = carried(grip_force, 0.9 * limit)
    assert held["held_by"] == "human" and held["object"][0][2] > 0.7
    assert held["person_force"] == pytest.approx([0.0, 0.0, -0.9 * limit], abs=0.05)
    lost = carried(grip_force, 1.2 * limit)
    assert lost["held_by"] in ("none", "floor") and lost["object"][0][2] < 0.5
    assert lost["person_force"] == pytest.approx(np.zeros(3), abs=0.05 * limit)


def test_the_hand_feels_what_its_own_grip_carries():
    """The whole weight; nothing if the mug lies on the floor; its own part if the robot holds, too."""
    assert carried(20.0, WEIGHT)["person_force"] == pytest.approx([0.0, 0.0, -WEIGHT], abs=0.01)
    trial = GraspTrial(objects()["mug"], "index up")
    plant, hand = trial.plant, trial.plant.state()["object"][0] + [0.08, 0.0, 0.05]
    for step in range(1600):
        plant.set_person(hand + [0.0, 0.0, 0.004 if step > 800 else 0.0], grip=1.0)
        plant.hold(HOME)
    state = plant.state()
    assert -0.9 * WEIGHT < state["person_force"][2] < -0.2 * WEIGHT
    weight = 0.31 * 9.81 * rotated(plant.state()["palm"][1], np.array(DIRECTIONS["index up"], dtype=float))
    assert state["person_force"] + state["object_force"] == pytest.approx(weight, abs=0.05)


def test_a_hand_does_not_feel_its_own_motion_as_a_load():
    """Swung with 2 m/s^2 at 0.5 Hz; the acceleration alone would need a grip of 0.6 N."""
    plant = _cell.Plant(URDF, HOME, objects()["mug"], board=False)
    plant.set_brakes(True)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    rate, felt = np.pi, []
    for step in range(3000):
        t = STEP * step
        if step % 10 == 0:
            at, speed = 2.0 / rate**2 * np.cos(rate * t), -2.0 / rate * np.sin(rate * t)
            plant.set_person([0.9, 0.3 + at, 0.9], velocity=[0.0, speed, 0.0], grip=1.0)
        run(plant, STEP)
        felt.append(plant.state()["person_force"])
    assert np.abs(np.array(felt[1000:]) - [0.0, 0.0, -WEIGHT]).max() < 0.15


def test_a_person_who_takes_carries_what_they_lift():
    """A grip on an object that the robot holds takes no load; the hand must rise."""
    trial = GraspTrial(objects()["mug"], "index up")
    trial.close()
    plant = trial.plant
    gravity = 9.81 * rotated(plant.state()["palm"][1], np.array(DIRECTIONS["index up"], dtype=float))
    assert np.allclose(gravity, [0.0, 0.0, -G], atol=0.5)
    hand = plant.state()["object"][0] + [0.08, 0.0, 0.05]
    shares = []
    for lift in (0.0, 0.006):
        for _ in range(800):
            plant.set_person(hand + [0.0, 0.0, lift], grip=1.0)
            plant.hold(HOME)
        assert plant.state()["held_by"] == "both"
        shares.append(plant.state()["person_share"])
    assert shares[0] < 0.15 and shares[1] > 0.6


def test_held_object_turns_with_the_persons_hand():
    """The grip acts at the object's center of mass, here 10 cm from its own origin, and knows how fast that moves."""
    plant, here, center = _cell.Plant(URDF, HOME, {**BOX, "center": [0, 0, 0.1]}), np.array([1.0, 0.3, 0.9]), 0.1

    def in_hand():
        state = plant.state()
        (hand, turn), (thing, _) = state["person_hand"], state["object"]
        return rotated(np.append(-np.array(turn[:3]), turn[3]), np.array(thing) - np.array(hand))

    plant.set_person(here, grip=1.0, grip_force=200.0)
    plant.place("human_hand", [-0.08, 0.0, -center])
    run(plant, 0.2)
    before, moved = in_hand(), 0.0
    for step in range(500):
        half = 1e-3 * (step + 1)  # rad, at 2 rad/s
        plant.set_person(here, [0.0, np.sin(half), 0.0, np.cos(half)], grip=1.0, grip_force=200.0)
        run(plant, STEP)
        moved = max(moved, np.linalg.norm(in_hand() - before))
    assert plant.state()["held_by"] == "human" and moved < 0.002, moved
