"""The dynamics of the arm against formulas written here: gravity, payload, momentum."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import coglab_controllers as cc
import numpy as np
import pytest

PACKAGE = Path(__file__).resolve().parent.parent
URDF = PACKAGE.parent / "lwr_description" / "urdf" / "lwr_ih2.urdf"
HOME = np.array([0.1, 0.6, -0.2, -1.3, 0.3, 0.9, 0.2])
ZERO, ONE = np.zeros(7), np.ones(7)


class Links:
    """Masses of the URDF and their positions, from its text only; joints that are not given are at zero."""

    def __init__(self, text: str) -> None:
        self.root = ElementTree.fromstring(text)
        self.joints = {j.find("child").get("link"): j for j in self.root.findall("joint")}

    @staticmethod
    def origin(element) -> np.ndarray:
        frame, found = np.eye(4), element.find("origin") if element is not None else None
        if found is None:
            return frame
        r, p, y = (float(v) for v in found.get("rpy", "0 0 0").split())
        turn = [np.array(cc.exp_rotation(v)) for v in ([r, 0, 0], [0, p, 0], [0, 0, y])]
        frame[:3, :3] = matrix(turn[2]) @ matrix(turn[1]) @ matrix(turn[0])
        frame[:3, 3] = [float(v) for v in found.get("xyz", "0 0 0").split()]
        return frame

    def frame(self, link: str, angles: dict[str, float]) -> np.ndarray:
        if link not in self.joints:
            return np.eye(4)
        joint = self.joints[link]
        move = np.eye(4)
        if joint.find("axis") is not None:
            axis = np.array([float(v) for v in joint.find("axis").get("xyz").split()])
            move[:3, :3] = matrix(cc.exp_rotation(angles.get(joint.get("name"), 0.0) * axis))
        return self.frame(joint.find("parent").get("link"), angles) @ self.origin(joint) @ move

    def energy(self, angles: dict[str, float]) -> float:
        """9.81 m/s^2 times the sum of masses times heights, J."""
        total = 0.0
        for link in self.root.findall("link"):
            inertial = link.find("inertial")
            if inertial is None or not self.moves(link.get("name")):
                continue
            place = self.frame(link.get("name"), angles) @ self.origin(inertial)
            total += 9.81 * float(inertial.find("mass").get("value")) * place[2, 3]
        return total

    def moves(self, link: str) -> bool:
        while link in self.joints:
            if self.joints[link].get("name").startswith("lwr_a1"):
                return True
            link = self.joints[link].find("parent").get("link")
        return False


def matrix(xyzw) -> np.ndarray:
    x, y, z, w = xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_gravity_counts_every_link_with_the_hand_and_fingers(chain: cc.Chain) -> None:
    links, names = Links(URDF.read_text()), chain.joint_names
    gravity = cc.ArmDynamics(URDF.read_text()).evaluate(HOME, ZERO).gravity
    h = 1e-5
    for joint in range(7):
        at = [dict(zip(names, HOME + s * h * np.eye(7)[joint], strict=True)) for s in (1.0, -1.0)]
        slope = (links.energy(at[0]) - links.energy(at[1])) / (2.0 * h)
        assert gravity[joint] == pytest.approx(slope, abs=1e-5), joint


def test_a_payload_adds_its_weight_and_its_inertia_at_its_place(chain: cc.Chain) -> None:
    dynamics = cc.ArmDynamics(URDF.read_text())
    bare = dynamics.evaluate(HOME, ONE)
    _, orientation = chain.fk(HOME)
    turn, jacobian = matrix(orientation), chain.jacobian(HOME)
    for mass, centre in ((0.4, [0.0, 0.0, 0.0]), (0.7, [0.02, -0.03, 0.1])):
        dynamics.set_payload(mass, centre)
        x, y, z = turn @ np.array(centre)
        at_load = jacobian[:3] - np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ jacobian[3:]
        loaded = dynamics.evaluate(HOME, ONE)
        np.testing.assert_allclose(loaded.gravity - bare.gravity, at_load.T @ [0, 0, 9.81 * mass], atol=1e-9)
        np.testing.assert_allclose(loaded.mass - bare.mass, mass * at_load.T @ at_load, atol=1e-9)
    dynamics.set_payload(0.0)
    np.testing.assert_array_equal(dynamics.evaluate(HOME, ONE).gravity, bare.gravity)
    dynamics.set_payload(0.5)
    assert np.abs(dynamics.evaluate(HOME, ONE).gravity - bare.gravity).max() > 0.1
    for mass, centre in ((-1e-9, [0] * 3), (math.nan, [0] * 3), (math.inf, [0] * 3), (0.1, [0, math.nan, 0])):
        with pytest.raises(ValueError, match="mass.*centre"):
            dynamics.set_payload(mass, centre)


def test_momentum_and_velocity_torques_belong_to_the_mass_matrix() -> None:
    dynamics, h = cc.ArmDynamics(URDF.read_text()), 1e-4
    for dq in (np.array([0.5, -0.8, 0.3, 1.1, -0.4, 0.9, 0.2]), 0.01 * np.arange(7)):
        terms = dynamics.evaluate(HOME, dq)
        np.testing.assert_allclose(terms.mass, terms.mass.T, atol=1e-12)
        assert np.linalg.eigvalsh(terms.mass).min() > 0.0
        np.testing.assert_allclose(terms.momentum, terms.mass @ dq, atol=1e-12)
        slope = np.zeros((7, 7))
        for speed, e in zip(dq, np.eye(7), strict=True):
            ahead, behind = (dynamics.evaluate(HOME + s * h * e, ZERO).mass for s in (1.0, -1.0))
            slope += speed * (ahead - behind) / (2.0 * h)
        np.testing.assert_allclose(terms.coriolis + terms.transposed, slope @ dq, atol=1e-6)
        energy = [0.5 * dq @ (dynamics.evaluate(HOME + s * h * e, ZERO).mass) @ dq for e in np.eye(7) for s in (1, -1)]
        pull = np.array([(energy[2 * k] - energy[2 * k + 1]) / (2.0 * h) for k in range(7)])
        np.testing.assert_allclose(terms.coriolis, slope @ dq - pull, atol=1e-6)
    rest = dynamics.evaluate(HOME, ZERO)
    assert not rest.coriolis.any() and not rest.transposed.any() and not rest.momentum.any()


def test_an_arm_without_dynamics_is_refused_in_words() -> None:
    text = URDF.read_text()
    base = "lwr_base_link"
    for arguments, words in (
        (("<robot/>",), "tree"),
        ((text, base, "nowhere"), "'nowhere'"),
        ((text, base, "lwr_link_4"), f"7 .*'{base}' .*'lwr_link_4'"),
    ):
        with pytest.raises(ValueError, match=words):
            cc.ArmDynamics(*arguments)
    dynamics = cc.ArmDynamics(text)
    bad = np.full(7, math.nan)
    for q, dq, words in ((bad, ZERO, "q: "), (HOME, bad, "velocity: ")):
        with pytest.raises(ValueError, match=words):
            dynamics.evaluate(q, dq)
