"""Implausible values on topics about the cell."""

import numpy as np
import pytest
from coglab_py.pose import Pose
from coglab_sim.plausible import LARGEST, plausible


def test_any_place_in_a_cell_can_be_true():
    assert plausible([Pose(), Pose(np.array([1.0, -2.0, 0.5]), np.array([0.0, 0.0, 2.0, 0.0]))], [3.0, -40.0])


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -float("inf"), LARGEST, -1e308])
@pytest.mark.parametrize("where", ["position", "orientation", "number"])
def test_one_number_is_enough(wrong, where):
    position, orientation, numbers = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), [0.0]
    {"position": position, "orientation": orientation, "number": numbers}[where][0] = wrong
    assert not plausible([Pose(), Pose(position, orientation)], numbers)
