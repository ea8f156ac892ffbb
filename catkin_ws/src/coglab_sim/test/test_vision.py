"""Answers of perception: fresh, within the time limit, with a message; and the choice of the partner's hand."""

from __future__ import annotations

import math
import threading
import time

import numpy as np
import pytest
from coglab_msgs.msg import ReasonCode
from coglab_perception.frames import FrameNames
from coglab_perception.sights import Board, NotSeen
from coglab_py.pose import Pose
from coglab_sim.tracker.tracker import PerceptionSettings
from coglab_sim.tracker.vision import PartnerChoice, Vision

NAMES = FrameNames("world", "human_hand", "board", "object_{id}")
BOARD = Pose(np.array([0.45, -0.55, 0.05]))
SLOTS = {"A1": np.zeros(3), "A2": np.array([0.0, 0.15, 0.0])}
ROBOT = Pose(np.array([0.5, 0.0, 0.4]))
NEAR, BESIDE, FAR = (Pose(np.array(place)) for place in ([0.9, 0.1, 0.4], [0.9, -0.15, 0.4], [1.6, 0.5, 0.4]))


class Scene:
    """A perfect tracker whose clock the test sets."""

    def __init__(self, margin=0.0, **settings):
        self.now = 10.0
        self.vision = Vision(
            NAMES,
            PerceptionSettings(**({"perfect": True} | settings)),
            Board(BOARD, SLOTS),
            1,
            lambda: self.now,
            margin,
        )

    def see(self, hands=None, objects=None, robot=ROBOT):
        self.now += 0.1
        return self.vision.see({"one": NEAR} if hands is None else hands, objects or {}, robot)


def test_locate_gives_frame_sight_and_age():
    scene = Scene()
    scene.see(objects={"object_mug": BESIDE})
    scene.now += 0.1
    name, sight, age = scene.vision.locate("mug", 0.1)
    assert name == "object_mug" and sight.frame.position == pytest.approx(BESIDE.position)
    assert age == pytest.approx(0.1)
    assert scene.vision.locate("human_hand", 0.1)[1].frame.position == pytest.approx(NEAR.position)
    assert scene.vision.locate("board", 0.0)[1].frame.position == pytest.approx([0.45, -0.55, 0.05])


def test_the_calibration_shifts_the_board_like_everything_else():
    """The whole tracker has one error: board and objects on it are seen with the same 5 mm and 1 deg."""
    quiet = {"position_noise": (0, 0, 0), "orientation_noise": 0.0, "latency": 0.0, "latency_sigma": 0.0}
    scene = Scene(perfect=False, **quiet, dropout_start=0.0, swap_probability=0.0, occlusion_distance=0.0)
    error = scene.vision.settings.calibration(1)
    on_board = Pose(BOARD.apply(SLOTS["A2"]))
    scene.see(objects={"object_mug": on_board})
    board = scene.vision.locate("board", 0.0)[1].frame
    mug = scene.vision.locate("mug", 0.0)[1].frame
    assert board.distance(error * BOARD) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert np.degrees(board.distance(BOARD)[1]) == pytest.approx(1.0) and board.distance(BOARD)[0] > 0.001
    seen_there, there = (board.inverse() * mug).distance(Pose(SLOTS["A2"]))
    assert seen_there == pytest.approx(0.0, abs=1e-9) and there == pytest.approx(0.0, abs=1e-6)


def test_locate_waits_for_a_sight_within_its_limit():
    scene = Scene()
    timer = threading.Timer(0.1, lambda: scene.see(objects={"object_mug": BESIDE}))
    timer.start()
    assert scene.vision.locate("mug", 10.0)[0] == "object_mug"
    timer.join()


@pytest.mark.parametrize("limit", [0.05, 0.0, -1.0, float("nan")])
def test_unseen_object_is_reported_within_the_limit(limit):
    scene = Scene()
    scene.see()
    began = time.monotonic()
    with pytest.raises(NotSeen, match="'object_mug'.* human_hand") as refusal:
        scene.vision.locate("mug", limit)
    assert refusal.value.code == ReasonCode.OBJECT_NOT_SEEN
    assert time.monotonic() - began < 60.0


