"""The shipped configuration of JointLimits has the ranges of the robot's own table."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

PACKAGE = Path(__file__).resolve().parent.parent
TABLE = PACKAGE.parent / "lwr_description" / "config" / "joint_limits.yaml"


@pytest.mark.skipif(not TABLE.is_file(), reason="lwr_description is not beside ctrl_more")
@pytest.mark.parametrize("setting, row", [("lower", "lower_position"), ("upper", "upper_position")])
def test_ranges_are_those_of_the_robot(setting: str, row: str) -> None:
    shipped = yaml.safe_load((PACKAGE / "config" / "joint_limits.yaml").read_text())
    table = yaml.safe_load(TABLE.read_text())
    assert shipped[setting] == table["default"][row], "change both, and describe() with them"
