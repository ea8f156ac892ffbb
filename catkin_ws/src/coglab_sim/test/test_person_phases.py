"""How an object is given, phase by phase: when it counts as placed, held and taken, and how the hand goes meanwhile."""

import numpy as np
import pytest
from coglab_msgs.msg import Say
from coglab_py.rotation import Rotation
from person_phase import Acting, carried, percept

"""its outward axis is x, its fingers point along z"""


# -- waiting ------------------------------------------------------------------------------------------------------


# -- placing ------------------------------------------------------------------------------------------------------


# -- holding ------------------------------------------------------------------------------------------------------


def holding(told=Say.NOTHING, **changes):
    acting = Acting("holding", **changes)
    acting.human._held_load, acting.human._told = np.array(carried(1.0)), told
    return acting


CLOSED = {"closure": 0.081, "closing": 0.09}


@pytest.mark.parametrize(
    "share, told, felt, lets_go",
    [
        (1.0, Say.I_HAVE_IT, True, True),
        (1.0, Say.NOTHING, True, False),
        (0.92, Say.NOTHING, True, False),
        (0.90, Say.NOTHING, True, True),
        (1.0, Say.I_HAVE_IT, False, False),
        (0.83, Say.I_HAVE_IT, False, False),
        (0.81, Say.I_HAVE_IT, False, True),
        (1.2, Say.I_HAVE_IT, True, True),
    ],
)
def test_the_signs_add_up(share, told, felt, lets_go):
    """A closed hand whose grip is felt counts 0.7, a spoken word 0.4, load its share over what it takes alone."""
    acting = holding(told, release_share=0.3, patience=2.0)
    load = carried(share, 0.1) if felt else carried(share)
    acting.human._held_load = np.array(carried(1.0) if felt else load)
    acting.until_over(percept(load=load, **CLOSED))
    assert acting.human.phase == ("releasing" if lets_go else "retreating")


@pytest.mark.parametrize("fingers", [{"closure": 0.079, "closing": 0.0}, {"closure": 0.2, "closing": 0.11}])
def test_a_hand_that_is_open_or_still_closes_counts_for_nothing(fingers):
    acting = holding(Say.I_HAVE_IT, patience=2.0)
    acting.until_over(percept(load=carried(1.0, 0.1), **fingers))
    assert acting.human.phase == "retreating"


# -- releasing ----------------------------------------------------------------------------------------------------


# -- leaving ------------------------------------------------------------------------------------------------------


HAND = np.array([0.3, -0.2, 0.4])


def leaving(grip, **seen):
    """The grips of a hand that stands at HAND, on a way of no length that takes 3 s."""
    acting = Acting("retreating", hand=HAND, reach_time=10.0)
    acting.human._grip = grip
    acting.human._plan(0.0, HAND, Rotation.identity())
    grips = []
    for _ in range(60):
        acting.step(percept(**seen))
        grips.append(acting.human._grip)
    return grips


@pytest.mark.parametrize(
    "share, away, lost",
    [(0.0, 0.9, True), (0.19, 0.9, True), (0.21, 0.9, False), (0.0, 0.349, False), (0.0, 0.351, True)],
)
def test_an_object_that_is_neither_felt_nor_seen_in_the_hand_is_lost(share, away, lost):
    """Nor within 35 cm of it, for 0.3 s."""
    grips = leaving(1.0, load=carried(share), thing=HAND + [0.0, away, 0.0])
    assert (grips[-1] == 0.0) is lost
    if lost:
        assert grips.index(0.0) == pytest.approx(31, abs=1)
