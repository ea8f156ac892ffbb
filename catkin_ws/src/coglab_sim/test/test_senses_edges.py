"""Senses step by step: exactly how late, over which time a speed is seen, and what is noticed."""

import numpy as np
import pytest
from coglab_py.pose import Pose, about_z
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import WorldView
from coglab_sim.person.senses import Delayed, Percept, Senses, SlowNoise

STEP = 1 / 64
BLIND = {"seen_noise": 0.0, "seen_turn": 0.0, "seen_speed": 0.0}


class Steady:
    """In the place of the generator: the same number for ever."""

    def __init__(self, value):
        self.value = value

    def normal(self, size=None):
        return self.value if size is None else np.full(size, self.value)


def test_a_delay_gives_back_what_is_old_enough():
    delayed = Delayed(0.25)
    seen = [delayed.step(0.125 * i, i) for i in range(8)]
    assert seen == [0, 0, 0, 1, 2, 3, 4, 5]
    assert delayed.step(1.49, 99) == 7 and delayed.step(2.0, 100) == 99
    at_once = Delayed(0.0)
    assert [at_once.step(t, t) for t in (0.0, 1.0, 1.0)] == [0.0, 1.0, 1.0]


def test_noise_keeps_its_share_of_a_third_of_a_second():
    noise = SlowNoise(Steady(1.0), np.array([2.0, 3.0]))
    keep = np.exp(-0.15 / 0.3)
    assert noise.step(0.15) == pytest.approx((keep + np.sqrt(1 - keep**2)) * np.array([2.0, 3.0]))
    assert SlowNoise(Steady(1.0), np.array([2.0])).step(0.0) == pytest.approx([2.0])
    assert SlowNoise(Steady(1.0), np.array([2.0])).step(1e9) == pytest.approx([2.0])


def moving(speed, closing=0.0, steps=64, until=99.0):
    """Percepts of a palm that goes along x; nothing is late."""
    senses = Senses(Participant(seeing_delay=0.0, feeling_delay=0.0, **BLIND), Steady(0.0))
    found = []
    for i in range(steps):
        t = STEP * i
        where = min(t, until)
        view = WorldView(Pose(np.array([speed * where, 0.0, 0.0])), closing * where)
        found.append(senses.step(t, view))
    return found


def test_a_speed_is_seen_over_the_last_moment():
    found = moving(0.4, -0.8)
    assert [p.robot_speed for p in found[:2]] == [1.0, 1.0], "what was never seen before is not at rest"
    assert [p.closing_speed for p in found[:2]] == [0.0, 0.0]
    for percept in found[2:]:
        assert percept.robot_speed == pytest.approx(0.4) and percept.closing_speed == pytest.approx(-0.8)
    stopped = moving(0.4, until=0.5)
    speeds = [p.robot_speed for p in stopped[32:40]]
    # Over the least that is no shorter than 0.05 s: four steps.
    assert speeds == pytest.approx([0.4, 0.3, 0.2, 0.1, 0.0, 0.0, 0.0, 0.0])


def test_speeds_are_misjudged_by_a_share_and_a_little():
    senses = Senses(Participant(seeing_delay=0.0, seen_noise=0.004, seen_speed=0.1), Steady(1.0))
    for i in range(8):
        t = STEP * i
        percept = senses.step(t, WorldView(Pose(np.array([0.4 * t, 0.0, 0.0])), 0.8 * t))
    assert percept.robot_speed == pytest.approx(1.1 * 0.4 + 0.005)
    assert percept.closing_speed == pytest.approx(1.1 * 0.8 + 0.005 / 0.19 / 2)
    slow = Senses(Participant(seeing_delay=0.0, seen_speed=0.0), Steady(-1.0))
    for i in range(8):
        percept = slow.step(STEP * i, WorldView())
    assert percept.robot_speed == 0.0, "no speed is less than none"


def test_poses_and_the_bend_are_seen_with_their_errors():
    senses = Senses(Participant(seeing_delay=0.0, seen_noise=0.004, seen_turn=2.0), Steady(1.0))
    palm, thing = Pose(np.array([1.0, 2.0, 3.0]), about_z(0.5)), Pose(np.array([0.0, 1.0, 0.0]))
    percept = senses.step(0.0, WorldView(palm, 0.25, thing))
    assert percept.hand_closure == pytest.approx(0.25 + 0.004 / 0.19 / 2)
    for true, seen in ((palm, percept.robot_hand), (thing, percept.object)):
        assert seen.position == pytest.approx(true.position + 0.004)
        turn = (seen.rotation * true.rotation.inv()).as_rotvec()
        assert np.degrees(turn) == pytest.approx([2.0, 2.0, 2.0])
    assert percept.true_hand is palm and percept.robot_hand is percept.robot_hand
    assert isinstance(percept, Percept)


def feeling(loads, **changes):
    senses = Senses(Participant(**BLIND, **{"feeling_delay": 0.0} | changes), Steady(0.0))
    return [float(senses.step(STEP * i, WorldView(load=np.array([0.0, 0.0, z]))).load[2]) for i, z in enumerate(loads)]


def test_a_force_is_felt_as_it_was_until_its_change_is_noticed():
    threshold = {"felt_threshold": 0.4, "felt_share": 0.0}
    assert feeling([0.39, 0.41, 0.8, 0.82, 0.1, 0.0], **threshold) == [0.0, 0.41, 0.41, 0.82, 0.1, 0.1]
    share = {"felt_threshold": 0.1, "felt_share": 0.1}
    assert feeling([-10.0, -10.9, -11.1, -10.1, -9.9], **share) == [-10.0, -10.0, -11.1, -11.1, -9.9]
    assert feeling([0.05, -0.09, 0.11], **share) == [0.0, 0.0, 0.11]


def test_what_is_felt_comes_later_by_its_own_delay():
    felt = feeling([0.0, 0.0, 5.0, 5.0, 5.0, 5.0], feeling_delay=2 * STEP, felt_threshold=0.4)
    assert felt == [0.0, 0.0, 0.0, 0.0, 5.0, 5.0]
    load = np.array([1.0, 2.0, 3.0])
    senses = Senses(Participant(feeling_delay=0.0), Steady(0.0))
    percept = senses.step(0.0, WorldView(load=load))
    load[0] = 9.0
    assert percept.load == pytest.approx([1.0, 2.0, 3.0]), "what was felt stays"
