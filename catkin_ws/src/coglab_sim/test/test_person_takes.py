"""How the simulated person takes an object and how they leave: distances, speeds and times of each phase."""

import numpy as np
import pytest
from coglab_msgs.msg import Say
from person_phase import DT, WEIGHT, Acting, carried, percept
from scipy.spatial.transform import Rotation


def grasping(away=0.05, **changes):
    """The object so far above where the hand takes it."""
    acting = Acting("grasping", "receive", **{"place_speed": 0.1, "grip_time": 0.25} | changes)
    return acting, percept(thing=(-0.08, 0.0, -0.05 + away), closure=0.6)


def test_the_last_way_is_closed_to_1_cm_and_then_the_hand_closes():
    acting, seen = grasping(0.05)
    acting.step(seen)
    assert acting.human._velocity == pytest.approx([0.0, 0.0, 0.1]) and acting.human._hand[2] == pytest.approx(0.001)
    while acting.human._grip == 0.0:
        left = 0.05 - acting.human._hand[2]
        acting.step(seen)
        if acting.human._grip == 0.0:
            assert acting.human._velocity[2] == pytest.approx(min(0.1, 4.0 * left))
    assert 0.05 - acting.human._hand[2] <= 0.010 and not acting.human._velocity.any()
    closing = acting.t
    assert acting.until_over(seen) - closing == pytest.approx(0.24, abs=1.1 * DT)
    assert acting.human.phase == "lifting" and acting.human._grip == 1.0 and acting.human._closure == 0.6


def test_a_step_is_never_longer_than_the_way():
    acting, seen = grasping(0.02)
    acting.step(seen, 10.0)
    assert acting.human._hand[2] == pytest.approx(0.02)


def test_who_does_not_come_to_the_object_gives_up_after_4_s():
    acting, _ = grasping()
    while acting.human.phase == "grasping":
        ahead = acting.human._hand + [-0.08, 0.5, -0.05]
        acting.step(percept(thing=ahead))
    assert acting.human.phase == "retreating" and acting.t == pytest.approx(4.01, abs=1.1 * DT)


@pytest.mark.parametrize(
    "behaviour, phase", [("early_release", "releasing"), ("pull_back", "releasing"), ("tug", "lifting")]
)
def test_misbehaving_takers_open_again(behaviour, phase):
    acting, seen = grasping(0.0, behaviour=behaviour)
    acting.until_over(seen)
    assert acting.human.phase == phase


def lifting(**changes):
    acting = Acting("lifting", "receive", **{"patience": 4.0} | changes)
    acting.human._grip, acting.human._closure = 1.0, 0.6
    return acting


@pytest.mark.parametrize(
    "behaviour, share, height",
    [("normal", 0.0, 0.03), ("normal", 1.19, 0.03), ("normal", 1.21, 0.0), ("never_release", 0.0, 0.0)],
)
def test_the_taker_rises_by_3_cm_until_more_than_the_weight_is_felt(behaviour, share, height):
    acting = lifting(behaviour=behaviour)
    acting.step(percept(load=carried(share), closure=0.6))
    assert acting.human._velocity == pytest.approx([0.0, 0.0, 0.03 if height else 0.0])
    assert acting.until_over(percept(load=carried(share), closure=0.6)) == pytest.approx(4.01, abs=1.1 * DT)
    assert acting.human.phase == "releasing" and acting.human._hand[2] == pytest.approx(height, abs=4e-4)


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


def test_who_had_begun_to_let_go_holds_on_again():
    grips = leaving(0.3, load=carried(1.0))
    assert grips[:8] == pytest.approx([0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.0]) and min(grips) > 0.39
    assert max(leaving(0.0, load=carried(1.0))) == 0.0, "an open hand stays open"


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
