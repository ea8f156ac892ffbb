"""The virtual human with a simple robot hand: phases, timing, and the effect of each behaviour."""

import dataclasses

import numpy as np
import pytest
from coglab_msgs.msg import Say
from coglab_py.pose import Pose
from coglab_sim.person.participant import BEHAVIOURS, HABITS, PROFILES, Participant
from coglab_sim.person.scene import Scene, WorldView, shipped
from coglab_sim.person.virtual_human import VirtualHuman
from person_stage import DT, PALM_TURN, Stage, give

WHOLE = ["idle", "reacting", "reaching", "waiting", "placing", "holding", "releasing", "retreating", "idle"]


@pytest.mark.parametrize("profile", PROFILES)
def test_a_normal_giver_goes_through_all_phases(profile):
    for seed in range(1, 8):
        stage = give(seed=seed, profile=profile)
        assert list(dict.fromkeys(stage.phases[1:-1])) == WHOLE[1:-1] and stage.phases[-1] == "idle", seed
        assert stage.samples[-1].grip == 0.0
        assert stage.samples[-1].frame.position == pytest.approx(stage.human.rest, abs=0.01)


def test_load_alone_or_smaller_load_with_felt_grip_releases():
    """The robot carries everything, or a tenth with a hand seen closed and 'I have it' heard; or nothing is felt."""
    whole = give(carries=1.0)
    together = give(carries=0.1, says=True)
    assert whole.samples[-1].grip == 0.0 and "releasing" in together.phases
    wait = whole.first("releasing") - whole.touched_at - 1.3
    p = whole.human.participant
    assert p.feeling_delay + p.assurance - DT <= wait <= p.feeling_delay + p.assurance + 0.3


def test_hand_that_closes_without_carrying_gets_no_object():
    """The person feels no grip and hears nothing: load and grip are missing."""
    stage = give(carries=0.0, seconds=12.0)
    assert min(s.grip for s in stage.samples) > 0.3
    assert stage.phases[-1] in ("holding", "releasing", "retreating")


def test_person_presses_again_a_limited_number_of_times():
    """From the first touch on, the palm is 3 cm farther away."""
    stage = Stage(closes=False)
    stage.human.hear(0.0, Say.READY_TO_RECEIVE)
    while stage.human.phase != "holding":
        stage.step()
    stage.palm = stage.palm - [0.0, 0.03, 0.0]
    stage.came_to = stage.palm
    stage.touched_at = None
    stage.run(4.0)
    assert stage.phases[stage.phases.index("holding") :][:3] == ["holding", "placing", "holding"]
    assert stage.touched_at is not None, "touched again"
    away = give(closes=False, seconds=30.0)
    assert 1 <= away.phases.count("placing") <= 5 and away.samples[-1].grip == 1.0


WITHOUT = {f.name: f.default for f in dataclasses.fields(Participant) if f.name in HABITS}
"""Values of drawn people, who have no habits."""


def test_without_the_habit_an_object_is_pressed_once():
    away = give(closes=False, seconds=30.0, changes=WITHOUT)
    assert away.phases.count("placing") == 1 and away.samples[-1].grip == 1.0


def test_giver_waits_for_trust_or_places_while_robot_moves():
    calm = give(changes={"trust": 0.8})
    hasty = give(changes={"trust": 0.1})
    assert calm.first("placing") - hasty.first("placing") == pytest.approx(0.7, abs=0.15)
    early = give(changes={"places_while_moving": True}, pace=0.3)
    before = int(early.first("placing") / DT)
    assert np.linalg.norm(early.palms[before + 1] - early.palms[before]) > 0.0, "the arm still moved"


def test_the_same_seed_gives_the_same_hand():
    a, b = give(seed=5), give(seed=5)
    assert all(np.array_equal(x.frame.position, y.frame.position) for x, y in zip(a.samples, b.samples, strict=False))
    c = give(seed=6)
    pairs = zip(a.samples, c.samples, strict=False)
    assert any(not np.array_equal(x.frame.position, y.frame.position) for x, y in pairs)


