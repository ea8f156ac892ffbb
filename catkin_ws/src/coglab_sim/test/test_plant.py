"""The physics of the cell against what mechanics says: falling, swinging, sliding, energy; grasps; bad input."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from coglab_sim import _plant
from grasp_trial import DIRECTIONS, HOME, SOURCES, URDF, GraspTrial, objects, rotated
from scipy.special import ellipk

G = 9.81
STEP = 1e-3
BOX = {"id": "box", "mass": 0.5, "shape": "box", "size": [0.08, 0.08, 0.04], "center": [0, 0, 0.02], "friction": 0.5}
BOARD_TOP = np.array([0.45, -0.55, 0.05])


def drives(inertia, friction=0.0):
    figures = _plant.Drives()
    figures.rotor_inertia = np.asarray(inertia, dtype=float)
    figures.coulomb_friction = np.full(7, friction)
    return figures


def run(plant, seconds, dt=STEP, torque=None):
    for _ in range(round(seconds / dt)):
        plant.step(np.zeros(7) if torque is None else torque, dt)
    return plant.state()


def undamped(tmp_path):
    """The robot description without friction of the joints."""
    tree = ET.parse(URDF)
    for joint in tree.getroot().findall("joint"):
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
    path = tmp_path / "undamped.urdf"
    tree.write(path)
    return str(path)


def test_free_fall():
    plant = _plant.Plant(URDF, HOME, BOX)
    plant.set_brakes(True)
    plant.place("world", [1.5, 1.0, 2.0])
    steps = 500
    state = run(plant, steps * STEP)
    # Semi-implicit Euler falls by g h^2 n (n + 1) / 2 exactly.
    assert state["object"][0][2] == pytest.approx(2.0 - G * STEP**2 * steps * (steps + 1) / 2, abs=1e-9)
    assert np.allclose(state["object"][0][:2], [1.5, 1.0], atol=1e-12)
    assert state["object_velocity"][2] == pytest.approx(-G * steps * STEP, rel=1e-9)


@pytest.mark.parametrize("swing", [0.2, 1.5])
def test_pendulum(tmp_path, swing):
    """The whole arm swings about A1, gravity across it; its period is that of a physical pendulum of any amplitude."""
    plant = _plant.Plant(undamped(tmp_path), np.zeros(7), BOX, drives=drives([0.0] + [1e6] * 6))
    plant.set_arm([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    plant.set_gravity([-G, 0.0, 0.0])
    terms = plant.terms()
    inertia = terms["mass"][0, 0]
    torques = []
    for angle in (0.0, np.pi / 2):
        plant.set_arm([angle, 1.0, 0, 0, 0, 0, 0])
        torques.append(-plant.terms()["bias"][0])
    amplitude = np.hypot(*torques)  # torque = amplitude sin(rest - angle)
    rest = np.arctan2(torques[0], -torques[1])
    plant.set_arm([rest + swing, 1.0, 0, 0, 0, 0, 0])
    expected = 4.0 * np.sqrt(inertia / amplitude) * ellipk(np.sin(swing / 2) ** 2)
    crossings, before = [], swing
    for step in range(int(2.6 * expected / STEP)):
        plant.step(np.zeros(7))
        now = plant.state()["position"][0] - rest
        if now * before < 0:
            crossings.append(STEP * (step + before / (before - now)))
        before = now
    period = 2.0 * np.mean(np.diff(crossings))
    assert period == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("share, slides", [(0.9, False), (1.1, True)])
def test_friction_cone(share, slides):
    plant = _plant.Plant(URDF, HOME, BOX)
    plant.set_brakes(True)
    plant.place("world", BOARD_TOP)
    run(plant, 0.3)
    angle = np.arctan(share * BOX["friction"])
    plant.set_gravity(G * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
    begin = plant.state()["object"][0]
    seconds = 0.5
    way = (run(plant, seconds)["object"][0] - begin)[0]
    # The law of the cone, with the sliding that it asks for.
    expected = 0.5 * G * (np.sin(angle) - BOX["friction"] * np.cos(angle)) * seconds**2 if slides else 0.0
    assert way == pytest.approx(expected, rel=0.1 if slides else None, abs=None if slides else 1.5e-3)


def velocities(plant):
    """Of all degrees of freedom, and their mass matrix."""
    mass = plant.terms()["mass"]
    return np.frombuffer(plant.bytes())[-len(mass) :], mass


def test_energy_at_the_shipped_step_errs_as_the_integrator_does(tmp_path):
    """Semi-implicit Euler with step h: E(t) - E(0) = -h/2 [p.a] + h int dT/dq.a dt + O(h^2), p = M v, a the acceleration.

    From Taylor's series of one step against the exact motion: they differ by h^2/2 a in the position and by -h^2/2 da/dt
    in the velocity, hence the energy by h^2/2 (dE/dq.a - p.da/dt); with Lagrange's dp/dt = dT/dq - dU/dq that is the
    total differential above. dT/dq v follows from the plant's own terms: dM/dt v - C v, with C v = bias - gravity.
    Whatever the damped fingers take is taken at any step: it is measured with the fine one."""
    start, seconds = np.full(7, 0.5), 0.2
    changes = {}
    for step in (STEP, 2e-5):
        plant = _plant.Plant(undamped(tmp_path), HOME, BOX, drives=drives(np.full(7, 0.1)), board=False)
        plant.set_arm(HOME, start)
        begin = plant.energy()
        run(plant, seconds, step)
        changes[step] = plant.energy() - begin
    plant = _plant.Plant(undamped(tmp_path), HOME, BOX, drives=drives(np.full(7, 0.1)), board=False)
    still = _plant.Plant(undamped(tmp_path), HOME, BOX, drives=drives(np.full(7, 0.1)), board=False)
    plant.set_arm(HOME, start)
    speed, mass = velocities(plant)
    powers, along = [], 0.0
    for _ in range(round(seconds / STEP)):
        state, bias = plant.state(), plant.terms()["bias"][:7]
        still.set_arm(state["position"])
        coriolis = bias - still.terms()["bias"][:7]
        plant.step(np.zeros(7), STEP)
        now, mass_now = velocities(plant)
        acceleration = (now - speed) / STEP
        powers.append(speed @ mass @ acceleration)
        along += STEP * (((mass_now - mass) / STEP @ speed)[:7] - coriolis) @ acceleration[:7]
        speed, mass = now, mass_now
    expected = STEP * (along - 0.5 * (powers[-1] - powers[0]))
    error = changes[STEP] - changes[2e-5]
    kinetic = 0.5 * speed @ mass @ speed
    print(f"energy at 1 ms: error {1e3 * error:.3f} mJ, first order {1e3 * expected:.3f} mJ, of {kinetic:.2f} J")
    bound = STEP * (abs(along) + 0.5 * abs(powers[0]) + 0.5 * abs(powers[-1]))
    assert abs(error) <= bound < 0.02 * kinetic
    # What is left is of second order: a tenth of the bound at a step that is a hundredth of the motion's times.
    assert abs(error - expected) <= 0.1 * bound


def test_energy_of_a_free_arm_stays(tmp_path):
    plant = _plant.Plant(undamped(tmp_path), HOME, BOX, drives=drives(np.full(7, 0.1)), board=False)
    plant.set_arm(HOME, np.full(7, 0.5))
    begin, lowest = plant.energy(), np.inf
    for _ in range(10000):
        plant.step(np.zeros(7), 2e-5)
        lowest = min(lowest, plant.energy())
    kinetic = 0.5 * plant.state()["velocity"] @ plant.terms()["mass"][:7, :7] @ plant.state()["velocity"]
    # Fingers are damped and swing a little; the rest is the step's error.
    assert kinetic > 1.0
    assert abs(plant.energy() - begin) < 5e-3 * kinetic


def test_joint_sensors_balance_the_link_side():
    plant = _plant.Plant(URDF, HOME, BOX)
    plant.set_push([0.0, 10.0, -3.0], [0.1, 0.2, 0.3])
    plant.hold(HOME, steps=3000)
    terms = plant.terms()
    pushed = terms["jacobian"][:, :7].T @ [0.0, 10.0, -3.0, 0.1, 0.2, 0.3]
    assert np.allclose(plant.external_torque, pushed, atol=1e-6)
    assert np.allclose(plant.joint_torque, terms["bias"][:7] - pushed, atol=1e-3)


def test_brakes_hold_against_a_push_and_weigh_as_much():
    plant = _plant.Plant(URDF, HOME, BOX)
    plant.hold(HOME, np.full(7, 1.0), 300)
    plant.set_brakes(True)
    run(plant, 0.3)
    held = plant.state()["position"]
    plant.set_push([50.0, 50.0, 50.0])
    state = run(plant, 0.5)
    assert np.array_equal(state["position"], held) and not state["velocity"].any()
    pushed = plant.terms()["jacobian"][:3, :7].T @ [50.0, 50.0, 50.0]
    assert np.allclose(plant.external_torque, pushed, atol=1e-6)


FOLDED = np.array([-0.6, 0.8, -2.0, 2.0, 2.7, 2.0, 1.6])
"""the hand bent back onto the arm"""


@pytest.mark.parametrize("what", ["nothing", "itself", "the person's hand", "the object"])
def test_the_arm_collides_with_everything(what):
    """The board: test_random_velocities.py."""
    plant = _plant.Plant(URDF, HOME, BOX, board=False)
    plant.place("world", [0.0, 0.0, 1.2] if what == "the object" else [2.0, 0.0, 5.0])  # above the shoulder
    target = FOLDED if what == "itself" else HOME
    plant.set_arm(target)
    palm, turn = plant.state()["palm"]
    out, felt = rotated(turn, np.array([1.0, 0.0, 0.0])), 0.0
    for step in range(400):
        if what == "the person's hand":  # goes on until it is 2 cm deep in the palm
            plant.set_person(palm + (0.10 - 0.0003 * step) * out, grip=0.0)
        plant.hold(target)
        felt = max(felt, np.abs(plant.external_torque).max())
    assert felt == 0.0 if what == "nothing" else felt > 1.0


@pytest.mark.parametrize("name", ["mug", "ball", "tea_box"])
def test_a_grasp_holds_under_shaking_and_lets_go(name):
    trial = GraspTrial(objects()[name], "index up")
    outcome = trial.run()
    assert not outcome.lost and outcome.slip <= 0.003 and outcome.released <= 0.3
    assert trial.plant.state()["person_share"] == 0.0


def test_a_grasp_without_friction_is_lost():
    """The fingers close around a bottle that friction holds, and then it has none."""
    bottle = objects()["bottle"]
    with pytest.raises(ValueError, match="object 'bottle' cannot be placed in the robot's hand there"):
        GraspTrial({**bottle, "friction": 0.02}, "index up")
    trial = GraspTrial(bottle, "index up")
    trial.close()
    trial.plant.set_object({**bottle, "friction": 0.02})
    slip, _, lost = trial.shake(seconds=0.5)
    assert lost or slip > 0.02


def test_relaxed_fingers_give_way():
    """A finger that no tendon pulls is moved by a touch and comes back by its spring."""
    trial = GraspTrial(objects()["ball"], "palm down", grasped=False)  # the hand never closes
    trial.plant.place("world", *trial.before_palm())
    middle, _ = trial.in_palm()
    trial.plant.hold(HOME, steps=400)
    assert trial.plant.state()["held_by"] == "none"
    assert np.linalg.norm(trial.in_palm()[0] - middle) > 0.1, "nothing but its placing held the ball"


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
    plant = _plant.Plant(URDF, HOME, objects()["mug"], board=False)
    before = plant.bytes()
    with pytest.raises(ValueError, match="object 'mug' cannot be placed in the robot's hand there: closed around it,"):
        plant.place("robot_hand", place, [-0.5, -0.5, -0.5, 0.5])
    assert plant.bytes() == before, "nothing has changed"


def test_motors_stop_at_contact_and_lock():
    trial = GraspTrial(objects()["mug"], "index up")
    trial.close()
    motors = trial.plant.motors()
    for motor, limit in zip(motors[1:], (90.0, 90.0, 90.0, 180.0), strict=True):
        assert motor["locked"] and motor["current"] == 0.0 and 0.1 < motor["position"] < 0.9
        # 240 counts are half of the limit; a gear that holds is pulled further by the fingers that close after it.
        assert 0.7 * 0.5 * limit < motor["tension"] < 1.25 * 0.5 * limit
    alone = GraspTrial(objects()["mug"], "index up", grasped=False)
    where, turn = alone.before_palm()
    alone.plant.place("human_hand", [-0.08, 0.0, -0.05], turn)  # somebody holds it against the finger
    alone.plant.set_person(where + [0.08, 0.0, 0.05], grip=1.0, grip_force=40.0)
    alone.plant.command_motor(2, 1.0, 1.0, 240.0)
    alone.plant.hold(HOME, steps=1600)
    index = alone.plant.motors()[2]
    assert index["locked"] and 0.9 * 0.5 * 90.0 < index["tension"] <= 0.5 * 90.0  # the object gives way a little
    empty = _plant.Plant(URDF, HOME, BOX)
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


def test_a_person_carries_and_gives_way_beyond_their_grip():
    plant = _plant.Plant(URDF, HOME, objects()["mug"])
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    hand = np.array([0.9, 0.3, 0.5])
    for _ in range(600):
        plant.set_person(hand, grip=1.0)
        plant.hold(HOME)
    state = plant.state()
    assert state["held_by"] == "human" and state["person_share"] == pytest.approx(1.0, abs=0.02)
    assert np.linalg.norm(state["object"][0] - hand - [-0.08, 0.0, -0.05]) < 0.01
    for _ in range(600):
        plant.set_person(hand, grip=0.0)
        plant.hold(HOME)
    assert plant.state()["held_by"] in ("none", "floor") and plant.state()["object"][0][2] < 0.0


WEIGHT = 0.31 * G


def carried(grip_force, pull, seconds=1.5):
    """A mug in a person's hand that is pulled down with ``pull`` N, weight and all: the state after so long."""
    plant = _plant.Plant(URDF, HOME, objects()["mug"], board=False)
    plant.set_brakes(True)
    plant.place("human_hand", [-0.08, 0.0, -0.05])
    plant.set_gravity([0.0, 0.0, -pull / 0.31])
    for _ in range(int(seconds / STEP / 10)):
        plant.set_person([0.9, 0.3, 0.9], grip=1.0, grip_force=grip_force)
        run(plant, 0.01)
    return plant.state()


