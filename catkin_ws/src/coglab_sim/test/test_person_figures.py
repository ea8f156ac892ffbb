"""The simulated person's figures as docs/people.md states them: those of everybody, those of a person whom nobody drew,
and how the others are drawn."""

import importlib
import math
from dataclasses import fields, replace

import numpy as np
import pytest
from coglab_sim import conditions
from coglab_sim.conditions import CAREFUL, CONSIDERATE, HARDSHIPS, PATIENT, THE_WORLD_AS_IT_IS, Conditions, hardship
from coglab_sim.person.grip import GripForce
from coglab_sim.person.involuntary import involuntary
from coglab_sim.person.participant import BEHAVIOURS, HABITS, PROFILES, Participant, within
from coglab_sim.person.scene import HandSample, Scene, WorldView, shipped

EVERYBODY = {
    "giving": {
        **{"BEYOND": 0.05, "PLACES_WITHIN": 4.0, "AFTER_TOUCH": 0.02, "RAMP": 0.15, "FOLLOW_UP": 0.015},
        **{"CLOSED": 0.08, "CLOSING": 0.1, "TOUCH_PART": 0.7, "TOLD_PART": 0.4, "AGAIN": 0.5, "LOOSE": 0.5},
        **{"FEELS": 0.5, "SINK_SPEED": 0.03, "CARRIES": 0.7},
    },
    "grip": {"GRAVITY": 9.81, "LOWEST": 1.0, "LEVER": 0.04, "RATE": 60.0},
    "phases": {"NEAR": 0.10, "STILL": 0.02, "REGRIPS": 0.10},
    "receiving": {
        **{"THERE": 0.010, "LIFT_SPEED": 0.03, "LIFT": 0.03, "MORE_THAN_WEIGHT": 1.2, "OPENED": 0.08},
        **{"OPEN_FOR": 0.2, "GRASPS_WITHIN": 4.0},
    },
    "recorded_motion": {"MOST_SAMPLES": 1_000_000},
    "recorded_person": {
        **{"SLOW": 0.05, "STEP": 0.02, "LEFT": 0.05, "FARTHEST": 0.30, "SHORTEST": 0.10, "LEAVES_CLOSED": 0.05},
    },
    "scene": {"FROM_HAND": 0.04},
    "senses": {"NOISE_TIME": 0.3, "SPEED_TIME": 0.05, "SLOWEST": 0.005, "FINGERTIP_WAY": 0.19, "FINGERS": 4},
    "virtual_human": {
        **{"REPLAN_PERIOD": 0.10, "CORRECTION_TIME": 0.45, "GONE": 0.35, "WITHDRAWALS": 5, "COMES": 0.25},
        **{"LOST": 0.2, "AWAY": 0.35, "LOST_FOR": 0.3},
    },
}


@pytest.mark.parametrize("module", EVERYBODY)
def test_figures_that_are_the_same_for_everybody(module):
    loaded = importlib.import_module(f"coglab_sim.person.{module}")
    assert {name: getattr(loaded, name) for name in EVERYBODY[module]} == EVERYBODY[module]


NOBODY_DRAWN = {
    "seed": 0,
    "behaviour": "normal",
    "left_handed": False,
    "reaction_median": 0.35,
    "reaction_sigma": 0.30,
    "learning": 0.08,
    "reach_time": 1.1,
    "reach_sigma": 0.12,
    "bow": 0.0,
    "point_offset": (0.0, 0.0, 0.0),
    "point_sigma": (0.02, 0.04, 0.03),
    "inside_box": False,
    "tilt": 12.0,
    "seeing_delay": 0.20,
    "seen_noise": 0.003,
    "seen_turn": 2.0,
    "seen_speed": 0.10,
    "feeling_delay": 0.125,
    "felt_threshold": 0.4,
    "felt_share": 0.08,
    "hearing_delay": 0.5,
    "trust": 0.5,
    "places_while_moving": False,
    "place_speed": 0.10,
    "press": 1.5,
    "release_share": 0.3,
    "assurance": 0.2,
    "release_time": 0.35,
    "grip_safety": 2.0,
    "grip_limit": 40.0,
    "weight_error": 0.0,
    "grip_time": 0.25,
    "patience": 12.0,
    "presses_again": 0,
    "used_to_touch": False,
    "believes_closed": math.inf,
    "aligns_within": math.inf,
    "relaxes": False,
    "sway": 0.002,
    "tremor": 0.0003,
}


