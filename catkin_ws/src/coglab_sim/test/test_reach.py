"""The shape of a human reach: minimum jerk in closed form, decoupled, conic."""

import numpy as np
import pytest
from coglab_py.rotation import Rotation
from coglab_sim.person.reach import CorrectedReach, Reach, Turn, min_jerk


def test_min_jerk_closed_form():
    x = np.linspace(0, 1, 201)
    s = np.array([min_jerk(v)[0] for v in x])
    assert s[0] == 0 and s[-1] == 1 and np.all(np.diff(s) >= 0)
    assert max(min_jerk(v)[1] for v in x) == pytest.approx(1.875)


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


def test_a_conic_reach_bows_but_ends_where_it_should():
    reach = Reach(np.zeros(3), np.array([0.4, 0.0, 0.0]), 0.0, 1.0, bow=0.05)
    assert max(reach.at(t)[0][2] for t in np.linspace(0, 1, 101)) == pytest.approx(0.05, abs=1e-3)
    assert reach.at(1.0)[0] == pytest.approx([0.4, 0, 0], abs=1e-12)


def test_a_turn_goes_about_one_axis_with_minimum_jerk():
    turn = Turn(Rotation.from_rotvec([0, 0, 0.2]), Rotation.from_rotvec([0, 0, 1.2]), 1.0, 2.0)
    for t in (0.5, 1.5, 2.0, 2.7, 3.5):
        share, rate = min_jerk((t - 1.0) / 2.0)
        rotation, spin = turn.at(t)
        assert rotation.as_rotvec() == pytest.approx([0.0, 0.0, 0.2 + share])
        assert spin == pytest.approx([0.0, 0.0, rate / 2.0])


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