def test_grip_follows_mass_and_friction_and_is_limited():
    def grip(mass, friction, limit=40.0):
        scene = Scene(object_mass=mass, object_friction=friction)
        human = VirtualHuman(dataclasses.replace(Participant.draw(3), grip_limit=limit), scene)
        view = WorldView(load=np.array([0.0, 0.0, -9.81 * mass]))
        return human.step(0.0, view).grip_force

    light, heavy = grip(0.1, 0.8), grip(0.2, 0.8)
    assert heavy == pytest.approx(2 * light) and grip(0.2, 0.4) == pytest.approx(2 * heavy)
    assert grip(5.0, 0.3) == 40.0 and grip(5.0, 0.3, 25.0) == 25.0
    for name in ("ball", "bottle", "mug", "screwdriver", "tea_box"):
        scene = Scene.of(shipped(name))
        slips = scene.object_mass * 9.81 / (2 * scene.object_friction)
        forces = [VirtualHuman(Participant.draw(s), scene).grip_force.force for s in range(50)]
        assert min(forces) > 1.5 * slips and max(forces) <= 40.0, name


def test_nobody_waits_for_ever_for_a_robot_that_does_not_come():
    stage = give(robot_comes=False, seconds=25.0)
    assert stage.phases[-2:] == ["retreating", "idle"] and stage.samples[-1].grip == 1.0


def test_absent_does_nothing():
    assert give(behaviour="absent").phases == ["idle"]


def test_slow_takes_about_twice_as_long():
    def reaching(b):
        return sum(s.phase == "reaching" for s in give(behaviour=b, seed=3).samples)

    assert reaching("slow") > 1.6 * reaching("normal")


def test_hesitant_stops_on_the_way():
    assert "hesitating" in give(behaviour="hesitant").phases


def test_early_release_lets_go_before_the_robot_has_closed():
    stage = give(behaviour="early_release")
    first_release = next(i for i, s in enumerate(stage.samples) if s.grip < 1.0) * DT
    assert first_release < stage.touched_at + 0.5


def test_never_release_keeps_the_object():
    stage = give(behaviour="never_release", seconds=25.0)
    assert min(s.grip for s in stage.samples) == 1.0 and stage.phases[-1] == "idle"


def test_pull_back_takes_the_object_away_again():
    stage = give(behaviour="pull_back")
    assert stage.phases[-2:] == ["retreating", "idle"] and stage.samples[-1].grip == 1.0


def test_change_side_ends_elsewhere():
    a, b = give(seed=2), give(seed=2, behaviour="change_side")
    at = lambda s: next(x.frame.position for x in s.samples if x.phase == "waiting")  # noqa: E731
    assert at(b)[1] < at(a)[1] - 0.1


def test_tug_pulls_before_letting_go():
    stage = give(behaviour="tug")
    x = [s.frame.position[0] for s in stage.samples if s.phase == "holding"]
    assert max(x) - min(x) > 0.015 and stage.samples[-1].grip == 0.0


@pytest.mark.parametrize("code", [Say.GIVEN_UP, Say.PLEASE_STEP_BACK])
def test_a_robot_that_gives_up_is_believed(code):
    stage = Stage(robot_comes=False)
    stage.human.hear(stage.t, Say.READY_TO_RECEIVE)
    stage.run(2.5)
    stage.human.hear(stage.t, code)
    before = len(stage.samples)
    stage.run(3.0)
    assert stage.phases[-2:] == ["retreating", "idle"]
    heard = next(i for i, s in enumerate(stage.samples[before:]) if s.phase == "retreating") * DT
    assert heard == pytest.approx(stage.human.participant.hearing_delay, abs=2 * DT)


def test_commands_and_files_are_checked():
    with pytest.raises(ValueError, match="give, receive"):
        Stage().human.command("juggle")
    with pytest.raises(ValueError, match="hat"):
        Participant.from_mapping({"seed": 1, "hat": "green"})
    with pytest.raises(ValueError, match="angry"):
        Participant(behaviour="angry")
    with pytest.raises(ValueError, match="'saint'.* drawn, patient, accustomed"):
        Participant.from_mapping({"profile": "saint"})
    assert set(BEHAVIOURS) >= {"normal", "tug"}


