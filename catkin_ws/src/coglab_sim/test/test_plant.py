"""The physics of the cell compared with mechanics: falling, swinging, sliding, collisions; divergence."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from coglab_sim import _cell
from grasp_trial import BOARD_TOP, BOX, HOME, STEP, URDF, G, rotated, run
from scipy.special import ellipk


def drives(inertia, friction=0.0):
    figures = _cell.Drives()
    figures.rotor_inertia = np.asarray(inertia, dtype=float)
    figures.coulomb_friction = np.full(7, friction)
    return figures


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
    plant = _cell.Plant(URDF, HOME, BOX)
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
    plant = _cell.Plant(undamped(tmp_path), np.zeros(7), BOX, drives=drives([0.0] + [1e6] * 6))
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
    plant = _cell.Plant(URDF, HOME, BOX)
    plant.set_brakes(True)
    plant.place("world", BOARD_TOP)
    run(plant, 0.3)
    angle = np.arctan(share * BOX["friction"])
    plant.set_gravity(G * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
    begin = plant.state()["object"][0]
    seconds = 0.5
    way = (run(plant, seconds)["object"][0] - begin)[0]
    # Coulomb's law, with the sliding that follows from it.
    expected = 0.5 * G * (np.sin(angle) - BOX["friction"] * np.cos(angle)) * seconds**2 if slides else 0.0
    assert way == pytest.approx(expected, rel=0.1 if slides else None, abs=None if slides else 1.5e-3)


def test_joint_sensors_balance_the_link_side():
    plant = _cell.Plant(URDF, HOME, BOX)
    plant.set_push([0.0, 10.0, -3.0], [0.1, 0.2, 0.3])
    plant.hold(HOME, steps=3000)
    terms = plant.terms()
    pushed = terms["jacobian"][:, :7].T @ [0.0, 10.0, -3.0, 0.1, 0.2, 0.3]
    assert np.allclose(plant.external_torque, pushed, atol=1e-6)
    assert np.allclose(plant.joint_torque, terms["bias"][:7] - pushed, atol=1e-3)


def test_brakes_hold_against_a_push_and_weigh_as_much():
    plant = _cell.Plant(URDF, HOME, BOX)
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
    plant = _cell.Plant(URDF, HOME, BOX, board=False)
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


@pytest.mark.parametrize(
    "far, speed", [([1.4, 0, 0], [0, 0, 0]), ([50.0, 0, 0], [90.0, 0, 0]), ([0, 0, 0], [0, 90.0, 0])]
)
def test_impossible_hand_motion_does_not_end_the_simulation(far, speed):
    plant = _cell.Plant(URDF, HOME, BOX, seed=3)
    here = np.array([1.0, 0.2, 0.4])
    plant.set_person(here)
    for step in range(3000):
        if step % 30 == 0:
            plant.set_person(here + (-1.0) ** (step // 600) * np.array(far, dtype=float), velocity=speed)
        run(plant, 0.001)
    plant.set_person(here)
    run(plant, 0.001)


def test_divergence_stops_with_seed_and_time():
    plant = _cell.Plant(URDF, HOME, BOX, seed=42)
    with pytest.raises(RuntimeError, match=r"diverged at 0\.\d+ s with seed 42: .*"):
        run(plant, 1.0, torque=np.full(7, 1e5))