@pytest.mark.parametrize("grip_force", [1.0, 4.0, 10.0, 20.0])
def test_a_persons_hold_lets_go_of_what_grip_and_friction_do_not_carry(grip_force):
    """Two sides press: 2 mu F. Below the weight too, and it is gone for good: a closed hand does not find it again."""
    limit = 2.0 * objects()["mug"]["friction"] * grip_force
    held = carried(grip_force, 0.9 * limit)
    assert held["held_by"] == "human" and held["object"][0][2] > 0.8
    assert held["person_force"] == pytest.approx([0.0, 0.0, -0.9 * limit], abs=0.05)
    lost = carried(grip_force, 1.2 * limit)
    assert lost["held_by"] in ("none", "floor") and lost["object"][0][2] < 0.5
    assert lost["person_force"] == pytest.approx(np.zeros(3), abs=1e-6)


def test_the_hand_feels_what_its_own_grip_carries():
    """The whole weight; nothing of a mug that lies on the floor; together with the robot its own part."""
    assert carried(20.0, WEIGHT)["person_force"] == pytest.approx([0.0, 0.0, -WEIGHT], abs=0.01)
    trial = GraspTrial(objects()["mug"], "index up")
    plant, hand = trial.plant, trial.plant.state()["object"][0] + [0.08, 0.0, 0.05]
    for _ in range(800):
        plant.set_person(hand + [0.0, 0.0, 0.004], grip=1.0)
        plant.hold(HOME)
    state = plant.state()
    assert -0.9 * WEIGHT < state["person_force"][2] < -0.2 * WEIGHT
    weight = 0.31 * 9.81 * rotated(plant.state()["palm"][1], np.array(DIRECTIONS["index up"], dtype=float))
    assert state["person_force"] + state["object_force"] == pytest.approx(weight, abs=0.05)


