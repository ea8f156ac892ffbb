"""The edges of perception's answers, on two clocks that the test sets: how old is too old, how near is in a hand, how
clear a choice has to be, and what each refusal says."""

import math

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_perception.frames import FrameNames
from coglab_py.pose import Pose
from coglab_sim.tracker import vision as module
from coglab_sim.tracker.tracker import Board, PerceptionSettings
from coglab_sim.tracker.vision import NotSeen, PartnerChoice, Vision

NAMES = FrameNames("world", "human_hand", "board", "object_{id}")
BOARD = Pose(np.array([0.45, -0.55, 0.05]))
SLOTS = {"A1": np.zeros(3), "A2": np.array([0.0, 0.15, 0.0])}
HAND = Pose(np.array([0.9, 0.1, 0.4]))
ROBOT = Pose(np.array([0.5, 0.0, 0.4]))


class Seen:
    """A perfect tracker whose clock the test sets."""

    def __init__(self, margin=0.0):
        self.now = 10.0
        board = Board(BOARD, SLOTS)
        settings = PerceptionSettings(perfect=True)
        self.vision = Vision(NAMES, settings, board, 3, lambda: self.now, margin)

    def see(self, hands=None, objects=None, robot=ROBOT):
        self.now += 0.1
        return self.vision.see({"one": HAND} if hands is None else hands, objects or {}, robot)


def refused(call, *arguments):
    with pytest.raises(NotSeen) as refusal:
        call(*arguments)
    return str(refusal.value), refusal.value.code


def test_figures_and_what_a_vision_begins_with():
    assert (module.OLDEST, module.LONGEST_WAIT, module.IN_HAND) == (0.5, 60.0, 0.20)
    vision = Seen().vision
    assert (vision.people, vision.seed, vision.choice.margin) == (0, 3, 0.0)
    plain = Vision(NAMES, PerceptionSettings(perfect=True), Board(BOARD, SLOTS), 1, lambda: 0.0)
    assert plain.choice.margin == 0.0 and PartnerChoice().margin == 0.0


@pytest.mark.parametrize(
    "asked, limit", [(-1.0, 0.0), (0.0, 0.0), (3.0, 3.0), (60.0, 60.0), (61.0, 60.0), (math.inf, 60.0)]
)
def test_time_limits_are_cut_to_what_can_be_kept(asked, limit):
    assert module._limit(asked) == limit
    assert module._limit(math.nan) == 0.0


@pytest.mark.parametrize("age, fresh", [(0.49, True), (0.51, False)])
def test_a_sight_is_fresh_for_half_a_second(age, fresh):
    seen = Seen()
    seen.see(objects={"object_mug": HAND})
    seen.now += age
    if fresh:
        name, _, told = seen.vision.locate("mug", 0.0)
        assert name == "object_mug" and told == pytest.approx(age)
    else:
        text, code = refused(seen.vision.locate, "mug", 0.0)
        assert code == ReasonCode.OBJECT_NOT_SEEN
        assert text == ("'object_mug' was not seen within 0.0 s; in view: nothing; bring it into view of the tracker")


@pytest.mark.parametrize("age, visible", [(0.49, True), (0.51, False)])
def test_the_world_is_visible_for_half_a_second(age, visible):
    seen = Seen()
    refusals = {
        "init_vision": "the cell was not visible within 0.0 s; is the simulated cell, or the recording, running?",
        "free_places": "the board was not visible within 0.0 s; is the simulated cell, or the recording, running?",
    }
    for name, arguments in (("init_vision", (0.0,)), ("free_places", ("mug", 0.0))):
        assert refused(getattr(seen.vision, name), *arguments) == (refusals[name], ReasonCode.NOT_PERCEIVED)
    seen.see()
    seen.now += age
    if visible:
        assert seen.vision.init_vision(0.0) == "tracker stand-in sees the cell"
        assert [name for name, _ in seen.vision.free_places("mug", 0.0)] == ["A1", "A2"]
    else:
        assert refused(seen.vision.init_vision, 0.0)[1] == ReasonCode.NOT_PERCEIVED


def test_a_stamp_ahead_of_the_clock_is_no_negative_age():
    seen = Seen()
    seen.see(objects={"object_mug": HAND})
    seen.now -= 0.3
    assert seen.vision.locate("mug", 0.0)[2] == 0.0


def test_the_board_is_known_at_once_and_places_come_with_where_they_are():
    seen = Seen()
    name, sight, age = seen.vision.locate("board", 0.0)
    assert (name, sight.name, sight.captured, age) == ("board", "board", 10.0, 0.0)
    seen.see(objects={"object_mug": Pose(BOARD.apply(SLOTS["A1"]))})
    (left,) = seen.vision.free_places("ball", 0.0)
    assert left[0] == "A2" and left[1] == pytest.approx(SLOTS["A2"])
    assert len(seen.vision.free_places("mug", 0.0)) == 2, "the object that is to be put occupies nothing"
    seen.see({"one": Pose(BOARD.apply(SLOTS["A2"]))})
    assert len(seen.vision.free_places("mug", 0.0)) == 2, "nor does a hand"


