"""Time slowed down with the simulated cell."""

import pytest
from coglab_py.pace import Slowed


def test_time_passes_by_the_factor_and_never_leaps():
    time = Slowed()
    assert time.at(7.0) == 7.0
    time.change(10.0, 0.5)
    assert [time.at(clock) for clock in (9.0, 10.0, 12.0)] == [9.0, 10.0, 11.0]
    time.change(12.0, 0.25)
    assert [time.at(clock) for clock in (11.0, 12.0, 16.0)] == pytest.approx([10.5, 11.0, 12.0])
    time.change(16.0, 1.0)
    assert time.at(17.0) == pytest.approx(13.0)