def test_a_hand_does_not_feel_its_own_motion_as_a_load():
    """Swung by 2 m/s^2 at 0.5 Hz; what the acceleration alone asks of the grip would be 0.6 N."""
    plant = _plant.Plant(URDF, HOME, objects()["mug"], board=False)
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
    """A grip on what the robot holds takes no load by itself; the hand has to rise."""
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


def test_the_same_run_gives_the_same_bytes():
    def run_bytes():
        trial = GraspTrial(objects()["mug"], "palm down", seed=4)
        trial.close(seconds=0.7)
        trial.shake(seconds=0.2)
        return trial.plant.bytes()

    assert run_bytes() == run_bytes()


@pytest.mark.parametrize(
    "far, speed", [([1.4, 0, 0], [0, 0, 0]), ([50.0, 0, 0], [90.0, 0, 0]), ([0, 0, 0], [0, 90.0, 0])]
)
def test_a_hand_that_is_asked_for_more_than_an_arm_can_does_not_end_the_simulation(far, speed):
    plant = _plant.Plant(URDF, HOME, BOX, seed=3)
    here = np.array([1.0, 0.2, 0.4])
    plant.set_person(here)
    for step in range(3000):
        if step % 30 == 0:
            plant.set_person(here + (-1.0) ** (step // 600) * np.array(far, dtype=float), velocity=speed)
        run(plant, 0.001)
    plant.set_person(here)
    run(plant, 0.001)


def test_divergence_stops_with_seed_and_time():
    plant = _plant.Plant(URDF, HOME, BOX, seed=42)
    with pytest.raises(RuntimeError, match=r"diverged at 0\.\d+ s with seed 42: .*"):
        run(plant, 1.0, torque=np.full(7, 1e5))


@pytest.mark.parametrize("speed, diverged", [(6.0, False), (14.0, True)])
def test_no_body_is_faster_than_10_m_per_s(speed, diverged):
    """The arm stretched out, its first joint turning: far below any limit of a joint, but the hand is 1 m away."""
    stretched = np.array([0.0, 1.57, 0.0, 0.0, 0.0, 0.0, 0.0])
    plant = _plant.Plant(URDF, HOME, BOX, seed=42, board=False)
    plant.set_arm(stretched, [speed, 0, 0, 0, 0, 0, 0])
    palm = plant.terms()["jacobian"][:3, 0] * speed
    assert (np.linalg.norm(palm) > 10.0) == diverged
    if not diverged:
        run(plant, 0.02)
        return
    words = r"diverged at 0\.00\d s with seed 42: \w+ is faster than anything here can be \(10 m/s, 100 rad/s\)"
    with pytest.raises(RuntimeError, match=words):
        run(plant, 0.02)


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"shape": ""}, "object 'box': has no shape, expected box, cylinder or sphere"),
        ({"shape": "cone"}, "object 'box': unknown shape 'cone', expected box, cylinder or sphere"),
        ({"mass": 0.0}, "object 'box': mass is 0 kg, expected 0.01 .. 10"),
        ({"mass": 5000.0}, "object 'box': mass is 5000 kg, expected 0.01 .. 10"),
        ({"mass": float("nan")}, "object 'box': mass is nan kg, expected 0.01 .. 10"),
        ({"size": [0.1, 0.0, 0.1]}, r"object 'box': size\[1\] is 0 m, expected 0.001 .. 2"),
        ({"friction": -1.0}, "object 'box': friction is -1, expected 0 .. 2"),
    ],
)
def test_bad_objects_are_refused_with_words(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        _plant.Plant(URDF, HOME, {**BOX, **change})
    plant = _plant.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match=sentence):
        plant.set_object({**BOX, **change})
    assert plant.hold(HOME) is None  # the old one is still there


