"""Refusals of the plant, with messages: objects, poses, robot descriptions, tables of the hand, calls."""

import re

import numpy as np
import pytest
from coglab_sim import _cell
from grasp_trial import BOARD_TOP, BOX, HOME, URDF


@pytest.mark.parametrize(
    "change, words",
    [
        ({"shape": "cone"}, "unknown shape 'cone'"),
        ({"mass": 0.0}, r"object/mass = 0 .* 0\.01\.\.10"),
        ({"size": [0.1, 0.0, 0.1]}, r"object/size\[1\] = 0 .* 0\.001\.\.2"),
        ({"center": [0.0, 0.0, 2.01]}, "centre .* 2 m"),
        ({"colour": "red"}, "has no parameter 'object/colour'"),
    ],
)
def test_bad_objects_are_refused_with_words(change, words):
    with pytest.raises(ValueError, match=words):
        _cell.Plant(URDF, HOME, {**BOX, **change})
    plant = _cell.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match=words):
        plant.set_object({**BOX, **change})
    assert plant.hold(HOME) is None  # the old one is still there


def test_an_object_inside_something_is_refused():
    plant = _cell.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match=r"'box'.* \d+(\.\d+)? mm .*board"):
        plant.place("world", BOARD_TOP - [0.0, 0.0, 0.015])
    with pytest.raises(ValueError, match="ih2_base_link"):
        plant.place("robot_hand", [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"'box'.* \d+(\.\d+)? mm .*person"):
        plant.place("human_hand", [0.15, 0.0, -0.02])
    plant.place("world", BOARD_TOP)
    before = plant.bytes()
    with pytest.raises(ValueError, match="board"):
        plant.place("world", BOARD_TOP - [0.0, 0.0, 0.015])
    assert plant.bytes() == before, "the object stays where it was"


def test_an_object_inside_the_arm_is_refused_wherever_it_is():
    """The arm straight up, and a small box moved up its axis: where its middle is that of a link, too."""
    plant = _cell.Plant(URDF, np.zeros(7), {**BOX, "size": [0.04, 0.04, 0.04]}, board=False)
    top, accepted = plant.state()["palm"][0][2], []
    for z in np.arange(0.02, top - 0.02, 0.01):
        try:
            plant.place("world", [0.0, 0.0, z - 0.02])
            accepted.append(round(float(z), 3))
        except ValueError as error:
            assert re.search(r"object 'box' would stand \d+(\.\d+)? mm inside (lwr|ih2)_\w+ there", str(error))
    assert accepted == []
