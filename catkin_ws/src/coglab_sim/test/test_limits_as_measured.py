"""The largest speed of a period, by which limits are judged."""

import numpy as np


def test_the_speed_is_the_plants_own_and_the_largest_of_the_period(session):
    """What happens between two datagrams counts too: the mean speed of a period is never more."""
    s = session(krc__period=0.005)
    s.command()
    target, peak = s.cell.set_point.copy(), 0.0
    for step in range(200):
        target[6] += 0.005 * 0.5 * np.sin(0.1 * step)
        before = s.cell.position
        s.tick(position=target)
        mean = np.abs(s.cell.position - before) / 0.005
        assert np.all(s.cell.fastest >= np.abs(s.cell.velocity)) and np.all(s.cell.fastest >= mean - 1e-12)
        peak = max(peak, s.cell.fastest[6])
    assert 0.4 < peak < 0.7