def test_init_vision():
    scene = Scene()
    with pytest.raises(NotSeen, match=r"0\.1 s"):
        scene.vision.init_vision(0.05)
    scene.see()
    assert "sees" in scene.vision.init_vision(0.05)


def test_free_places():
    scene = Scene()
    with pytest.raises(NotSeen, match="board") as refusal:
        scene.vision.free_places("mug", 0.02)
    assert refusal.value.code == ReasonCode.NOT_PERCEIVED
    scene.see()
    assert [name for name, _ in scene.vision.free_places("mug", 0.1)] == ["A1", "A2"]
    board = scene.vision.board.frame
    on_a1, on_a2 = Pose(board.apply(SLOTS["A1"])), Pose(board.apply(SLOTS["A2"]))
    scene.see(objects={"object_mug": on_a1, "object_ball": on_a2})
    assert [name for name, _ in scene.vision.free_places("mug", 0.1)] == ["A1"]
    with pytest.raises(NotSeen, match="object_ball, object_mug") as refusal:
        scene.vision.free_places("bottle", 0.1)
    assert refusal.value.code == ReasonCode.NO_FREE_PLACE


# -- two people -----------------------------------------------------------------------------------


def test_a_bystander_who_walks_by_never_becomes_the_partner():
    """500 ticks of a second person crossing 0.4 m behind the partner."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        choice = PartnerChoice(0.3)
        assert choice.choose({"partner": NEAR}, ROBOT) == "partner"
        back = rng.uniform(0.3, 0.8)
        for y in np.linspace(-1.0, 1.0, 500):
            crossing = Pose(np.array([0.9 + back, y, 0.4]))
            assert choice.choose({"bystander": crossing, "partner": NEAR}, ROBOT) == "partner"


def refused(call, *arguments):
    with pytest.raises(NotSeen) as refusal:
        call(*arguments)
    return str(refusal.value), refusal.value.code


def test_a_stamp_ahead_of_the_clock_is_no_negative_age():
    seen = Scene()
    seen.see(objects={"object_mug": NEAR})
    seen.now -= 0.3
    assert seen.vision.locate("mug", 0.0)[2] == 0.0


@pytest.mark.parametrize("away, doubt", [(0.199, True), (0.201, False)])
def test_two_people_have_no_partner_and_their_objects_no_owner(away, doubt):
    seen = Scene()
    held = Pose(NEAR.position + [0.0, 0.0, away])
    sights = seen.see({"one": NEAR, "two": Pose(np.array([2.0, 0.0, 0.4]))}, {"object_mug": held})
    assert [sight.name for sight in sights] == ["object_mug"] and seen.vision.people == 2
    why, code = refused(seen.vision.locate, "human_hand", 0.0)
    assert "2 people" in why and code == ReasonCode.NOT_PERCEIVED
    if doubt:
        assert refused(seen.vision.locate, "mug", 0.0) == (why, code)
    else:
        assert seen.vision.locate("mug", 0.0)[0] == "object_mug"
    assert refused(seen.vision.locate, "ball", 0.0)[1] == ReasonCode.OBJECT_NOT_SEEN
    seen.now += 0.6
    assert refused(seen.vision.locate, "human_hand", 0.0)[1] == ReasonCode.OBJECT_NOT_SEEN, "long ago"


def hands(**distances):
    """Hands at given distances from the robot."""
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


def test_chosen_partner_is_reset_when_the_choice_is_unclear():
    choice = PartnerChoice(0.3)
    assert choice.choose(hands(a=0.9), ROBOT) == "a"
    assert choice.choose(hands(a=0.9, b=0.8), None) == "", "no robot to be near to"
    assert choice.choose(hands(a=0.9, b=0.8), ROBOT) == ""
    assert choice.choose(hands(a=0.9), None) == "a" and choice.choose({}, ROBOT) == ""
    assert choice.choose(hands(a=0.9, b=0.8), ROBOT) == ""
    for wrong in (-0.01, math.inf, math.nan):
        with pytest.raises(ValueError, match="partner_margin"):
            PartnerChoice(wrong)
