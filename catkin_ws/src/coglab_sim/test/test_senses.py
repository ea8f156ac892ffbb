"""What a person perceives: late, noisy, above a threshold; the figures are those of the participant."""

import numpy as np
import pytest
from coglab_py.pose import Pose
from coglab_sim.person.in_cell import view_of
from coglab_sim.person.participant import Participant
from coglab_sim.person.scene import WorldView
from coglab_sim.person.senses import Senses

DT = 0.01


def perceive(person, view, seconds, seed=1):
    """Percepts over time of view(t)."""
    senses = Senses(person, np.random.default_rng(seed))
    return [(k * DT, senses.step(k * DT, view(k * DT))) for k in range(int(seconds / DT))]


QUIET = {"seen_noise": 0.0, "seen_turn": 0.0, "seen_speed": 0.0}


def test_everything_seen_comes_late():
    for seed in range(5):
        person = Participant.from_mapping({"seed": seed, **QUIET})

        def view(t):
            moved = Pose(np.array([t, 0.0, 0.0]))
            return WorldView(moved, t, moved)

        for t, seen in perceive(person, view, 2.0)[40:]:
            for value in (seen.robot_hand.position[0], seen.hand_closure, seen.object.position[0]):
                assert person.seeing_delay - 1e-9 <= t - value <= person.seeing_delay + DT + 1e-9
            assert seen.robot_speed == pytest.approx(1.0, abs=0.03)
            assert seen.closing_speed == pytest.approx(1.0, abs=0.07)


def test_what_is_seen_is_noisy_and_the_noise_is_slow():
    person = Participant.from_mapping({"seed": 2, "seen_noise": 0.004, "seen_turn": 2.0})
    seen = [p for _, p in perceive(person, lambda t: WorldView(), 300.0)]
    places = np.array([p.object.position for p in seen])
    assert places.std(axis=0) == pytest.approx([0.004] * 3, rel=0.2)
    x = places[:, 0] - places[:, 0].mean()
    assert float(x[30:] @ x[:-30] / (x @ x)) == pytest.approx(np.exp(-1.0), abs=0.12)
    turns = np.degrees([p.robot_hand.rotation.as_rotvec() for p in seen])
    assert turns.std(axis=0) == pytest.approx([2.0] * 3, rel=0.2)


def test_a_force_is_felt_late_and_only_from_the_threshold_on():
    person = Participant.from_mapping({"seed": 3, "felt_threshold": 0.4, "felt_share": 0.0})
    step = lambda newton: lambda t: WorldView(load=np.array([0.0, newton if t >= 1.0 else 0.0, -3.0]))  # noqa: E731
    weak = perceive(person, step(0.39), 2.0)
    assert all(p.load[1] == 0.0 for _, p in weak)
    strong = perceive(person, step(0.41), 2.0)
    felt = next(t for t, p in strong if p.load[1] > 0.0)
    assert felt == pytest.approx(1.0 + person.feeling_delay, abs=DT)


def test_a_small_change_of_a_large_force_is_not_noticed():
    person = Participant.from_mapping({"seed": 3, "felt_threshold": 0.1, "felt_share": 0.08})
    ramp = perceive(person, lambda t: WorldView(load=np.array([0.0, 0.0, -10.0 - 0.7 * min(t, 1.0)])), 2.0)
    assert {float(p.load[2]) for _, p in ramp} == {-10.0}


def test_a_robot_that_was_never_seen_before_is_not_at_rest():
    person = Participant.from_mapping({"seed": 3, **QUIET})
    first = perceive(person, lambda t: WorldView(), 0.3)
    assert first[0][1].robot_speed > 0.5 and first[-1][1].robot_speed < 0.03


def test_the_bend_of_the_fingers_is_seen_as_inexactly_as_their_tips():
    """The mean of four tips over their way of 0.19 m, each as noisy and as slow to change as any place that is seen;
    its speed is misjudged by the person's share, and by what any speed is."""
    person = Participant.from_mapping({"seed": 2, "seen_noise": 0.004, "seen_speed": 0.0})
    seen = [p for _, p in perceive(person, lambda t: WorldView(hand_closure=0.4), 300.0)]
    bend = np.array([p.hand_closure for p in seen])
    assert bend.mean() == pytest.approx(0.4, abs=0.002)
    assert bend.std() == pytest.approx(0.004 / 0.19 / 2, rel=0.2)
    x = bend - bend.mean()
    assert float(x[30:] @ x[:-30] / (x @ x)) == pytest.approx(np.exp(-1.0), abs=0.12)
    assert np.std([p.closing_speed for p in seen]) == pytest.approx(0.005 / 0.19 / 2, rel=0.1)
    person = Participant.from_mapping({"seed": 2, "seen_speed": 0.1})
    speeds = []
    for seed in range(40):
        seen = perceive(person, lambda t: WorldView(hand_closure=t), 1.0, seed)[50:]
        speeds.append(np.mean([p.closing_speed for _, p in seen]))
    assert np.std(speeds) == pytest.approx(0.1, rel=0.35)


def test_the_view_takes_the_fingers_from_the_plant():
    frame = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
    truth = {"robot_hand": frame, "object": frame, "human_force": [0.0, 0.0, 0.0]}
    assert view_of({**truth, "hand_closure": 0.25}).hand_closure == 0.25
