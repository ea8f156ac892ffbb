"""How an object is given, phase by phase: when it counts as placed, held and taken, and how the hand goes meanwhile."""

import numpy as np
import pytest
from coglab_msgs.msg import Say
from coglab_py.pose import about_z
from coglab_sim.person.scene import Scene
from person_phase import DT, WEIGHT, Acting, carried, percept
from scipy.spatial.transform import Rotation

PALM = (0.0, 0.0, 0.0)
"""its outward axis is x, its fingers point along z"""


def before_palm(gap, aside=0.0):
    """Where the hand is whose mug stands so far before the palm: it is held 80 mm away and 80 mm thick."""
    return (0.08 + 0.04 + gap, 0.0, aside)


def placing(gap=0.05, aside=0.0, **changes):
    """The object so far before the palm; nothing was felt yet."""
    return Acting("placing", hand=before_palm(gap, aside), **changes)


# -- waiting ------------------------------------------------------------------------------------------------------


def test_an_object_counts_as_placed_by_a_hand_that_presses_or_closes():
    human = Acting("waiting", press=1.5).human
    assert not human._taken_already(percept(load=carried(1.0, 4.0), closure=0.5), False), (
        "not near: nothing to do with it"
    )
    assert not human._taken_already(percept(load=carried(1.0, 5.49), closure=0.5), True)
    assert human._taken_already(percept(load=carried(1.0, 5.5), closure=0.5), True)
    assert human._taken_already(percept(load=carried(1.0, 2.5), closure=0.5), True), "in any direction"
    assert not human._taken_already(percept(load=carried(1.0, 4.0), closure=0.3), True), "fingers that open further"
    assert not human._taken_already(percept(load=carried(1.0, 4.0), closure=0.379), True)
    assert human._taken_already(percept(load=carried(1.0, 4.0), closure=0.381), True), "and then close"
    used = Acting("waiting", press=1.5, used_to_touch=True).human
    assert not used._taken_already(percept(load=carried(1.0)), False)
    assert not used._taken_already(percept(load=carried(1.0, 9.0)), True)


# -- placing ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap, speed", [(0.20, 0.10), (0.03, 0.10), (0.02, 0.08), (0.0, 0.04), (-0.03, 0.04)])
def test_the_object_is_brought_against_the_palm_slower_over_the_last_way(gap, speed):
    acting = placing(gap)
    acting.human._since = -1.0
    acting.step(percept(PALM))
    assert acting.human._velocity == pytest.approx([-speed, 0.0, 0.0])
    assert acting.human._hand == pytest.approx(np.array(before_palm(gap)) - [DT * speed, 0.0, 0.0])


def test_it_takes_a_moment_until_the_hand_is_as_fast():
    acting = placing(0.20)
    speeds = []
    for _ in range(20):
        acting.step(percept(PALM))
        speeds.append(-acting.human._velocity[0])
    assert speeds == pytest.approx([0.10 * min(1.0, DT * (i + 1) / 0.15) for i in range(20)])


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


def test_where_nothing_is_felt_the_hand_stops_5_cm_past_the_palm_or_after_4_s():
    assert placing(-0.049).step(percept(PALM)) == "placing"
    assert placing(-0.051).step(percept(PALM)) == "holding"
    acting = placing(3.0)
    assert acting.until_over(percept(PALM)) == pytest.approx(4.0, abs=1.5 * DT) and acting.human.phase == "holding"
    touched = placing(-0.051)
    assert touched.step(percept(PALM, load=carried(0.0, 0.2))) == "placing", "who feels the palm goes on"


def test_misbehaving_givers_let_go_at_the_touch_or_take_it_back():
    early = placing(0.0, behaviour="early_release")
    hand = early.human._hand.copy()
    assert early.step(percept(PALM)) == "placing"
    moved = early.human._hand.copy()
    assert not np.array_equal(moved, hand)
    assert early.step(percept(PALM, load=carried(0.0, 0.2))) == "releasing"
    assert np.array_equal(early.human._hand, moved), "not a step further"
    back = placing(0.0, behaviour="pull_back")
    assert back.step(percept(PALM, load=carried(0.0, 1.4))) == "placing"
    assert back.step(percept(PALM, load=carried(0.0, 1.6))) == "retreating"


@pytest.mark.parametrize(
    "aside, speed", [(0.03, -0.05), (0.02, -0.04), (0.011, -0.022), (0.010, 0.0), (-0.02, 0.04), (-0.2, 0.05)]
)
def test_who_has_the_habit_brings_it_to_the_middle_of_the_palm(aside, speed):
    acting = placing(0.2, aside, aligns_within=0.010)
    acting.human._since = -1.0
    acting.step(percept(PALM))
    assert acting.human._velocity == pytest.approx([-0.10, 0.0, speed])
    acting = placing(0.2, aside)
    acting.step(percept(PALM))
    assert acting.human._velocity[2] == 0.0, "a habit"


def test_the_thickness_is_that_of_the_object_as_it_is_turned():
    scene = Scene(object_size=np.array([0.08, 0.06, 0.10]))
    human = Acting("placing", scene=scene).human
    assert [human._thickness(axis) for axis in np.eye(3)] == pytest.approx([0.04, 0.03, 0.05])
    human.scene.object_turn = about_z(np.pi / 2)
    assert [human._thickness(axis) for axis in np.eye(3)] == pytest.approx([0.03, 0.04, 0.05])
    human._turn = Rotation.from_rotvec([0.0, np.pi / 2, 0.0])
    assert [human._thickness(axis) for axis in np.eye(3)] == pytest.approx([0.05, 0.04, 0.03])


