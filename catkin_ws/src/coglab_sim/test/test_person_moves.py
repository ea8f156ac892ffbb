"""When the simulated person begins, reaches and waits: times, places and distances of each."""

import numpy as np
import pytest
from coglab_msgs.msg import Say
from coglab_py.pose import Pose
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import Scene, WorldView
from coglab_sim.person.virtual_human import VirtualHuman
from person_phase import DT, Acting, carried, percept
from scipy.spatial.transform import Rotation

CALM = {
    "reaction_sigma": 0.0,
    "reach_sigma": 0.0,
    "point_sigma": (0.0, 0.0, 0.0),
    "tilt": 0.0,
    "sway": 0.0,
    "tremor": 0.0,
}


def person(holds=True, **changes):
    return VirtualHuman(Participant(seed=1, **(CALM | changes)), Scene(), holds)


def steps(human, seconds, begin=0.0, view=None):
    """(time, sample) of so many seconds with the robot far away; the object is where the person carries it."""
    found = []
    for i in range(round(seconds / DT)):
        t = begin + DT * (i + 1)
        thing = human._hand + human.scene.object_in_hand
        found.append((t, human.step(t, view or WorldView(Pose(np.array([-5.0, 0, 0])), 0.0, Pose(thing)))))
    return found


def began(found, phase):
    return next(t for t, sample in found if sample.phase == phase)


# -- asked and told -----------------------------------------------------------------------------------------------


def test_a_person_begins_at_rest_with_or_without_the_object():
    human = person()
    assert (human.phase, human.trial, human.holds()) == ("idle", 0, True)
    assert person(False).holds() is False
    (_, first), (_, second) = steps(human, 2 * DT)
    assert first.phase == "idle" and not first.velocity.any() and not second.spin.any()
    assert first.frame.position == pytest.approx([1.30, 0.20, 0.15]) and first.grip == 1.0
    assert steps(person(left_handed=True), DT)[0][1].frame.position == pytest.approx([1.30, -0.20, 0.15])


@pytest.mark.parametrize("grip, holds", [(0.5, False), (0.51, True)])
def test_a_hand_holds_that_is_more_than_half_closed(grip, holds):
    human = person()
    human._grip = grip
    assert human.holds() is holds


@pytest.mark.parametrize(
    "holds, asked, begins",
    [
        (True, "give mug", True),
        (False, "give mug", False),
        (False, "receive mug", True),
        (True, "receive mug", False),
        (True, "rest", False),
        (True, "", False),
        (True, "give", True),
    ],
)
def test_only_what_can_be_done_is_begun(holds, asked, begins):
    human = person(holds)
    human.command(asked)
    steps(human, DT)
    assert human.phase == ("reacting" if begins else "idle") and human.trial == begins


@pytest.mark.parametrize(
    "code, holds, phase",
    [
        (Say.READY_TO_RECEIVE, True, "reacting"),
        (Say.READY_TO_GIVE, False, "reacting"),
        (Say.READY_TO_GIVE, True, "idle"),
        (Say.I_HAVE_IT, True, "idle"),
    ],
)
def test_what_is_said_is_understood_after_the_hearing_delay(code, holds, phase):
    human = person(holds, hearing_delay=0.3)
    human.hear(0.0, code)
    assert steps(human, 0.29)[-1][1].phase == "idle" and human._told == Say.NOTHING
    assert steps(human, 0.02, 0.29)[-1][1].phase == phase and human._told == code


def test_the_same_request_twice_is_one_and_rest_ends_it():
    human = person()
    human.command("give mug")
    steps(human, 0.5)
    phase = human.phase
    human.command("give mug")
    steps(human, DT, 0.5)
    assert human.trial == 1 and human.phase == phase == "reaching"
    human.command("rest")
    steps(human, DT, 0.51)
    assert human.phase == "retreating"
    human.command("rest")
    found = steps(human, 4.0, 0.52)
    assert found[-1][1].phase == "idle" and found[-1][1].frame.position == pytest.approx([1.30, 0.20, 0.15])
    assert began(found, "idle") < 3.0, "and does not begin anew"
    human.command("give mug")
    steps(human, DT, 4.52)
    assert human.trial == 2


