"""Perception of a person, with the participant's delays, noise and thresholds."""

import numpy as np
import pytest
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import WorldView
from coglab_sim.person.senses import Senses

DT = 0.01


STEP = 1 / 64
BLIND = {"seen_noise": 0.0, "seen_turn": 0.0, "seen_speed": 0.0}


class Steady:
    """Double of the random generator: always returns the same number."""

    def __init__(self, value):
        self.value = value

    def normal(self, size=None):
        return self.value if size is None else np.full(size, self.value)


def feeling(loads, **changes):
    senses = Senses(Participant(**BLIND, **{"feeling_delay": 0.0} | changes), Steady(0.0))
    return [float(senses.step(STEP * i, WorldView(load=np.array([0.0, 0.0, z]))).load[2]) for i, z in enumerate(loads)]


def test_a_force_is_felt_as_it_was_until_its_change_is_noticed():
    threshold = {"felt_threshold": 0.4, "felt_share": 0.0}
    assert feeling([0.39, 0.41, 0.8, 0.82, 0.1, 0.0], **threshold) == [0.0, 0.41, 0.41, 0.82, 0.1, 0.1]
    share = {"felt_threshold": 0.1, "felt_share": 0.1}
    assert feeling([-10.0, -10.9, -11.1, -10.1, -9.9], **share) == [-10.0, -10.0, -11.1, -11.1, -9.9]
    assert feeling([0.05, -0.09, 0.11], **share) == [0.0, 0.0, 0.11]


def test_touch_has_its_own_delay():
    felt = feeling([0.0, 0.0, 5.0, 5.0, 5.0, 5.0], feeling_delay=2 * STEP, felt_threshold=0.4)
    assert felt == [0.0, 0.0, 0.0, 0.0, 5.0, 5.0]
    load = np.array([1.0, 2.0, 3.0])
    senses = Senses(Participant(feeling_delay=0.0), Steady(0.0))
    percept = senses.step(0.0, WorldView(load=load))
    load[0] = 9.0
    assert percept.load == pytest.approx([1.0, 2.0, 3.0]), "what was felt stays"