def test_an_object_inside_something_is_refused():
    plant = _plant.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match=r"object 'box' would stand \d+(\.\d+)? mm inside board there"):
        plant.place("world", BOARD_TOP - [0.0, 0.0, 0.015])
    with pytest.raises(ValueError, match="inside ih2_base_link there"):
        plant.place("robot_hand", [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"object 'box' would stand \d+(\.\d+)? mm inside the person's hand in that"):
        plant.place("human_hand", [0.15, 0.0, -0.02])
    plant.place("world", BOARD_TOP)
    before = plant.bytes()
    with pytest.raises(ValueError, match="inside board there"):
        plant.place("world", BOARD_TOP - [0.0, 0.0, 0.015])
    assert plant.bytes() == before, "the object stays where it was"


def test_an_object_inside_the_arm_is_refused_wherever_it_is():
    """The arm straight up, and a small box moved up its axis: where its middle is that of a link, too."""
    plant = _plant.Plant(URDF, np.zeros(7), {**BOX, "size": [0.04, 0.04, 0.04]}, board=False)
    top, accepted = plant.state()["palm"][0][2], []
    for z in np.arange(0.02, top - 0.02, 0.01):
        try:
            plant.place("world", [0.0, 0.0, z - 0.02])
            accepted.append(round(float(z), 3))
        except ValueError as error:
            assert re.search(r"object 'box' would stand \d+(\.\d+)? mm inside (lwr|ih2)_\w+ there", str(error))
    assert accepted == []


def test_a_person_who_would_stand_in_the_arm_is_not_there():
    plant = _plant.Plant(URDF, HOME, BOX)
    before, palm = plant.bytes(), plant.state()["palm"][0]
    with pytest.raises(ValueError, match=r"the person's hand would stand \d+(\.\d+)? mm inside \w+ where it comes from"):
        plant.set_person(palm - [0.15, 0.0, 0.0])
    assert plant.bytes() == before
    plant.set_person([1.0, 0.2, 0.4])


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lambda text: "", "cannot be read as a URDF"),
        (
            lambda text: text.replace(
                '<cylinder radius="0.09" length="0.11"/></geometry></collision>',
                '<mesh filename="a.stl"/></geometry></collision>',
            ),
            r":\d+: mesh is no shape for contacts; expected box, cylinder or sphere",
        ),
        (lambda text: text.replace('<mass value="2.35"/>', '<mass value="-2.35"/>', 1), "MuJoCo refuses the robot"),
        (
            lambda text: text.replace('<parent link="lwr_link_3"/>', '<parent link="nowhere"/>'),
            "names the link 'nowhere'",
        ),
        (lambda text: text.replace('name="lwr_a3" type="revolute"', 'name="lwr_a3" type="fixed"'), "expected 7 joints"),
        (lambda text: text.replace("ih2_base_link", "other_hand"), "has no link 'ih2_base_link'"),
    ],
)
def test_bad_robot_descriptions_are_refused_with_words(tmp_path, change, sentence):
    path = tmp_path / "robot.urdf"
    path.write_text(change(open(URDF).read()))
    with pytest.raises(RuntimeError, match=sentence) as error:
        _plant.Plant(str(path), HOME, BOX)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("motor: 2, pivot", "motor: 9, pivot", r"/fingers/index\[0\]/motor: expected a number in 0..4, got 9"),
        ("range: [0.0, 1.658]", "range: [1.0, 0.0]", "range: expected low before high"),
        ("mass: 0.018", "mass: heavy", r"/fingers/thumb\[0\]/mass: expected a number in 0.0001..1, got no number"),
        ("mass: 0.018", "mass: 0.9", "more than the whole hand"),
        ("tendon_stiffness: 50000.0", "", "/tendon_stiffness: expected a value, got nothing"),
        ("palm: ih2_base_link", "palm: [", "cannot be read"),
    ],
)
def test_bad_tables_of_the_hand_are_refused_with_words(tmp_path, old, new, sentence):
    text = (SOURCES / "coglab_sim" / "config" / "hand_model.yaml").read_text()
    assert old in text
    path = tmp_path / "hand.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=re.sub(r"^/", ".*/", sentence)):
        _plant.Plant(URDF, HOME, BOX, hand=str(path))


def test_bad_calls_are_refused_with_words():
    plant = _plant.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match="at most 0.001 s"):
        plant.step(np.zeros(7), 0.01)
    with pytest.raises(ValueError, match="not a finite number"):
        plant.step(np.full(7, np.nan))
    with pytest.raises(ValueError, match="unknown placement"):
        plant.place("moon", [0, 0, 0])
    with pytest.raises(ValueError, match="motor is 7, expected 0 .. 4"):
        plant.command_motor(7, 1.0)