def receive(offered, seed=3, seconds=6.0, appears_at=0.6, opens_at=np.inf, **changes):
    """A person who is to take the object out of a robot's hand that appears ``appears_at`` s after the request."""
    scene = Scene()
    person = Participant.from_mapping({"seed": seed, "profile": "accustomed", **changes})
    human = VirtualHuman(person, scene, holds_object=False)
    far, samples, t = np.array([0.3, 0.0, 0.6]), [], 0.0
    human.command("receive mug")
    for _ in range(int(seconds / DT)):
        t += DT
        place = np.asarray(offered) if t >= appears_at else far
        load = np.zeros(3) if t < opens_at else np.array([0, 0, -3.0])
        view = WorldView(Pose(place - [0.0, 0.04, -0.05], PALM_TURN), 0.5 if t < opens_at else 0.1, Pose(place), load)
        samples.append((t, human.step(t, view)))
    return human, scene, samples


def test_a_nearer_robot_hand_draws_the_reach_toward_it():
    offered = np.array([0.90, 0.10, 0.36])
    _, scene, samples = receive(offered)
    waiting = next(s for _, s in samples if s.phase == "waiting")
    assert np.linalg.norm(waiting.frame.position + scene.taken_in_hand - offered) < 0.03
    _, _, plain = receive(np.array([0.3, 0.0, 0.6]))
    own = next(s for _, s in plain if s.phase == "waiting")
    assert np.linalg.norm(own.frame.position + scene.taken_in_hand - offered) > 0.05


def test_the_correction_comes_after_the_way_from_eye_to_hand_and_without_a_step():
    delay = 0.18
    quiet = {"seeing_delay": delay, "seen_noise": 0.0, "seen_turn": 0.0}
    _, _, corrected = receive(np.array([0.90, 0.10, 0.36]), **quiet)
    _, _, plain = receive(np.array([0.3, 0.0, 0.6]), **quiet)
    differs = next(
        t for (t, a), (_, b) in zip(corrected, plain, strict=True) if np.linalg.norm(a.velocity - b.velocity) > 1e-9
    )
    assert 0.6 + delay - 1e-9 <= differs <= 0.6 + delay + 0.10 + 2 * DT
    reaching = [s.velocity for _, s in corrected if s.phase == "reaching"]
    assert max(np.linalg.norm(b - a) for a, b in zip(reaching, reaching[1:], strict=False)) < 0.12


def test_the_taker_goes_when_the_robots_hand_is_seen_to_open():
    human, _, samples = receive(np.array([0.80, 0.05, 0.40]), seconds=12.0, opens_at=8.0)
    phases = list(dict.fromkeys(s.phase for _, s in samples))
    assert phases == ["reacting", "reaching", "waiting", "grasping", "lifting", "retreating", "idle"]
    left = next(t for t, s in samples if s.phase == "retreating")
    assert left >= 8.0 + human.participant.seeing_delay
    assert samples[-1][1].grip == 1.0


def person(name, knows_weight=True):
    """A person who begins with this object and knows its weight."""
    participant = dataclasses.replace(Participant.draw(3), weight_error=0.2)
    return VirtualHuman(participant, Scene.of(shipped(name)), knows_weight)


@pytest.mark.parametrize("knows_weight", [True, False])
def test_person_with_a_later_object_acts_as_if_started_with_it(knows_weight):
    human, fresh = person("mug"), person("bottle", knows_weight)
    human.step(0.0, WorldView())
    human.meets(Scene.of(shipped("bottle")), knows_weight)
    assert human.grip_force.expected == fresh.grip_force.expected == pytest.approx(0.53 * 9.81, rel=0.25)
    assert (human.grip_force.expected == pytest.approx(0.53 * 9.81)) == knows_weight
    assert human.grip_force.force == fresh.grip_force.force
    for field in dataclasses.fields(Scene):
        assert np.array_equal(getattr(human.scene, field.name), getattr(fresh.scene, field.name)), field.name