def test_a_person_whom_nobody_drew():
    assert {field.name: getattr(Participant(), field.name) for field in fields(Participant)} == NOBODY_DRAWN
    assert PROFILES == ("drawn", "patient", "accustomed") and BEHAVIOURS[0] == "normal" and len(BEHAVIOURS) == 11
    assert HABITS == {
        **{"presses_again": 4, "used_to_touch": True, "believes_closed": 3.0, "aligns_within": 0.010, "relaxes": True}
    }


PEOPLE = [Participant.draw(seed) for seed in range(3000)]
UNIFORM = {
    "seeing_delay": (0.15, 0.25),
    "seen_noise": (0.002, 0.005),
    "feeling_delay": (0.10, 0.15),
    "felt_threshold": (0.2, 0.6),
    "felt_share": (0.05, 0.10),
    "hearing_delay": (0.4, 0.8),
    "place_speed": (0.06, 0.18),
    "press": (1.0, 3.0),
    "assurance": (0.1, 0.4),
    "release_time": (0.25, 0.5),
    "grip_time": (0.2, 0.35),
    "patience": (8.0, 16.0),
}
LOGNORMAL = {
    "reaction_median": (0.35, 0.15, 0.2, 0.7),
    "reach_time": (1.1, 0.10, 0.8, 1.5),
    "grip_safety": (2.0, 0.15, 1.6, 3.0),
}
"""median, sigma of the logarithm, range"""


def drawn(name):
    return np.array([getattr(person, name) for person in PEOPLE])


@pytest.mark.parametrize("name", UNIFORM)
def test_drawn_evenly(name):
    low, high = UNIFORM[name]
    values = (drawn(name) - low) / (high - low)
    assert 0.0 <= values.min() < 0.01 and 0.99 < values.max() <= 1.0
    assert values.mean() == pytest.approx(0.5, abs=0.03) and values.std() == pytest.approx(12**-0.5, rel=0.05)


@pytest.mark.parametrize("name", LOGNORMAL)
def test_drawn_about_a_median(name):
    median, sigma, low, high = LOGNORMAL[name]
    values = drawn(name)
    assert np.median(values) == pytest.approx(median, rel=0.035 if name == "grip_safety" else 0.012)
    assert low <= values.min() and values.max() <= high
    # One side of the grip's margin is cut off, so that what is left spreads less.
    assert np.log(values).std() == pytest.approx(0.84 * sigma if name == "grip_safety" else sigma, rel=0.06)


def test_trust_spreads_widely_between_its_ends():
    trust = drawn("trust")
    assert 0.1 <= trust.min() < 0.12 and 1.4 < trust.max() <= 1.5
    assert np.median(trust) == pytest.approx(0.43, rel=0.06)
    assert np.log(trust).std() == pytest.approx(0.58, rel=0.05)


def test_the_others_are_drawn_as_they_are_documented():
    share = drawn("release_share")
    assert 0.1 <= share.min() < 0.12 and 0.56 < share.max() <= 0.6
    # A normal distribution of 0.1, cut off at its ends.
    assert share.mean() == pytest.approx(0.304, abs=0.006) and share.std() == pytest.approx(0.093, rel=0.05)
    offset = drawn("point_offset")
    assert offset.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.004)
    assert offset.std(axis=0) == pytest.approx([0.02, 0.04, 0.045], rel=0.06)
    weight = drawn("weight_error")
    assert weight.mean() == pytest.approx(0.0, abs=0.01) and weight.std() == pytest.approx(0.15, rel=0.06)
    bow = drawn("bow")
    assert np.mean(bow == 0.0) == pytest.approx(0.5, abs=0.03) and bow.min() == 0.0
    assert np.sqrt(np.mean(bow[bow > 0.0] ** 2)) == pytest.approx(0.02, rel=0.06)
    assert np.mean(drawn("left_handed")) == pytest.approx(0.1, abs=0.02)
    assert np.mean(drawn("places_while_moving")) == pytest.approx(0.2, abs=0.03)


def test_what_is_not_drawn_is_the_same_for_everybody():
    varies = {*UNIFORM, *LOGNORMAL, "seed", "trust", "release_share", "point_offset", "weight_error", "bow"}
    varies |= {"left_handed", "places_while_moving"}
    for name in NOBODY_DRAWN.keys() - varies:
        assert {getattr(person, name) for person in PEOPLE[:50]} == {NOBODY_DRAWN[name]}, name
    assert [person.seed for person in PEOPLE[:3]] == [0, 1, 2]


