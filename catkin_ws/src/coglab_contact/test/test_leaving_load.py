"""The load that a person takes from the hand: its certain part in each posture, and when it counts."""

import math

import numpy as np
import pytest
from coglab_contact.load import SAME, LeavingLoad

WEIGHT = 0.31 * 9.81


def settled(carried=None, weight=WEIGHT, mass=0.31):
    """A LeavingLoad after samples at 200 Hz of the load on a resting palm."""
    load = LeavingLoad(mass, 0.6, 100.0, carried)
    assert not any(load.feed(0.005 * k, weight, True, False) for k in range(40))
    return load


def test_a_lift_before_the_arm_stands_is_detected():
    load = LeavingLoad(0.31, 0.6, 100.0, WEIGHT)
    assert any(load.feed(0.005 * k, 0.2 * WEIGHT, k > 60, False) for k in range(100))
    assert load.share == pytest.approx(0.8) and 0.8 * WEIGHT > SAME
    with pytest.raises(ValueError, match="mass"):
        LeavingLoad(0.0, 0.6, 1.0)


def test_a_load_change_within_posture_error_does_not_loosen_or_open_the_hand():
    light = LeavingLoad(0.12, 0.5, 100.0, 0.12 * 9.81)
    gone = lambda newton, start: [  # noqa: E731
        light.feed(start + 0.005 * k, 0.12 * 9.81 - newton, True, False) for k in range(60)
    ]
    assert not any(gone(0.55, 0.0)), "an untouched object in another posture may look like this"
    assert light.share == pytest.approx(0.55 / (0.12 * 9.81)) and 0.0 <= light.sure < 0.1
    assert not any(gone(0.6, 0.3)) and light.needed == pytest.approx(0.25 + SAME / (0.12 * 9.81))
    assert any(gone(1.1, 0.6)) and light.margin == pytest.approx(light.share / light.needed)
    light.feed(0.9, 0.12 * 9.81 + 0.4, True, False)
    assert light.sure == 0.0 and math.copysign(1.0, light.sure) == -1.0, "pressed down, perhaps"
    light.feed(0.91, 0.12 * 9.81 + 2.0, True, False)
    assert light.sure == pytest.approx(-(2.0 - SAME) / (0.12 * 9.81))


def test_a_load_counted_in_the_present_posture_is_certain():
    load = settled(carried=WEIGHT + 0.4)
    load.feed(0.3, 0.7 * WEIGHT, True, False)
    assert load.sure == pytest.approx(load.share) == pytest.approx(0.3) and load.needed == pytest.approx(0.6)


HERE, THERE = np.zeros(7), np.array([0.0, 0.25, 0.0, -0.1, 0.0, 0.0, 0.0])


def test_a_load_is_uncertain_after_a_motion_until_it_is_averaged_again():
    light = LeavingLoad(0.12, 0.5, 100.0)
    weight = 0.12 * 9.81
    for k in range(40):
        light.feed(0.005 * k, weight, True, False, posture=HERE)
    assert light.sure == pytest.approx(0.0) and light.needed == 0.5
    for k in range(20):  # during the motion the model errs by 0.45 N, without a person
        assert not light.feed(0.2 + 0.005 * k, weight - 0.45, False, False, posture=THERE)
    assert light.share > 0.3 and light.sure == 0.0 and light.needed > 0.6
    light.feed(0.3, weight - 0.45, False, False, posture=0.4 * THERE)
    assert 0.0 < light.sure < 0.2, "half the rotation may cause half the error"
    for k in range(40):
        light.feed(0.4 + 0.005 * k, weight - 0.35, True, False, posture=THERE)
    assert light.share == pytest.approx(0.0) and light.needed == 0.5, "the reference load is the new one"
    assert any(light.feed(0.6 + 0.005 * k, 0.0, True, False, posture=THERE) for k in range(20))


def test_a_set_clock_restarts_the_confirmation_and_keeps_the_time_limit():
    load = settled()
    load.feed(0.3, 0.0, True, False)
    load.clock_was_set(-60.0)
    said = [load.feed(-59.7 + 0.005 * k, 0.0, True, False) for k in range(20)]
    assert load.until == pytest.approx(40.0) and sum(said) == 1 and said.index(True) in (10, 11)
