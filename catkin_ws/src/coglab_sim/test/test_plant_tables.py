"""Robot descriptions and tables of the hand, field by field: errors name the file, the place and the expected value."""

import re

import numpy as np
import pytest
from coglab_sim import _cell
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


SHAPE = '<cylinder radius="0.09" length="0.11"/></geometry></collision>'
DESCRIPTIONS = [
    (lambda: "<robot", "cannot be read as a URDF: "),
    (lambda: replaced('<link name="lwr_link_1">', "<link>"), r":\d+: link has no attribute 'name'"),
    (lambda: replaced('name="lwr_a1" type="revolute"', 'name="lwr_a1" type="ball"'), r":26: joint 'lwr_a1' .*'ball'"),
    (lambda: replaced('<child link="lwr_link_2"/>', '<child link="lwr_link_1"/>'), r":41: joint 'lwr_a2' .*second"),
    (lambda: replaced('<child link="lwr_link_2"/>', '<child link="x"/>'), "joint 'lwr_a2' names the link 'x'"),
    (lambda: replaced('<mass value="2.35"/>', ""), r":34: link 'lwr_link_1' has no mass or no inertia"),
    (lambda: replaced('<mass value="2.35"/>', '<mass value="heavy"/>'), r":35: mass needs a number as 'value'"),
    (lambda: replaced('<mass value="2.35"/>', '<mass value="-2.35"/>'), "MuJoCo refuses the robot"),
    (lambda: replaced('<axis xyz="0 -1 0"/>', '<axis xyz="up"/>'), "axis needs three numbers as 'xyz'"),
    (lambda: replaced(SHAPE, "</geometry></collision>"), r":23: collision has no geometry"),
    (lambda: replaced(SHAPE, '<mesh filename="a.stl"/></geometry></collision>'), "mesh is no shape for contacts"),
    (lambda: replaced("</robot>", '<link name="alone"/></robot>'), "has two root links, alone and world"),
    (lambda: replaced('name="lwr_a3" type="revolute"', 'name="lwr_a3" type="fixed"'), "expected 7 joints"),
    (lambda: DESCRIPTION.replace("ih2_base_link", "other_hand"), "has no link 'ih2_base_link'"),
]


@pytest.mark.parametrize("text, sentence", DESCRIPTIONS, ids=range(len(DESCRIPTIONS)))
def test_descriptions_are_refused_with_file_line_and_element(tmp_path, text, sentence):
    path = described(tmp_path, text())
    with pytest.raises(RuntimeError) as refusal:
        _cell.Plant(path, HOME, BOX)
    assert path in str(refusal.value)
    assert re.search(sentence, str(refusal.value)), str(refusal.value)


def test_links_that_hang_in_a_circle_do_not_hang_below_the_root(tmp_path):
    text = replaced('<parent link="world"/>', '<parent link="lwr_link_7"/>')
    with pytest.raises(RuntimeError, match="'ih2_base_link'"):
        _cell.Plant(described(tmp_path, text), HOME, BOX)


def test_shapes_and_joints_that_the_shipped_description_does_not_have(tmp_path):
    """A ball in the place of a link's cylinder, a joint without ends, one that slides, and one without an axis."""
    fewer = re.sub(r'<limit lower="-2.967059728390360" upper="2.967059728390360"[^>]*/>', "", DESCRIPTION, count=1)
    text = replaced('<joint name="lwr_a1" type="revolute">', '<joint name="lwr_a1" type="continuous">', fewer)
    ball = '<sphere radius="0.08"/></geometry></collision>'
    text = replaced('<cylinder radius="0.09" length="0.11"/></geometry></collision>', ball, text)
    far = np.array([4.0, *HOME[1:]])  # beyond the ends that the joint had
    plant = _cell.Plant(described(tmp_path, text), far, BOX)
    plant.hold(far, steps=50)
    assert plant.state()["position"] == pytest.approx(far, abs=1e-3)
    same = _cell.Plant(URDF, far - 2 * np.pi * np.eye(7)[0], BOX)
    assert plant.state()["palm"][0] == pytest.approx(same.state()["palm"][0], abs=1e-3)
    slides = replaced('name="lwr_a6" type="revolute"', 'name="lwr_a6" type="prismatic"')
    out = _cell.Plant(described(tmp_path, slides), HOME * [1, 1, 1, 1, 1, 1, 0], BOX, board=False)
    before = out.state()["palm"][0]
    out.set_arm([*HOME[:6], 0.1])
    assert np.linalg.norm(out.state()["palm"][0] - before) == pytest.approx(0.1)
    bare = re.sub(r'(<joint name="lwr_a1".*?)<axis xyz="0 0 1"/>', r"\1", DESCRIPTION, count=1, flags=re.DOTALL)
    about_x = _cell.Plant(described(tmp_path, bare), np.zeros(7), BOX, board=False)
    assert about_x.terms()["jacobian"][3:, 0] == pytest.approx([1.0, 0.0, 0.0])


def test_a_turned_origin_is_yaw_after_pitch_after_roll(tmp_path):
    text = replaced('<origin xyz="0 0 0" rpy="0 0 0"/>', '<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.5"/>')
    turned = _cell.Plant(described(tmp_path, text), np.zeros(7), BOX, board=False)
    plain = _cell.Plant(URDF, np.zeros(7), BOX, board=False)
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
    return _cell.Plant(URDF, HOME, BOX, hand=str(path))


@pytest.mark.parametrize("text", ["<robot", "<robot name='a'/>", "no robot at all", ""])
def test_a_description_that_holds_no_robot_is_refused_with_its_name(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(RuntimeError, match="robot.urdf"):
        _cell.arm_terms(str(path), [0.0] * 7, [0.0] * 7)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("sliding: 0.8", "sliding: 5.001", r"/contact/sliding: .* 0\.\.5, got 5\.001"),
        ("motor: 0, pivot", "motor: 5, pivot", r"/fingers/thumb\[0\]/motor: .* 0\.\.4"),
        ("tendon_stiffness: 50000.0", "", "/tendon_stiffness: .* nothing"),
        ("axis: [0.0, 0.0, -1.0]", "axis: [0.0, 0.0, -0.999]", "/axis: .* length 1"),
        ("range: [0.0, 1.92]", "range: [0.5, 0.5]", "/range: .* low"),
        ("  index:\n", "  second:\n", "/fingers/index: .* nothing"),
        ("mass: 0.018", "mass: 0.9", "phalanges .* ih2_base_link"),
        ("palm: ih2_base_link", "palm: [", "cannot be read"),
    ],
)
def test_tables_of_the_hand_are_refused_with_file_and_field(tmp_path, old, new, words):
    with pytest.raises(ValueError, match=words) as refusal:
        hand(tmp_path, replaced(old, new, HAND))
    assert "hand table" in str(refusal.value)