def test_an_accustomed_person_is_always_nearly_in_the_same_place():
    for seed in range(40):
        person, as_drawn = Participant.draw(seed, profile="accustomed"), Participant.draw(seed)
        x, y, z = as_drawn.point_offset
        words = {"left_handed": False, "point_offset": (0.4 * x, 0.5 * y, 0.45 * z), "patience": 12.0, **HABITS}
        words |= {"trust": 1.0, "places_while_moving": False, "tilt": 0.0, "inside_box": True}
        assert person == replace(as_drawn, **words)


def test_a_draw_outside_its_range_is_drawn_again_a_hundred_times():
    draws = iter([3.0, -0.1, 1.0, 0.5])
    assert within(0.0, 1.0, lambda: next(draws)) == 1.0, "the ends belong to the range"
    assert within(0.0, 1.0, lambda: 0.0) == 0.0
    asked = []
    assert within(1.0, 4.0, lambda: asked.append(1) or 9.0) == 2.5 and len(asked) == 100


def test_a_file_sets_fields_whoever_was_drawn():
    person = Participant.from_mapping({"seed": 5, "behaviour": "tug", "point_offset": [0.1, 0.2, 0.3], "bow": 0.0})
    assert person == replace(Participant.draw(5, "tug"), point_offset=(0.1, 0.2, 0.3), bow=0.0)
    assert Participant.from_mapping({}) == Participant.draw(0, "normal", "drawn")
    assert Participant.from_mapping({"profile": "patient", "seed": 3}) == Participant.draw(3, profile="patient")


def test_sway_and_tremor_are_as_large_and_as_fast_as_documented():
    """Their largest values are the figures: 2 mm at 0.35 and 0.8 Hz, 0.3 mm at 9.1 and 11.3 Hz."""
    times, phases = np.arange(0.0, 400.0, 0.005), np.zeros((3, 4))
    for field, size, lines in (("sway", 0.002, (0.35, 0.8)), ("tremor", 0.0003, (9.1, 11.3))):
        person = replace(Participant(), **({"sway": 0.0, "tremor": 0.0} | {field: size}))
        path = np.array([involuntary(person, phases, t)[1] for t in times[:20000]])
        assert np.abs(path).max() == pytest.approx(size, rel=0.03)
        spectrum = np.abs(np.fft.rfft(path)) / len(path) * 2
        found = np.sort(np.fft.rfftfreq(len(path), 0.005)[np.argsort(spectrum)[-2:]])
        assert found == pytest.approx(lines, abs=0.011)
    both = replace(Participant(), sway=0.002, tremor=0.0003)
    assert involuntary(both, np.array([[0.3, 0.1, 0.2, 0.4]] * 3), 0.0) == pytest.approx(
        [0.002 / 1.5 * (np.sin(0.3) + 0.5 * np.sin(0.1)) + 0.0003 / 1.6 * (np.sin(0.2) + 0.6 * np.sin(0.4))] * 3
    )


def test_the_scene_without_an_object_of_the_database():
    scene = Scene()
    for name, value in (
        ("rest", [1.30, 0.20, 0.15]),
        ("handover_object", [0.78, 0.03, 0.39]),
        ("region_low", [0.72, -0.12, 0.29]),
        ("region_high", [0.81, 0.16, 0.46]),
        ("object_in_hand", [-0.08, 0.0, -0.05]),
        ("object_turn", [0.0, 0.0, 0.0, 1.0]),
        ("taken_in_hand", [-0.08, 0.0, -0.05]),
        ("object_size", [0.08, 0.08, 0.10]),
        ("object_middle", [0.0, 0.0, 0.05]),
    ):
        assert getattr(scene, name) == pytest.approx(value), name
    assert (scene.object_mass, scene.object_friction, scene.other_side) == (0.31, 0.6, -0.16)


def test_the_scene_of_an_object_follows_its_size_and_its_delivery():
    entry = shipped("tea_box") | {"size": [0.07, 0.11, 0.16]}
    scene = Scene.of(entry, mass=2.0, friction=0.5)
    x, _, height = entry["size"]
    free = entry["deliveries"][entry["default_delivery"]]["pose"]["xyz"][2]
    assert scene.handover_object == pytest.approx([0.78, 0.03, 0.44 - height / 2])
    assert scene.region_low == pytest.approx([0.72, -0.12, 0.34 - height / 2])
    assert scene.region_high == pytest.approx([0.81, 0.16, 0.51 - height / 2])
    assert scene.object_in_hand == pytest.approx([-x / 2 - 0.04, 0.0, -height / 2])
    assert scene.taken_in_hand == pytest.approx([-x / 2 - 0.04, 0.0, free])
    assert scene.object_mass == 2.0 * entry["mass"] and scene.object_friction == 0.5 * entry["friction"]
    assert scene.object_size == pytest.approx(entry["size"])