@pytest.mark.parametrize("behaviour, factor", [("normal", 1.0), ("slow", 2.0)])
def test_the_reaction_gets_shorter_over_the_first_three_trials(behaviour, factor):
    human, now = person(reaction_median=0.4, learning=0.1, behaviour=behaviour), 0.0
    for share in (1.0, 0.9, 0.81, 0.729, 0.729):
        human.command("give mug")
        found = steps(human, 1.2, now)
        assert began(found, "reaching") - began(found, "reacting") == pytest.approx(0.4 * share * factor, abs=1.1 * DT)
        human.command("rest")
        steps(human, 4.0, now + 1.2)
        now += 5.2


def test_trials_differ_by_the_sigma_of_the_reaction():
    times = []
    human, now = person(reaction_sigma=0.3, learning=0.0, reaction_median=0.4), 0.0
    for _ in range(60):
        human.command("give mug")
        steps(human, DT, now)
        times.append(human._reaction)
        human._go("idle", now)
        now += 1.0
    assert np.log(times).mean() == pytest.approx(np.log(0.4), abs=0.12)
    assert np.log(times).std() == pytest.approx(0.3, rel=0.25)


# -- the reach ----------------------------------------------------------------------------------------------------


def reaching(behaviour="normal", seconds=6.0, **changes):
    human = person(behaviour=behaviour, reaction_median=0.2, reach_time=1.0, learning=0.0, **changes)
    human.command("give mug")
    return human, steps(human, seconds)


def test_a_reach_takes_as_long_as_its_way_and_ends_at_the_handover():
    human, found = reaching(point_offset=(0.01, 0.02, 0.03))
    # The object comes to the handover point and this person's offset; it is held 80 mm before the hand, 50 mm below.
    end = np.array([0.78, 0.03, 0.39]) + [0.01, 0.02, 0.03] - [-0.08, 0.0, -0.05]
    assert human._hand == pytest.approx(end)
    way = np.linalg.norm(end - [1.30, 0.20, 0.15])
    expected = (way / 0.45) ** 0.3
    assert began(found, "waiting") - began(found, "reaching") == pytest.approx(expected, abs=1.1 * DT)
    _, slow = reaching("slow", patience=2.0)
    assert began(slow, "waiting") - began(slow, "reaching") == pytest.approx(2 * 0.99 * expected, rel=0.03)


def test_a_left_handed_reach_is_mirrored_and_a_bow_is_above_the_straight_way():
    human, _ = reaching(left_handed=True)
    assert human._hand == pytest.approx([0.86, -0.03, 0.44])
    _, bowed = reaching(bow=0.04)
    _, plain = reaching()
    higher = [a.frame.position[2] - b.frame.position[2] for (_, a), (_, b) in zip(bowed, plain, strict=True)]
    assert max(higher) == pytest.approx(0.04, abs=0.001) and min(higher) > -1e-9
    human, _ = reaching(bow=0.04)
    human.command("rest")
    back = [s.frame.position[2] for _, s in steps(human, 3.0, 6.0)]
    assert max(back) <= 0.44 + 1e-9, "nothing but the reach is bowed"


def test_inside_the_box_means_the_nearest_place_in_it():
    human, _ = reaching(point_offset=(0.5, -0.5, 0.5), inside_box=True)
    assert human._hand == pytest.approx(np.array([0.81, -0.12, 0.46]) + [0.08, 0.0, 0.05])


def test_the_durations_of_trials_spread():
    lengths = []
    for seed in range(150):
        human = VirtualHuman(Participant(seed=seed, reach_sigma=0.12), Scene())
        human._plan(0.0, human._hand + [0.45, 0.0, 0.0], Rotation.identity())
        lengths.append(human._reach.duration)
    assert np.log(lengths).mean() == pytest.approx(np.log(1.1), abs=0.03)
    assert np.log(lengths).std() == pytest.approx(0.12, rel=0.2)


def test_who_hesitates_stops_at_45_percent_for_0_7_s():
    human, found = reaching("hesitant")
    stopped = began(found, "hesitating")
    assert stopped - began(found, "reaching") == pytest.approx(0.45 * (np.linalg.norm(
        np.array([0.86, 0.03, 0.44]) - [1.30, 0.20, 0.15]) / 0.45) ** 0.3, abs=1.6 * DT)  # fmt: skip
    pause = [(t, s) for t, s in found if s.phase == "hesitating"]
    assert len(pause) * DT == pytest.approx(0.7, abs=1.6 * DT)
    speeds = [np.linalg.norm(s.velocity) for _, s in pause]
    assert speeds[10] / speeds[2] == pytest.approx(np.exp(-0.08 / 0.08), rel=1e-6)
    assert found[-1][1].phase == "waiting" and human._hand == pytest.approx([0.86, 0.03, 0.44])


