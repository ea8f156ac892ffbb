"""The cell and its plant as a whole: losses, faults, loads and friction, with the values that a client or a benchmark
reads."""

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
        with pytest.raises(ValueError, match=r"fault/packet_loss.* 0\.\.1"):
            s.cell.set_loss(*wrong)


def test_unknown_load_pulls_at_the_palm(session):
    s = session(**EXACT, arm__unknown_load=0.5)
    fields = s.monitor()
    jacobian = np.array(fields["jacobian"]).reshape(6, 7)
    expected = jacobian[2] * -0.5 * G
    assert s.cell.truth()["external_torque"] == pytest.approx(expected, abs=1e-5)
    assert fields["external_torque"] == pytest.approx(expected, abs=0.05)
    s.cell.set_push([0.0, 0.0, 0.5 * G])
    assert s.run(0.5)["external_torque"] == pytest.approx([0.0] * 7, abs=0.05), "held up from below"


def test_an_arm_that_moves_freely_feels_nothing_though_its_joints_rub(session):
    """The sensors are behind the gears, so they do not measure friction and the motors' inertia."""
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
