"""Robot descriptions and tables of the hand, field by field: what is expected of each, said with its file and place."""

import re

import numpy as np
import pytest
from coglab_sim import _cell, _plant
from grasp_trial import BOX, HOME, SOURCES, URDF

DESCRIPTION = open(URDF).read()
HAND = (SOURCES / "coglab_sim" / "config" / "hand_model.yaml").read_text()


def described(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    return str(path)


def replaced(old, new, text=DESCRIPTION):
    assert old in text, old
    return text.replace(old, new, 1)


LINK_1 = '<link name="lwr_link_1">'
CYLINDER = '<cylinder radius="0.09" length="0.11"/></geometry></collision>'
MASS_1 = '<mass value="2.35"/>'
DESCRIPTIONS = [
    (lambda: "<robot", "cannot be read as a URDF: "),
    (lambda: "<other/>", "cannot be read as a URDF: it has no element 'robot'"),
    (lambda: replaced(LINK_1, "<link>"), r":\d+: link has no attribute 'name'"),
    (lambda: replaced('<joint name="lwr_a1" type="revolute">', '<joint name="lwr_a1">'), "no attribute 'type'"),
    (
        lambda: replaced('name="lwr_a1" type="revolute"', 'name="lwr_a1" type="ball"'),
        r":26: joint 'lwr_a1' has the unknown type 'ball'",
    ),
    (lambda: replaced('<parent link="lwr_base_link"/>', ""), r":26: joint 'lwr_a1' has no parent or no child"),
    (lambda: replaced('<child link="lwr_link_1"/>', ""), r":26: joint 'lwr_a1' has no parent or no child"),
    (lambda: replaced('<child link="lwr_link_1"/>', "<child/>"), r":28: child has no attribute 'link'"),
    (
        lambda: replaced('<child link="lwr_link_2"/>', '<child link="lwr_link_1"/>'),
        r":41: joint 'lwr_a2' is the second one of its child link",
    ),
    (
        lambda: replaced('<child link="lwr_link_2"/>', '<child link="x"/>'),
        "joint 'lwr_a2' names the link 'x', there",
    ),
    (lambda: replaced(MASS_1, ""), r":34: link 'lwr_link_1' has no mass or no inertia"),
    (
        lambda: re.sub(r'(<mass value="2.35"/>)<inertia [^>]*/>', r"\1", DESCRIPTION, count=1),
        r":34: link 'lwr_link_1' has no mass or no inertia",
    ),
    (lambda: replaced(MASS_1, "<mass/>"), r":35: mass needs a number as 'value'"),
    (lambda: replaced(MASS_1, '<mass value="heavy"/>'), r":35: mass needs a number as 'value'"),
    (lambda: replaced('ixy="0" ixz="0"', 'ixz="0"'), r"inertia needs a number as 'ixy'"),
    (
        lambda: replaced('<origin xyz="0 -0.06 0.13"/>', '<origin xyz="0 -0.06"/>'),
        "origin needs three numbers as 'xyz'",
    ),
    (lambda: replaced('<axis xyz="0 -1 0"/>', '<axis xyz="up"/>'), "axis needs three numbers as 'xyz'"),
    (
        lambda: replaced('<collision><origin xyz="0 0 0.055"/>', "<collision/><collision>"),
        r":23: collision has no geometry",
    ),
    (
        lambda: replaced('<cylinder radius="0.09" length="0.11"/></geometry></collision>', "</geometry></collision>"),
        r":23: collision has no geometry",
    ),
    (
        lambda: replaced('radius="0.09" length="0.11"/></geometry></coll', 'radius="0.09"/></geometry></coll'),
        "'length'",
    ),
    (
        lambda: replaced('radius="0.09" length="0.11"/></geometry></coll', 'length="0.09"/></geometry></coll'),
        "'radius'",
    ),
    (lambda: replaced("</robot>", '<link name="alone"/></robot>'), "has two root links, alone and world"),
    (
        lambda: re.sub(r'<joint name="world_to_lwr_base".*?</joint>', "", DESCRIPTION, flags=re.DOTALL),
        "has two root links, lwr_base_link and world",
    ),
    (
        lambda: replaced(
            "</robot>",
            '<joint name="back" type="fixed"><parent link="lwr_link_7"/><child link="world"/></joint></robot>',
        ),
        "has no root link",
    ),
]


@pytest.mark.parametrize("text, sentence", DESCRIPTIONS, ids=range(len(DESCRIPTIONS)))
def test_descriptions_are_refused_with_file_line_and_element(tmp_path, text, sentence):
    path = described(tmp_path, text())
    with pytest.raises(RuntimeError) as refusal:
        _plant.Plant(path, HOME, BOX)
    assert str(refusal.value).startswith(f"robot description {path}")
    assert re.search(sentence, str(refusal.value)), str(refusal.value)


def test_links_that_hang_in_a_circle_do_not_hang_below_the_root(tmp_path):
    text = replaced('<parent link="world"/>', '<parent link="lwr_link_7"/>')
    with pytest.raises(RuntimeError, match="'ih2_base_link' does not hang below the root link"):
        _plant.Plant(described(tmp_path, text), HOME, BOX)


def test_shapes_and_joints_that_the_shipped_description_does_not_have(tmp_path):
    """A ball in the place of a link's cylinder, a joint without ends, one that slides, and one without an axis."""
    fewer = re.sub(r'<limit lower="-2.967059728390360" upper="2.967059728390360"[^>]*/>', "", DESCRIPTION, count=1)
    text = replaced('<joint name="lwr_a1" type="revolute">', '<joint name="lwr_a1" type="continuous">', fewer)
    ball = '<sphere radius="0.08"/></geometry></collision>'
    text = replaced('<cylinder radius="0.09" length="0.11"/></geometry></collision>', ball, text)
    far = np.array([4.0, *HOME[1:]])  # beyond the ends that the joint had
    plant = _plant.Plant(described(tmp_path, text), far, BOX)
    plant.hold(far, steps=50)
    assert plant.state()["position"] == pytest.approx(far, abs=1e-3)
    same = _plant.Plant(URDF, far - 2 * np.pi * np.eye(7)[0], BOX)
    assert plant.state()["palm"][0] == pytest.approx(same.state()["palm"][0], abs=1e-3)
    slides = replaced('name="lwr_a6" type="revolute"', 'name="lwr_a6" type="prismatic"')
    out = _plant.Plant(described(tmp_path, slides), HOME * [1, 1, 1, 1, 1, 1, 0], BOX, board=False)
    before = out.state()["palm"][0]
    out.set_arm([*HOME[:6], 0.1])
    assert np.linalg.norm(out.state()["palm"][0] - before) == pytest.approx(0.1)
    bare = re.sub(r'(<joint name="lwr_a1".*?)<axis xyz="0 0 1"/>', r"\1", DESCRIPTION, count=1, flags=re.DOTALL)
    about_x = _plant.Plant(described(tmp_path, bare), np.zeros(7), BOX, board=False)
    assert about_x.terms()["jacobian"][3:, 0] == pytest.approx([1.0, 0.0, 0.0])


def test_a_turned_origin_is_yaw_after_pitch_after_roll(tmp_path):
    text = replaced('<origin xyz="0 0 0" rpy="0 0 0"/>', '<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.5"/>')
    turned = _plant.Plant(described(tmp_path, text), np.zeros(7), BOX, board=False)
    plain = _plant.Plant(URDF, np.zeros(7), BOX, board=False)
    (a, b, c), (s, t, u) = np.cos([0.3, 0.2, 0.5]), np.sin([0.3, 0.2, 0.5])
    rotation = np.array(
        [
            [c * b, c * t * s - u * a, c * t * a + u * s],
            [u * b, u * t * s + c * a, u * t * a - c * s],
            [-t, b * s, b * a],
        ]
    )
    place = plain.state()["palm"][0]
    assert turned.state()["palm"][0] == pytest.approx([0.1, 0.2, 0.3] + rotation @ place, abs=1e-9)
    assert np.abs(plain.state()["palm"][1]).max() > 0.0


def test_the_chain_of_the_controllers_model_has_seven_joints(tmp_path):
    for text, words in (
        (
            replaced('name="lwr_a3" type="revolute"', 'name="lwr_a3" type="fixed"'),
            "expected 7 joints from lwr_base_link",
        ),
        (DESCRIPTION.replace("ih2_palm", "other_palm"), "has no chain from lwr_base_link to ih2_palm"),
    ):
        path = described(tmp_path, text)
        with pytest.raises(RuntimeError, match=words) as refusal:
            _cell.arm_terms(path, [0.0] * 7, [0.0] * 7)
        assert path in str(refusal.value)


def hand(tmp_path, text):
    path = tmp_path / "hand.yaml"
    path.write_text(text)
    return _plant.Plant(URDF, HOME, BOX, hand=str(path))


FIRST = "/fingers/thumb\\[0\\]"
NUMBERS = [
    ("sliding: 0.8", "sliding: {}", "/contact/sliding", 0.0, 5.0),
    ("torsional: 0.004", "torsional: {}", "/contact/torsional", 0.0, 1.0),
    ("rolling: 0.0001", "rolling: {}", "/contact/rolling", 0.0, 1.0),
    ("damping: 0.012", "damping: {}", "/joints/damping", 0.0, 10.0),
    ("armature: 0.0002", "armature: {}", "/joints/armature", 1e-6, 1.0),
    ("motor: 0, pivot", "motor: {}, pivot", f"{FIRST}/motor", 0, 4),
    ("range: [0.0, 1.92]", "range: [0.0, {}]", f"{FIRST}/range", -3.2, 3.2),
    ("range: [0.0, 1.92]", "range: [{}, 3.1]", f"{FIRST}/range", -3.2, 3.2),
    ("spring: 0.04", "spring: {}", f"{FIRST}/spring", 0.0, 10.0),
    ("arm: 0.010", "arm: {}", f"{FIRST}/arm", 1e-4, 0.1),
    ("length: 0.026", "length: {}", f"{FIRST}/length", 1e-3, 0.3),
    ("radius: 0.009", "radius: {}", f"{FIRST}/radius", 1e-3, 0.1),
    ("mass: 0.018", "mass: {}", f"{FIRST}/mass", 1e-4, 1.0),
    ("pivot: [0.004, 0.030, 0.028]", "pivot: [0.0, 0.0, {}]", f"{FIRST}/pivot", -1.0, 1.0),
    ("limit: 90.0", "limit: {}", "/motors\\[0\\]/limit", 1.0, 1000.0),
    ("tendon_stiffness: 50000.0", "tendon_stiffness: {}", "/tendon_stiffness", 100.0, 1e6),
    ("full_stroke: 1.0", "full_stroke: {}", "/drive/full_stroke", 0.01, 60.0),
    ("lock_share: 0.05", "lock_share: {}", "/drive/lock_share", 0.0, 1.0),
    ("lock_time: 0.2", "lock_time: {}", "/drive/lock_time", 0.001, 10.0),
    ("free_current: 40.0", "free_current: {}", "/drive/free_current", 0.0, 1023.0),
    ("speed_current: 60.0", "speed_current: {}", "/drive/speed_current", 0.0, 1023.0),
    ("stall_current: 400.0", "stall_current: {}", "/drive/stall_current", 1.0, 1023.0),
]


@pytest.mark.parametrize("old, new, where, low, high", NUMBERS, ids=[row[2] for row in NUMBERS])
def test_numbers_of_the_hand_have_their_ranges(tmp_path, old, new, where, low, high):
    for bad in (low - 0.001 * max(1.0, abs(low)), high + 0.001 * high):
        with pytest.raises(
            ValueError, match=rf"{where}: expected a number in {low:g}..{high:g}, got {bad:f}".replace("+", r"\+")
        ):
            hand(tmp_path, replaced(old, new.format(bad), HAND))
    with pytest.raises(ValueError, match=rf"{where}: expected a number in .*, got no number"):
        hand(tmp_path, replaced(old, new.format("many"), HAND))


@pytest.mark.parametrize(
    "old, new, where, low, high", [row for row in NUMBERS if row[2].startswith(("/con", "/dr", "/ten"))]
)
def test_both_ends_of_a_range_of_the_hand_are_inside(tmp_path, old, new, where, low, high):
    for end in (low, high):
        hand(tmp_path, replaced(old, new.format(f"{end:f}"), HAND))


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        (
            "axis: [0.0, 0.0, -1.0]",
            "axis: [0.0, 0.0, -0.999]",
            f"{FIRST}/axis: expected a vector of length 1, got another",
        ),
        ("along: [0.0, 1.0, 0.0]", "along: [0.0, 0.5, 0.0]", f"{FIRST}/along: expected a vector of length 1"),
        (
            "axis: [0.0, 0.0, -1.0]",
            "axis: [0.0, -1.0]",
            f"{FIRST}/axis: expected a list of 3 numbers, got something else",
        ),
        ("range: [0.0, 1.92]", "range: 1.92", f"{FIRST}/range: expected a list of 2 numbers"),
        ("range: [0.0, 1.92]", "range: [0.5, 0.5]", f"{FIRST}/range: expected low before high, got no range"),
        (
            "motor: 0, pivot",
            "motor: 1, pivot",
            r"/motors\[0\]/name: expected a motor that bends a phalanx, got thumb",
        ),
        ("  thumb:\n", "  thumb: []\n  big_toe:\n", "/fingers/thumb: expected a list of phalanges, got"),
        ("  index:\n", "  second:\n", "/fingers/index: expected a value, got nothing"),
        ("  - {name: thumb_abduction, limit: 90.0, both_ways: true}\n", "", "/motors: expected a list of five"),
        (
            "    - {name: index_proximal",
            "    - 7\n    - {name: index_proximal",
            r"/fingers/index\[0\]: expected a map, got",
        ),
        ("both_ways: true", "both_ways: perhaps", "cannot be read"),
    ],
)
def test_fields_of_the_hand_are_what_they_should_be(tmp_path, old, new, sentence):
    with pytest.raises(ValueError, match=sentence) as refusal:
        hand(tmp_path, replaced(old, new, HAND))
    assert f"hand table {tmp_path}/hand.yaml" in str(refusal.value)


def test_phalanges_weigh_less_than_the_whole_hand(tmp_path):
    whole = float(re.search(r'<link name="ih2_base_link">\s*<inertial>.*?<mass value="([\d.]+)"', DESCRIPTION)[1])
    rest = 0.133 - 0.018
    hand(tmp_path, replaced("mass: 0.018", f"mass: {whole - rest - 0.003:f}", HAND))
    with pytest.raises(ValueError, match=r"phalanges weigh 0.\d+ kg, more than the whole hand ih2_base_link in .*, 0"):
        hand(tmp_path, replaced("mass: 0.018", f"mass: {whole - rest + 1e-3:f}", HAND))


@pytest.mark.parametrize("text", ["<robot", "<robot name='a'/>", "no robot at all", ""])
def test_a_description_that_holds_no_robot_is_refused_with_its_name(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(RuntimeError, match="robot.urdf"):
        _cell.arm_terms(str(path), [0.0] * 7, [0.0] * 7)
