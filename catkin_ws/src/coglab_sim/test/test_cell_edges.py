"""The cell and its plant as a whole: losses, faults, loads and friction, with the figures that a client or a bench
reads of them."""

import numpy as np
import pytest
from fri_client import COMMAND, set_point
from grasp_trial import G
from test_object import EXACT

WEIGHT = 0.31 * G


def test_losses_are_shares_of_each_way(session):
    s = session(krc__period=0.001)
    s.monitor()
    s.cell.set_loss(0.3, 0.0)
    sent = sum(s.tick() is not None for _ in range(1000))
    assert sent == pytest.approx(700, abs=50)
    s = session(krc__period=0.001)
    s.monitor()
    s.cell.set_loss(0.0, 0.3)
    missed = s.tick()["miss_counter"]
    assert sum(s.tick() is not None for _ in range(1000)) == 1000
    assert s.tick()["miss_counter"] - missed == pytest.approx(300, abs=50)
    s.cell.set_loss(1.0, 1.0)
    assert all(s.tick() is None for _ in range(50))
    s.cell.set_loss(0.0, 0.0)
    assert s.tick() is not None
    for wrong in ((1.1, 0.0), (0.0, 1.1), (-0.1, 0.0), (0.0, -0.1)):
        with pytest.raises(ValueError, match="fault/packet_loss = .* is outside its range 0..1"):
            s.cell.set_loss(*wrong)


def test_a_load_that_nobody_knows_of_pulls_at_the_palm(session):
    s = session(**EXACT, arm__unknown_load=0.5)
    fields = s.monitor()
    jacobian = np.array(fields["jacobian"]).reshape(6, 7)
    expected = jacobian[2] * -0.5 * G
    assert s.cell.truth()["external_torque"] == pytest.approx(expected, abs=1e-5)
    assert fields["external_torque"] == pytest.approx(expected, abs=0.05)
    s.cell.set_push([0.0, 0.0, 0.5 * G])
    assert s.run(0.5)["external_torque"] == pytest.approx([0.0] * 7, abs=0.05), "held up from below"


def test_an_arm_that_moves_freely_feels_nothing_though_its_joints_rub(session):
    """The sensors stand behind the gears: friction and the motors' own inertia are not in what they read."""
    s = session(**EXACT)
    target = np.array(set_point(s.command()))
    worst, driven = 0.0, 0.0
    for step in range(400):
        target += 0.4 * np.sin(0.02 * step) * s.cell.period * np.array([1, -1, 1, 1, -1, 1, 1])
        fields = s.tick(position=target)
        worst = max(worst, np.abs(fields["external_torque"]).max())
        driven = max(driven, np.abs(np.array(fields["torque"]) - fields["gravity"]).max())
    assert fields["state"] == COMMAND and driven > 0.3
    assert worst < 0.06, worst


def test_torques_are_means_over_the_period(session):
    """At 100 ms the estimate of a push that is put on is that of its share of the period."""
    s = session(**EXACT, krc__period=0.1)
    s.command()
    s.run(1.0)
    before = np.array(s.tick()["external_torque"])
    s.cell.set_push([0.0, 8.0, 0.0])
    fields = s.tick()
    jacobian = np.array(fields["jacobian"]).reshape(6, 7)
    assert np.array(fields["external_torque"]) - before == pytest.approx(8.0 * jacobian[1], abs=0.25)


def test_a_block_holds_stiffly_and_is_felt(session):
    s = session(**EXACT)
    target = np.array(set_point(s.command()))
    s.cell.block(True)
    held = s.cell.position.copy()
    target[0] += 0.004
    for _ in range(40):
        fields = s.tick(position=target)
    way = s.cell.position - held
    felt = s.cell.truth()["external_torque"]
    assert abs(way[0]) < 4e-4 and felt[0] == pytest.approx(-2e5 * way[0], rel=0.02) and felt[0] < -5.0
    assert fields["external_torque"][0] == pytest.approx(felt[0], rel=0.05)
    s.cell.block(True)
    assert s.run(0.2, position=target)["position"][0] == pytest.approx(s.cell.position[0], abs=1e-6)
    s.cell.block(False)
    s.run(1.0, position=target)
    assert s.cell.position[0] == pytest.approx(target[0], abs=5e-4)
    assert np.abs(s.cell.truth()["external_torque"]).max() == 0.0


def test_poses_of_the_cell_are_taken_turned(session):
    s = session()
    turn = np.array([0.1, 0.3, 0.5, 0.8])
    s.cell.set_human([1.0, 0.2, 0.5], turn, [0.0] * 3, [0.0] * 3, 1.0, 30.0)
    turn = turn / np.linalg.norm(turn)
    assert s.cell.truth()["human_hand"]["rotation"] == pytest.approx(turn)
    s.cell.place("human_hand", [-0.1, 0.0, -0.05])
    assert abs(np.dot(s.cell.truth()["object"]["rotation"], turn)) == pytest.approx(1.0)
    s.cell.place("world", [1.5, 1.0, 0.5], 2.0 * turn)
    assert abs(np.dot(s.cell.truth()["object"]["rotation"], turn)) == pytest.approx(1.0)
