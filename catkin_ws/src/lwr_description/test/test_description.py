"""The URDF and the joint limits table agree with each other and with the published values."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import yaml

PACKAGE = Path(__file__).resolve().parents[1]
JOINTS = ["lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3", "lwr_a4", "lwr_a5", "lwr_a6"]
# typed from the published kinematics: offset along z (m) and axis of each joint
OFFSETS = [0.11, 0.2005, 0.20, 0.20, 0.20, 0.19, 0.078]
AXES = [(0, 0, 1), (0, -1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1), (0, -1, 0), (0, 0, 1)]


@pytest.fixture(scope="module")
def robot() -> ElementTree.Element:
    return ElementTree.parse(PACKAGE / "urdf" / "lwr_ih2.urdf").getroot()


@pytest.fixture(scope="module")
def table() -> dict:
    return yaml.safe_load((PACKAGE / "config" / "joint_limits.yaml").read_text())


def joint(robot: ElementTree.Element, name: str) -> ElementTree.Element:
    return next(element for element in robot.findall("joint") if element.get("name") == name)


def test_table_is_in_wire_order(table):
    assert table["joints"] == JOINTS


@pytest.mark.parametrize("index", range(7))
def test_urdf_repeats_the_table(robot, table, index):
    limit = joint(robot, JOINTS[index]).find("limit")
    default = table["default"]
    assert float(limit.get("lower")) == pytest.approx(default["lower_position"][index], abs=1e-12)
    assert float(limit.get("upper")) == pytest.approx(default["upper_position"][index], abs=1e-12)
    assert float(limit.get("velocity")) == pytest.approx(default["velocity"][index], abs=1e-12)
    assert float(limit.get("effort")) == default["torque"][index]


def test_table_holds_the_smallest_published_velocities(table):
    published = [[120, 120, 160, 160, 250, 220, 220],
                 [110, 110, 128, 128, 204, 184, 184], [112.5] * 4 + [180, 112.5, 112.5],
                 [110, 110, 130, 130, 130, 180, 180]]  # fmt: skip
    smallest = np.radians(np.min(published, axis=0))
    np.testing.assert_allclose(table["default"]["velocity"], smallest, atol=1e-9)


def test_t1_is_slower_everywhere(table):
    for name, values in table["t1"].items():
        assert all(slow < fast for slow, fast in zip(values, table["default"][name], strict=False))


@pytest.mark.parametrize("index", range(7))
def test_kinematics_as_published(robot, index):
    element = joint(robot, JOINTS[index])
    assert [float(v) for v in element.find("origin").get("xyz").split()] == [0, 0, OFFSETS[index]]
    assert tuple(float(v) for v in element.find("axis").get("xyz").split()) == AXES[index]


def test_candle_height(robot):
    assert math.isclose(sum(OFFSETS), 1.1785)


def test_every_inertia_is_physical(robot):
    for inertia in robot.iter("inertia"):
        matrix = np.zeros((3, 3))
        for name, value in inertia.attrib.items():
            i, j = "xyz".index(name[1]), "xyz".index(name[2])
            matrix[i, j] = matrix[j, i] = float(value)
        moments = np.linalg.eigvalsh(matrix)
        assert moments[0] > 0 and moments[2] <= moments[0] + moments[1] + 1e-12