def test_what_nobody_has_seen_yet_is_nothing():
    view = WorldView()
    assert view.hand_closure == 0.0 and not view.load.any() and view.load.shape == (3,)
    sample = HandSample(view.object, np.ones(3), 1.0, 20.0, "idle")
    assert not sample.spin.any() and sample.spin.shape == (3,)


# -- grip ---------------------------------------------------------------------------------------------------------


def grip_of(knows_weight=True, **changes):
    """Of a person with a margin of 2 on a mug of 0.31 kg with friction 0.6, held 80 mm before the hand."""
    return GripForce(replace(Participant(weight_error=0.2), **changes), Scene(), knows_weight)


def test_a_grip_carries_load_and_its_turning_with_a_margin():
    weight = 0.31 * 9.81
    turning = 1.0 + 0.08 / 0.04
    grip = grip_of()
    assert grip.expected == pytest.approx(weight)
    assert grip.force == pytest.approx(2.0 * turning * weight / (2 * 0.6))
    assert grip_of(knows_weight=False).expected == pytest.approx(weight * np.exp(0.2))
    assert grip_of(grip_limit=12.0).force == 12.0
    light = GripForce(Participant(), replace(Scene(), object_mass=0.01), True)
    assert light.force == 1.0, "N, of a hand that holds anything at all"


def test_a_grip_follows_what_is_felt_or_expected_at_60_newtons_per_second():
    grip = grip_of()
    start, per_newton = grip.force, 2.0 * 3.0 / (2 * 0.6)
    assert grip.step(0.01, 0.0) == start, "what is expected counts where less is felt"
    assert grip.step(0.01, 9.0) == pytest.approx(start + 0.6)
    for _ in range(100):
        force = grip.step(0.01, 4.0, 1.0)
    assert force == pytest.approx(5.0 * per_newton)
    assert grip.step(0.01, 0.0) == pytest.approx(force - 0.6), "and back as fast"
    grip.has_felt(1.0)
    for _ in range(100):
        grip.step(0.01, 0.0)
    assert grip.force == pytest.approx(per_newton) and grip.expected == 1.0


# -- conditions ---------------------------------------------------------------------------------------------------


def test_the_conditions_by_name():
    assert Conditions() == THE_WORLD_AS_IT_IS
    plain = (THE_WORLD_AS_IT_IS.behaviour, THE_WORLD_AS_IT_IS.profile, THE_WORLD_AS_IT_IS.object_id)
    assert plain == ("normal", "drawn", "mug") and not THE_WORLD_AS_IT_IS.person
    assert (THE_WORLD_AS_IT_IS.mass, THE_WORLD_AS_IT_IS.friction) == (1.0, 1.0)
    assert not THE_WORLD_AS_IT_IS.perception.perfect and not CAREFUL.perception.perfect
    assert PATIENT.perception.perfect and CONSIDERATE.perception.perfect
    assert (PATIENT.profile, CONSIDERATE.profile, CAREFUL.profile) == ("patient", "accustomed", "drawn")
    assert CAREFUL.person == HABITS


def test_each_hardship_makes_the_world_harder_in_one_way():
    base = replace(THE_WORLD_AS_IT_IS, person={"press": 2.0}, mass=1.1, friction=0.9)
    assert hardship("", 1, base) is base and hardship("", 1) is THE_WORLD_AS_IT_IS
    harder = {name: hardship(name, 1, base) for name in HARDSHIPS}
    perception = base.perception
    assert harder == {
        "trust 0.1 s": replace(base, person={"press": 2.0, "trust": 0.1}),
        "tilt 20 deg": replace(base, person={"press": 2.0, "tilt": 20.0}),
        "bias 10 mm": replace(base, perception=replace(perception, calibration_offset=0.010)),
        "mass +-30 %": replace(base, mass=1.1 * 1.3),
        "friction -30 %": replace(base, friction=0.7 * 0.9),
        "latency +100 ms": replace(base, perception=replace(perception, latency=perception.latency + 0.1)),
    }
    assert hardship("mass +-30 %", 2, base).mass == 1.1 * 0.7, "the seed decides"
    with pytest.raises(ValueError, match="hardship 'rain' is none of trust 0.1 s, tilt 20 deg"):
        hardship("rain", 1)
    assert conditions.CAREFUL.participant(4) == replace(Participant.draw(4), **HABITS)