# -- holding ------------------------------------------------------------------------------------------------------


def test_fingers_that_had_begun_to_open_hold_fast_again_in_a_tenth_of_a_second():
    acting = Acting("holding")
    acting.human._grip = 0.5
    for expected in (0.6, 0.7, 0.8, 0.9, 1.0, 1.0):
        acting.step(percept(load=carried(1.0)))
        assert acting.human._grip == pytest.approx(expected)


def test_an_arm_that_has_sunk_rises_again():
    acting = Acting("holding")
    acting.human._sunk = 0.0005
    acting.step(percept(load=carried(1.0)))
    assert acting.human._velocity == pytest.approx([0.0, 0.0, 0.03])
    assert acting.human._hand[2] == pytest.approx(0.0003) and acting.human._sunk == pytest.approx(0.0002)
    acting.step(percept(load=carried(1.0)))
    acting.step(percept(load=carried(1.0)))
    assert not acting.human._velocity.any() and acting.human._hand[2] == pytest.approx(0.0006)


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


def test_a_closed_hand_is_believed_after_a_while_by_who_has_the_habit():
    acting = holding(Say.I_HAVE_IT, believes_closed=3.0, assurance=0.2)
    assert acting.until_over(percept(load=carried(1.0), **CLOSED)) == pytest.approx(3.23, abs=2.1 * DT)
    assert acting.human.phase == "releasing"


def test_who_tugs_pulls_to_and_fro_for_three_seconds_once_the_hand_has_closed():
    acting = holding(behaviour="tug", patience=60.0)
    assert acting.step(percept(load=carried(1.0))) == "holding" and not acting.human._velocity.any()
    begin, places = acting.t + DT, []
    while acting.step(percept(load=carried(1.0), **CLOSED)) == "holding":
        since = acting.t - begin
        assert acting.human._velocity == pytest.approx([0.012 * 3 * np.pi * np.cos(3 * np.pi * since), 0.0, 0.0])
        places.append(acting.human._hand[0])
    assert acting.human.phase == "releasing" and 3.0 < acting.t - begin < 3.02
    assert max(places) == pytest.approx(0.012, abs=0.001) and min(places) == pytest.approx(-0.012, abs=0.001)
    assert abs(places[-1]) < 0.003, "let go near the middle"


def test_who_never_lets_go_takes_it_back_when_the_patience_ends():
    acting = holding(behaviour="never_release", patience=2.0)
    assert acting.until_over(percept(load=carried(0.0), **CLOSED)) == pytest.approx(2.01, abs=DT)
    assert acting.human.phase == "retreating"


def backed_away(presses_again=4, tries=0, **seen):
    """s until it is pressed again into an open hand that stands 50 mm before the mug."""
    acting = holding(presses_again=presses_again, patience=5.0, press=1.5)
    acting.human._tries = tries
    seen = {"load": carried(1.0), "palm": (0.09, 0.0, 0.05)} | seen
    over = acting.until_over(percept(**seen))
    return over if acting.human.phase == "placing" else None


def test_an_object_is_pressed_again_into_an_open_hand_that_stands_near():
    assert backed_away() == pytest.approx(0.52, abs=1.1 * DT)
    assert backed_away(tries=3) is not None and backed_away(tries=4) is None and backed_away(0) is None
    assert backed_away(load=carried(1.0, 0.74)) is not None and backed_away(load=carried(1.0, 0.75)) is None
    assert backed_away(speed=0.019) is not None and backed_away(speed=0.02) is None
    assert backed_away(closing=0.1) is not None and backed_away(closing=0.11) is None
    assert backed_away(palm=(0.139, 0.0, 0.05)) is not None and backed_away(palm=(0.141, 0.0, 0.05)) is None
    acting = holding(presses_again=4)
    acting.until_over(percept((0.09, 0.0, 0.05), load=carried(1.0)))
    assert acting.human._tries == 1


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


@pytest.mark.parametrize("task, behaviour", [("give", "early_release"), ("receive", "normal")])
def test_who_does_not_care_or_has_taken_opens_at_once(task, behaviour):
    acting = Acting("releasing", task, behaviour=behaviour, release_time=0.4)
    acting.human._grip = 1.0
    assert acting.until_over(percept(load=carried(1.0))) == pytest.approx(0.4, abs=1.1 * DT)
    assert acting.human.phase == "retreating"


def test_the_arm_of_who_relaxes_sinks_by_15_mm_meanwhile():
    acting = Acting("releasing", release_time=0.4, feeling_delay=0.1, relaxes=True)
    lowest = 0.0
    while acting.step(percept(load=carried(1.0))) == "releasing":
        if acting.human._grip < 1.0 and acting.human._velocity[2] != 0.0:
            assert acting.human._velocity == pytest.approx([0.0, 0.0, -0.03])
        lowest = min(lowest, acting.human._hand[2])
    assert lowest == pytest.approx(-0.015, abs=0.0004) and acting.human._sunk == pytest.approx(-lowest)


def test_the_weight_is_what_the_person_expects():
    human = Acting("holding").human
    assert human._weight() == pytest.approx(WEIGHT)
    assert human._load_share(percept(load=carried(0.4))) == pytest.approx(0.4)
    human.grip_force.has_felt(0.0)
    assert human._weight() == 1e-3
