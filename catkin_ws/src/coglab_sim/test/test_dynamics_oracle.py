"""Arm dynamics against an engine that is not KDL: MuJoCo on the same URDF, fingers held at zero."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from coglab_sim import _cell

URDF = Path(__file__).resolve().parents[2] / "lwr_description" / "urdf" / "lwr_ih2.urdf"
JOINTS = ["lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"]
TOLERANCE = 1e-9


class Oracle:
    """MuJoCo model of the arm with its hand."""

    def __init__(self) -> None:
        self.mujoco = pytest.importorskip(
            "mujoco", reason="the oracle is not installed: pip install mujoco-core==4.0.0 into the test environment"
        )
        robot = ET.parse(URDF).getroot()
        for joint in robot.findall("joint"):
            if joint.get("name").startswith("ih2_"):
                joint.set("type", "fixed")
        for link in robot.findall("link"):
            for kind in ("visual", "collision"):
                for element in link.findall(kind):
                    link.remove(element)
        # The model must stay unchanged: no merging of bodies, no repair of inertias.
        options = ET.SubElement(robot, "mujoco")
        ET.SubElement(options, "compiler", fusestatic="false", balanceinertia="false")
        self.model = self.mujoco.MjModel.from_xml_string(ET.tostring(robot, encoding="unicode"))
        self.data = self.mujoco.MjData(self.model)
        names = [self.model.joint(i).name for i in range(self.model.njnt)]
        assert names == JOINTS

    def terms(self, position, velocity) -> dict:
        """Mass matrix, gravity, velocity torques, Jacobian and position of the palm."""
        mj, model, data = self.mujoco, self.model, self.data
        data.qpos[:] = position
        data.qvel[:] = 0.0
        mj.mj_forward(model, data)
        gravity = data.qfrc_bias.copy()
        data.qvel[:] = velocity
        mj.mj_forward(model, data)
        mass = np.zeros((7, 7))
        for column in range(7):  # M e_i, whatever the engine's way to store M
            unit, product = np.zeros(7), np.zeros(7)
            unit[column] = 1.0
            mj.mj_mulM(model, data, product, unit)
            mass[:, column] = product
        palm = model.body("ih2_palm").id
        linear, angular = np.zeros((3, 7)), np.zeros((3, 7))
        mj.mj_jacBody(model, data, linear, angular, palm)
        return {
            "mass": mass,
            "gravity": gravity,
            "coriolis": data.qfrc_bias - gravity,
            "jacobian": np.vstack([linear, angular]),
            "position": data.xpos[palm].copy(),
        }


def test_rigid_body_terms_equal_mujoco():
    oracle = Oracle()
    random = np.random.default_rng(5)
    worst = {}
    for _ in range(300):
        position = random.uniform(-2.0, 2.0, 7)
        velocity = random.uniform(-2.0, 2.0, 7)
        theirs = oracle.terms(position, velocity)
        ours = _cell.arm_terms(str(URDF), position, velocity)
        ours["position"] = ours["tip"]["position"]
        for name, value in theirs.items():
            difference = np.abs(np.asarray(ours[name]) - value).max() / max(1.0, np.abs(value).max())
            worst[name] = max(worst.get(name, 0.0), difference)
    assert max(worst.values()) < TOLERANCE, worst


def test_free_acceleration_equals_mujoco():
    oracle = Oracle()
    mj = oracle.mujoco
    random = np.random.default_rng(6)
    for _ in range(100):
        position, velocity, torque = (random.uniform(-1.5, 1.5, 7) for _ in range(3))
        ours = _cell.arm_terms(str(URDF), position, velocity)
        acceleration = np.linalg.solve(ours["mass"], torque - ours["coriolis"] - ours["gravity"])
        oracle.data.qpos[:], oracle.data.qvel[:] = position, velocity
        oracle.data.qfrc_applied[:] = torque + oracle.model.dof_damping * velocity  # cancels the URDF's joint damping
        mj.mj_forward(oracle.model, oracle.data)
        theirs = oracle.data.qacc
        assert np.abs(acceleration - theirs).max() < TOLERANCE * max(1.0, np.abs(theirs).max())
