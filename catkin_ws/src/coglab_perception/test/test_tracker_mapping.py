"""The mapping file of the perception bridge."""

import math

import numpy as np
import pytest
from coglab_perception.frames import FrameNames
from coglab_perception.tracker_mapping import TrackerMapping, usable
from coglab_py.packages import package_path
from coglab_py.pose import Pose
from coglab_py.yaml_file import YamlError

NAMES = FrameNames("world", "human_hand", "board", "object_{id}")


def load(tmp_path, text):
    file = tmp_path / "tracker.yaml"
    file.write_text(text)
    return TrackerMapping.load(str(file), NAMES)


def test_the_shipped_example_loads_and_means_what_it_says():
    mapping = TrackerMapping.load(str(package_path("coglab_perception", "config", "perception_bridge.yaml")), NAMES)
    hand, mug, bottle, board = mapping.sources
    assert (hand.tf, mug.topic, bottle.marker, board.frame) == ("tracker_hand", "/tracker/mug", ("", 7), "board")
    assert hand.offset.position.tolist() == [0.0, 0.0, -0.04]
    assert board.largest_age > 60.0 and hand.largest_age == 0.2


def test_an_offset_turns_in_degrees(tmp_path):
    mapping = load(tmp_path, "frames: {object_mug: {tf: m, offset: {position: [1, 0, 0], rpy_deg: [0, 0, 90]}}}")
    seen = Pose(np.array([0.0, 0.0, 1.0])) * mapping.sources[0].offset
    assert np.allclose(seen.apply([1.0, 0.0, 0.0]), [1.0, 1.0, 1.0])


def test_a_tracker_with_the_names_of_the_contract_is_served_as_it_is(tmp_path):
    ours, other = load(tmp_path, "frames: {human_hand: {tf: human_hand}, board: {tf: b}}").sources
    assert (ours.is_there, other.is_there) == (True, False)


def test_stamps_of_another_clock_are_replaced_by_the_arrival(tmp_path):
    mapping = load(tmp_path, "stamp: arrival\nlatency: 0.03\nframes: {human_hand: {tf: h}}")
    assert mapping.captured(1e9, 10.0) == pytest.approx(9.97)


@pytest.mark.parametrize(
    ("source", "named"),
    [
        ("hand: {tf: h}", "human_hand, board, object_<id>"),
        ("human_hand: {}", "one source"),
        ("human_hand: {tf: h, topic: /t, type: PoseStamped}", "one source"),
        ("human_hand: {topic: /t}", "type is missing"),
        ("human_hand: {topic: /t, type: Pose}", "'Pose'"),
        ("human_hand: {topic: /t, type: MarkerArray}", "needs the id"),
        ("human_hand: {topic: /t, type: PoseStamped, id: 3}", "needs the id"),
        ("human_hand: {tf: h, id: 3}", "no type, namespace or id"),
        ("human_hand: {tf: h, offset: {position: [1, 2]}}", "too short"),
        ("human_hand: {tf: h, offset: {position: [1, 2, .nan]}}", "number"),
        ("human_hand: {tf: h, largest_age: 0}", "largest_age"),
        ("human_hand: {tf: h, colour: red}", "colour"),
        ("human_hand: {tf: human_hand, offset: {position: [0, 0, 1]}}", "this bridge broadcasts"),
        ("human_hand: {tf: object_mug}", "this bridge broadcasts"),
        ("board: {tf: board}\nstamp: arrival", "this bridge broadcasts"),
    ],
)
def test_a_wrong_source_is_refused_with_file_line_and_field(tmp_path, source, named):
    with pytest.raises(YamlError) as refusal:
        load(tmp_path, f"largest_age: 0.2\nframes:\n  {source}\n")
    assert named in str(refusal.value) and "tracker.yaml:3" in str(refusal.value)


@pytest.mark.parametrize(
    ("pose", "fine"),
    [
        (Pose(np.array([1.0, 2.0, 3.0])), True),
        (Pose(np.array([math.nan, 0.0, 0.0])), False),
        (Pose(np.zeros(3), np.zeros(4)), False),
        (Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, math.inf])), False),
    ],
)
def test_invalid_poses_are_detected(pose, fine):
    assert usable(pose) is fine