def test_a_full_board_is_said_with_what_lies_where():
    seen = Seen()
    seen.see(objects={"object_b": Pose(BOARD.apply(SLOTS["A1"])), "object_a": Pose(BOARD.apply(SLOTS["A2"]))})
    assert refused(seen.vision.free_places, "mug", 0.0) == (
        "no place on the board is free: object_a, object_b lie near A1, A2; clear one",
        ReasonCode.NO_FREE_PLACE,
    )


@pytest.mark.parametrize("away, doubt", [(0.199, True), (0.201, False)])
def test_of_two_people_nobody_is_the_partner_and_what_they_hold_is_nobodys(away, doubt):
    seen = Seen()
    held = Pose(HAND.position + [0.0, 0.0, away])
    sights = seen.see({"one": HAND, "two": Pose(np.array([2.0, 0.0, 0.4]))}, {"object_mug": held})
    assert [sight.name for sight in sights] == ["object_mug"] and seen.vision.people == 2
    sentence = "2 people are in view; one partner is expected: ask the others to step back"
    assert refused(seen.vision.locate, "human_hand", 0.0) == (sentence, ReasonCode.NOT_PERCEIVED)
    if doubt:
        assert refused(seen.vision.locate, "mug", 0.0) == (sentence, ReasonCode.NOT_PERCEIVED)
    else:
        assert seen.vision.locate("mug", 0.0)[0] == "object_mug"
    assert refused(seen.vision.locate, "ball", 0.0)[1] == ReasonCode.OBJECT_NOT_SEEN
    seen.now += 0.6
    assert refused(seen.vision.locate, "human_hand", 0.0)[1] == ReasonCode.OBJECT_NOT_SEEN, "long ago"


def test_what_is_in_view_is_told_in_order():
    seen = Seen()
    seen.see(objects={"object_mug": HAND, "object_ball": HAND})
    text, _ = refused(seen.vision.locate, "tea", 0.04)
    assert text.startswith("'object_tea' was not seen within 0.0 s; in view: human_hand, object_ball, object_mug;")
    assert seen.see({}) == [] and seen.vision.people == 0


def test_a_swap_shows_another_thing_of_the_same_world():
    """Each tracker is given what the others see."""
    seen = Seen()
    settings = dict.fromkeys(("latency", "latency_sigma", "orientation_noise", "dropout_start"), 0.0)
    settings |= {"occlusion_distance": 0.0, "calibration_offset": 0.0, "calibration_turn_deg": 0.0}
    vision = Vision(
        NAMES,
        PerceptionSettings(swap_probability=1.0, position_noise=(0.0, 0.0, 0.0), **settings),
        Board(BOARD, SLOTS),
        1,
        lambda: seen.now,
    )
    mug = Pose(HAND.position + [0.1, 0.0, 0.0])
    places = {sight.name: sight.frame.position for sight in vision.see({"one": HAND}, {"object_mug": mug})}
    assert places["human_hand"] == pytest.approx(mug.position) and places["object_mug"] == pytest.approx(HAND.position)


def hands(**distances):
    """Hands so far from the robot."""
    return {name: Pose(ROBOT.position + [away, 0.0, 0.0]) for name, away in distances.items()}


def test_a_choice_needs_the_margin_and_is_kept_within_it():
    assert PartnerChoice(0.3).choose(hands(a=0.5, b=0.799), ROBOT) == ""
    choice = PartnerChoice(0.3)
    assert choice.choose(hands(a=0.5, b=0.801), ROBOT) == "a"
    assert choice.choose(hands(a=0.5, b=0.3), ROBOT) == "a", "nearer by less than the margin"
    assert choice.choose(hands(a=0.7, b=0.41), ROBOT) == "a"
    assert choice.choose(hands(a=0.71, b=0.4), ROBOT) == "b"
    assert choice.choose(hands(a=0.71, b=0.4, c=0.5), ROBOT) == "b"
    assert choice.choose(hands(a=0.4, c=0.5), ROBOT) == "", "b has left, and neither is clear"
    assert choice.choose(hands(a=0.4, c=0.9, d=0.5), ROBOT) == ""
    assert PartnerChoice(0.25).choose(hands(a=0.25, b=0.5), ROBOT) == "a", "the margin itself is enough"


def test_who_was_chosen_is_forgotten_when_nobody_can_be_told():
    choice = PartnerChoice(0.3)
    assert choice.choose(hands(a=0.9), ROBOT) == "a"
    assert choice.choose(hands(a=0.9, b=0.8), None) == "", "no robot to be near to"
    assert choice.choose(hands(a=0.9, b=0.8), ROBOT) == ""
    assert choice.choose(hands(a=0.9), None) == "a" and choice.choose({}, ROBOT) == ""
    assert choice.choose(hands(a=0.9, b=0.8), ROBOT) == ""
    for wrong in (-0.01, math.inf, math.nan):
        with pytest.raises(ValueError, match="partner_margin must be 0 or more metres"):
            PartnerChoice(wrong)