def test_who_changes_side_goes_16_cm_to_the_right_from_45_percent_on():
    human, found = reaching("change_side")
    assert human._hand == pytest.approx([0.86, 0.03 - 0.16, 0.44])
    _, plain = reaching()
    differs = next(t for (t, a), (_, b) in zip(found, plain, strict=True) if np.any(a.velocity != b.velocity))
    assert differs - began(found, "reaching") == pytest.approx(0.45 * 1.062, abs=2.1 * DT)


@pytest.mark.parametrize("gap, retreats", [(0.249, True), (0.251, False)])
def test_who_withdraws_takes_the_offer_back_when_the_hand_comes(gap, retreats):
    for phase in ("reaching", "waiting"):
        acting = Acting(phase, behaviour="withdraws")
        acting.human._plan(0.0, np.array([0.5, 0.0, 0.0]), Rotation.identity())
        acting.human.phase = phase
        assert acting.step(percept((0.04 + gap, 0.0, 0.05))) == ("retreating" if retreats else phase)
    human = acting.human
    human.trial = 5
    assert human._withdraws(0.1) is True
    human.trial = 6
    assert human._withdraws(0.1) is False, "five times"
    human.trial, human._task = 1, "receive"
    assert human._withdraws(0.1) is False


# -- waiting ------------------------------------------------------------------------------------------------------


def waiting(task="give", **changes):
    acting = Acting("waiting", task, **{"trust": 0.5, "patience": 3.0} | changes)
    acting.human._held_load = np.array(carried(1.0))
    return acting


@pytest.mark.parametrize("gap, speed, places", [(0.099, 0.019, True), (0.101, 0.0, False), (0.05, 0.02, False)])
def test_a_hand_that_is_near_and_still_is_trusted_after_a_while(gap, speed, places):
    acting = waiting()
    over = acting.until_over(percept((0.04 + gap, 0.0, 0.05), speed=speed, load=carried(1.0)))
    assert acting.human.phase == ("placing" if places else "retreating")
    assert over == pytest.approx(0.52 if places else 3.01, abs=1.1 * DT)


def test_trust_begins_anew_with_every_movement():
    acting = waiting()
    for _ in range(5):
        for _ in range(45):
            acting.step(percept((0.09, 0.0, 0.05), load=carried(1.0)))
        assert acting.step(percept((0.09, 0.0, 0.05), speed=0.03, load=carried(1.0))) == "waiting"


@pytest.mark.parametrize(
    "changes, gap, speed, places",
    [
        ({"places_while_moving": True}, 0.09, 0.5, True),
        ({"places_while_moving": True}, 0.11, 0.5, False),
        ({"behaviour": "early_contact"}, 0.19, 0.05, True),
        ({"behaviour": "early_contact"}, 0.21, 0.05, False),
        ({"behaviour": "early_contact"}, 0.19, 0.01, False),
        ({}, 0.09, 0.5, False),
    ],
)
def test_some_do_not_wait_for_rest(changes, gap, speed, places):
    acting = waiting(**changes)
    found = acting.step(percept((0.04 + gap, 0.0, 0.05), speed=speed, load=carried(1.0)))
    assert found == ("placing" if places else "waiting")
    taker = waiting("receive", **changes)
    assert (taker.step(percept(thing=(-0.08 - gap, 0.0, -0.05), speed=speed)) == "grasping") == (
        places and "behaviour" not in changes
    )


def test_a_hand_that_has_been_near_and_goes_away_has_given_up():
    for gap, retreats in ((0.349, False), (0.351, True)):
        acting = waiting()
        away = percept((0.04 + gap, 0.0, 0.05), load=carried(1.0))
        assert acting.step(away) == "waiting", "it has not been near yet"
        acting.step(percept((0.13, 0.0, 0.05), load=carried(1.0)))
        assert acting.step(away) == ("retreating" if retreats else "waiting")


def test_the_taker_looks_at_the_way_to_the_object():
    acting = waiting("receive")
    assert acting.until_over(percept(thing=(-0.08, 0.099, -0.05))) == pytest.approx(0.52, abs=1.1 * DT)
    assert acting.human.phase == "grasping"
    acting = waiting("receive")
    assert acting.until_over(percept(thing=(-0.08, 0.101, -0.05))) == pytest.approx(3.01, abs=1.1 * DT)
