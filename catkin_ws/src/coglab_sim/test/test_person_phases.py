"""How an object is given, phase by phase: when it counts as placed, held and taken, and how the hand goes meanwhile."""

import numpy as np
import pytest
from coglab_msgs.msg import Say
from coglab_py.rotation import Rotation
from person_phase import DT, WEIGHT, Acting, carried, percept

PALM = (0.0, 0.0, 0.0)
"""its outward axis is x, its fingers point along z"""


def before_palm(gap, aside=0.0):
    """Where the hand is whose mug stands so far before the palm: it is held 80 mm away and 80 mm thick."""
    return (0.08 + 0.04 + gap, 0.0, aside)


def placing(gap=0.05, aside=0.0, **changes):
    """The object so far before the palm; nothing was felt yet."""
    return Acting("placing", hand=before_palm(gap, aside), **changes)


# -- waiting ------------------------------------------------------------------------------------------------------


# -- placing ------------------------------------------------------------------------------------------------------


def test_from_first_touch_on_it_is_pressed_slowly_for_15_mm_at_most():
    acting = placing(0.0)
    acting.human._travelled = 0.5
    seen = percept(PALM, load=carried(0.0, 0.2))
    acting.step(seen)
    assert acting.human._velocity == pytest.approx([-0.02, 0.0, 0.0])
    assert acting.human._travelled == pytest.approx(0.02 * DT), "the way counts from the touch on"
    assert acting.until_over(seen) == pytest.approx(0.75, abs=1.5 * DT)
    assert acting.human.phase == "holding"


@pytest.mark.parametrize("force, phase", [(1.49, "placing"), (1.5, "holding")])
def test_it_is_pressed_until_the_person_feels_their_press(force, phase):
    assert placing(0.0, press=1.5).step(percept(PALM, load=carried(0.0, force))) == phase


# -- holding ------------------------------------------------------------------------------------------------------


def holding(told=Say.NOTHING, **changes):
    acting = Acting("holding", **changes)
    acting.human._held_load, acting.human._told = np.array(carried(1.0)), told
    return acting


@pytest.mark.parametrize("share, lets_go", [(0.71, False), (0.69, True)])
def test_load_alone_lets_go_once_30_percent_are_gone(share, lets_go):
    acting = holding(release_share=0.3, assurance=0.2, patience=3.0)
    over = acting.until_over(percept(load=carried(share)))
    assert acting.human.phase == ("releasing" if lets_go else "retreating")
    assert over == pytest.approx(0.22 if lets_go else 3.01, abs=0.011)


def test_the_signs_have_to_last():
    acting = holding(assurance=0.2, patience=30.0)
    for _ in range(100):
        assert acting.step(percept(load=carried(0.5))) == "holding"
        if round(acting.t / DT) % 15 == 0:
            acting.step(percept(load=carried(1.0)))


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


def test_halfway_the_fingers_stop_until_less_of_the_weight_is_felt():
    acting = Acting("releasing", release_time=0.4, feeling_delay=0.1)
    grips = []
    for _ in range(120):
        if acting.step(percept(load=carried(0.71))) != "releasing":
            break
        grips.append(acting.human._grip)
    assert grips[:20] == pytest.approx([1.0 - DT * (i + 1) / 0.4 for i in range(20)])
    assert min(grips) == pytest.approx(0.5) and acting.human.phase == "holding"
    # Half of the release, the way of the feeling, and half a second.
    assert acting.t == pytest.approx(0.2 + 0.1 + 0.5, abs=1.1 * DT)


def test_what_the_robot_carries_is_let_go_and_the_hand_leaves():
    acting = Acting("releasing", release_time=0.4, feeling_delay=0.1)
    over = acting.until_over(percept(load=carried(0.69)))
    assert over == pytest.approx(0.3 + 0.2, abs=2.1 * DT) and acting.human.phase == "retreating"
    assert acting.human._grip == 0.0


def lifting(**changes):
    acting = Acting("lifting", "receive", **{"patience": 4.0} | changes)
    acting.human._grip, acting.human._closure = 1.0, 0.6
    return acting


@pytest.mark.parametrize(
    "closure, told, leaves",
    [(0.519, 0, True), (0.521, 0, False), (0.6, Say.YOU_HAVE_IT, True), (0.6, Say.I_HAVE_IT, False)],
)
def test_the_taker_leaves_a_moment_after_the_hand_has_opened_or_said_so(closure, told, leaves):
    acting = lifting()
    acting.human._told = told
    load = percept(load=carried(1.1), closure=closure)
    over = acting.until_over(load)
    assert acting.human.phase == ("retreating" if leaves else "releasing")
    if leaves:
        assert over == pytest.approx(0.22, abs=1.1 * DT)
        assert acting.human.grip_force.expected == pytest.approx(1.1 * WEIGHT), "now it has been felt"


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


def test_an_object_that_is_lost_for_a_moment_is_not_lost():
    acting = Acting("retreating", reach_time=10.0)
    acting.human._plan(0.0, np.zeros(3), Rotation.identity())
    for step in range(120):
        acting.step(percept(thing=(0.0, 0.9, 0.0) if step % 25 else (0.0, 0.1, 0.0)))
    assert acting.human._grip == 1.0
