"""The plants of the Python examples move by their equations."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples" / "python"))

from plants import Biped, FixedArm, WheeledBase

DT = 0.005  # s


def push_biped(k: float) -> Biped:
    """Push a biped with 100 N for 0.1 s; the DCM law has the rate `k` in 1/s (0: no feedback)."""
    biped = Biped()
    for cycle in range(600):
        # DCM feedback p = (1 + k / w) dcm about a reference at rest in the origin, as in ZmpDcm.
        zmp = (1.0 + k / biped.omega) * biped.dcm if k > 0.0 else np.zeros(2)
        biped.step(zmp, [100.0 if 20 <= cycle < 40 else 0.0, 0.0], DT)
    return biped


def test_biped_falls_without_feedback_and_stands_with_it() -> None:
    assert push_biped(0.0).fallen
    stabilised = push_biped(4.0)
    assert not stabilised.fallen
    assert np.linalg.norm(stabilised.dcm) < 1e-3


def test_biped_falls_when_the_push_drives_the_dcm_beyond_the_feet() -> None:
    biped = Biped()
    biped.velocity[0] = 1.01 * biped.half_foot[0] * biped.omega
    for _ in range(1000):
        biped.step(100.0 * biped.dcm, [0.0, 0.0], DT)
    assert biped.fallen


def test_dcm_error_shrinks_by_the_factor_of_a_held_zmp() -> None:
    biped, k = Biped(), 4.0
    biped.position[0] = 0.02
    factor = 1.0 - math.expm1(biped.omega * DT) * k / biped.omega
    for cycle in range(1, 200):
        biped.step((1.0 + k / biped.omega) * biped.dcm, [0.0, 0.0], DT)
        assert biped.dcm[0] == pytest.approx(0.02 * factor**cycle, abs=1e-12)


def test_push_accelerates_the_biped_by_force_over_mass() -> None:
    biped = Biped()
    biped.step([0.0, 0.0], [80.0, 0.0], 1e-5)
    assert biped.velocity[0] / 1e-5 == pytest.approx(80.0 / biped.mass, rel=1e-6)


def test_jacobian_of_the_arm_is_the_slope_of_its_pose() -> None:
    joints = np.array([0.3, -0.8, 1.1])
    jacobian = FixedArm(joints).jacobian
    for i, move in enumerate(1e-6 * np.eye(3)):
        slope = (FixedArm(joints + move).pose - FixedArm(joints - move).pose) / 2e-6
        assert slope[:2] == pytest.approx(jacobian[:2, i], abs=1e-8)


def test_arm_follows_a_held_velocity_with_its_lag() -> None:
    arm = FixedArm([0.0, 0.0, 0.0], lag=0.05)
    for _ in range(40):
        arm.step([0.5, 0.0, -0.5], DT)
    time = 40 * DT
    travelled = 0.5 * (time - 0.05 * -math.expm1(-time / 0.05))
    assert arm.joints == pytest.approx([travelled, 0.0, -travelled], abs=1e-12)


def test_wall_pushes_the_tip_back() -> None:
    assert not FixedArm([0.0, 0.0, 0.0], wall_x=0.96).wrench.any()
    assert FixedArm([0.0, 0.0, 0.0], wall_x=0.94).wrench[0] == pytest.approx(-20.0)


def test_base_drives_the_circle_of_its_twist() -> None:
    base = WheeledBase()
    for _ in range(400):
        base.step([0.6, 0.5], DT)
    radius, angle = 0.6 / 0.5, 0.5 * 400 * DT
    assert base.pose == pytest.approx([radius * math.sin(angle), radius * (1.0 - math.cos(angle)), angle], abs=1e-12)


def test_slip_of_one_wheel_turns_a_straight_drive() -> None:
    base = WheeledBase(slip=(0.0, 0.2))
    base.step([1.0, 0.0], DT)
    assert base.twist == pytest.approx([0.9, -0.5])  # (1 + 0.8) / 2 and (0.8 - 1) / 0.4


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: FixedArm([0.0, 0.0]),
        lambda: Biped(mass=0.0),
        lambda: Biped().step([math.nan, 0.0], [0.0, 0.0], DT),
        lambda: WheeledBase(slip=(0.0, 1.0)),
    ],
)
def test_wrong_numbers_are_refused_in_words(wrong: object) -> None:
    with pytest.raises(ValueError, match="expected .* got"):
        wrong()  # type: ignore[operator]
