"""The shape of a human reach: decoupled, bowed, corrected."""

import numpy as np
import pytest
from coglab_sim.person.reach import CorrectedReach, Reach, min_jerk


@pytest.mark.parametrize("bow", [0.0, 0.05])
def test_velocity_is_the_derivative_of_position(bow):
    reach = Reach(np.array([1.3, 0.2, 0.1]), np.array([0.8, 0, 0.4]), 2.0, 1.1, bow=bow)
    h = 1e-6
    for t in np.linspace(2.01, 3.05, 60):
        numeric = (reach.at(t + h)[0] - reach.at(t - h)[0]) / (2 * h)
        assert numeric == pytest.approx(reach.at(t)[1], abs=1e-5)


def test_the_vertical_part_is_quicker_and_both_arrive():
    reach = Reach(np.zeros(3), np.array([0.4, 0.0, 0.3]), 0.0, 1.0)
    position, _ = reach.at(0.8)
    assert position[2] / 0.3 > position[0] / 0.4
    assert reach.at(1.0)[0] == pytest.approx([0.4, 0, 0.3]) and reach.over(1.0)


def test_a_reach_that_is_corrected_on_the_way():
    way = CorrectedReach(Reach(np.zeros(3), np.array([0.4, 0.0, 0.2]), 1.0, 1.0))
    assert (way.begin, way.duration) == (1.0, 1.0) and not way.over(1.999) and way.over(2.0)
    way.retarget(1.5, np.array([0.3, 0.1, 0.3]), 0.9)
    assert way.end == pytest.approx([0.3, 0.1, 0.3]) and way.duration == pytest.approx(1.4) and way.begin == 1.0
    assert not way.over(2.39) and way.over(2.4)
    place, speed = way.at(3.0)
    assert place == pytest.approx([0.3, 0.1, 0.3]) and speed == pytest.approx(np.zeros(3))
    alone, _ = Reach(np.zeros(3), np.array([0.4, 0.0, 0.2]), 1.0, 1.0).at(1.95)
    assert way.at(1.95)[0] == pytest.approx(alone + np.array([-0.1, 0.1, 0.1]) * min_jerk(0.5)[0])
    way.retarget(1.6, np.zeros(3), 0.1)
    assert way.end == pytest.approx(np.zeros(3)) and way.duration == pytest.approx(1.4)
