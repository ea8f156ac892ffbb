"""What the plant refuses, with words: objects, poses, robot descriptions, tables of the hand, calls."""

import re

import numpy as np
import pytest
from coglab_sim import _plant
from grasp_trial import BOARD_TOP, BOX, HOME, SOURCES, URDF


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"shape": ""}, "object 'box': has no shape, expected box, cylinder or sphere"),
        ({"shape": "cone"}, "object 'box': unknown shape 'cone', expected box, cylinder or sphere"),
        ({"mass": 0.0}, "object 'box': mass is 0 kg, expected 0.01 .. 10"),
        ({"mass": 5000.0}, "object 'box': mass is 5000 kg, expected 0.01 .. 10"),
        ({"mass": float("nan")}, "object 'box': mass is nan kg, expected 0.01 .. 10"),
        ({"size": [0.1, 0.0, 0.1]}, r"object 'box': size\[1\] is 0 m, expected 0.001 .. 2"),
        ({"friction": -1.0}, "object 'box': friction is -1, expected 0 .. 2"),
    ],
)
def test_bad_objects_are_refused_with_words(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        _plant.Plant(URDF, HOME, {**BOX, **change})
    plant = _plant.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match=sentence):
        plant.set_object({**BOX, **change})
    assert plant.hold(HOME) is None  # the old one is still there


def test_an_object_inside_something_is_refused():
    plant = _plant.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match=r"object 'box' would stand \d+(\.\d+)? mm inside board there"):
        plant.place("world", BOARD_TOP - [0.0, 0.0, 0.015])
    with pytest.raises(ValueError, match="inside ih2_base_link there"):
        plant.place("robot_hand", [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"object 'box' would stand \d+(\.\d+)? mm inside the person's hand in that"):
        plant.place("human_hand", [0.15, 0.0, -0.02])
    plant.place("world", BOARD_TOP)
    before = plant.bytes()
    with pytest.raises(ValueError, match="inside board there"):
        plant.place("world", BOARD_TOP - [0.0, 0.0, 0.015])
    assert plant.bytes() == before, "the object stays where it was"


def test_an_object_inside_the_arm_is_refused_wherever_it_is():
    """The arm straight up, and a small box moved up its axis: where its middle is that of a link, too."""
    plant = _plant.Plant(URDF, np.zeros(7), {**BOX, "size": [0.04, 0.04, 0.04]}, board=False)
    top, accepted = plant.state()["palm"][0][2], []
    for z in np.arange(0.02, top - 0.02, 0.01):
        try:
            plant.place("world", [0.0, 0.0, z - 0.02])
            accepted.append(round(float(z), 3))
        except ValueError as error:
            assert re.search(r"object 'box' would stand \d+(\.\d+)? mm inside (lwr|ih2)_\w+ there", str(error))
    assert accepted == []


def test_a_person_who_would_stand_in_the_arm_is_not_there():
    plant = _plant.Plant(URDF, HOME, BOX)
    before, palm = plant.bytes(), plant.state()["palm"][0]
    with pytest.raises(
        ValueError, match=r"the person's hand would stand \d+(\.\d+)? mm inside \w+ where it comes from"
    ):
        plant.set_person(palm - [0.15, 0.0, 0.0])
    assert plant.bytes() == before
    plant.set_person([1.0, 0.2, 0.4])


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lambda text: "", "cannot be read as a URDF"),
        (
            lambda text: text.replace(
                '<cylinder radius="0.09" length="0.11"/></geometry></collision>',
                '<mesh filename="a.stl"/></geometry></collision>',
            ),
            r":\d+: mesh is no shape for contacts; expected box, cylinder or sphere",
        ),
        (lambda text: text.replace('<mass value="2.35"/>', '<mass value="-2.35"/>', 1), "MuJoCo refuses the robot"),
        (
            lambda text: text.replace('<parent link="lwr_link_3"/>', '<parent link="nowhere"/>'),
            "names the link 'nowhere'",
        ),
        (lambda text: text.replace('name="lwr_a3" type="revolute"', 'name="lwr_a3" type="fixed"'), "expected 7 joints"),
        (lambda text: text.replace("ih2_base_link", "other_hand"), "has no link 'ih2_base_link'"),
    ],
)
def test_bad_robot_descriptions_are_refused_with_words(tmp_path, change, sentence):
    path = tmp_path / "robot.urdf"
    path.write_text(change(open(URDF).read()))
    with pytest.raises(RuntimeError, match=sentence) as error:
        _plant.Plant(str(path), HOME, BOX)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("motor: 2, pivot", "motor: 9, pivot", r"/fingers/index\[0\]/motor: expected a number in 0..4, got 9"),
        ("range: [0.0, 1.658]", "range: [1.0, 0.0]", "range: expected low before high"),
        ("mass: 0.018", "mass: heavy", r"/fingers/thumb\[0\]/mass: expected a number in 0.0001..1, got no number"),
        ("mass: 0.018", "mass: 0.9", "more than the whole hand"),
        ("tendon_stiffness: 50000.0", "", "/tendon_stiffness: expected a value, got nothing"),
        ("palm: ih2_base_link", "palm: [", "cannot be read"),
    ],
)
def test_bad_tables_of_the_hand_are_refused_with_words(tmp_path, old, new, sentence):
    text = (SOURCES / "coglab_sim" / "config" / "hand_model.yaml").read_text()
    assert old in text
    path = tmp_path / "hand.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=re.sub(r"^/", ".*/", sentence)):
        _plant.Plant(URDF, HOME, BOX, hand=str(path))


def test_bad_calls_are_refused_with_words():
    plant = _plant.Plant(URDF, HOME, BOX)
    with pytest.raises(ValueError, match="at most 0.001 s"):
        plant.step(np.zeros(7), 0.01)
    with pytest.raises(ValueError, match="not a finite number"):
        plant.step(np.full(7, np.nan))
    with pytest.raises(ValueError, match="unknown placement"):
        plant.place("moon", [0, 0, 0])
    with pytest.raises(ValueError, match="motor is 7, expected 0 .. 4"):
        plant.command_motor(7, 1.0)
