"""The object: weight that moves from hand to hand, contact that the arm feels, and falling."""

import numpy as np
import pytest
from conftest import URDF
from fri_client import Session, parse
from scipy.spatial.transform import Rotation

WEIGHT = 0.31 * 9.81
EXACT = {
    "torque_noise__sigma": 0.0,
    "torque_noise__bias": 0.0,
    "torque_noise__hysteresis": 0.0,
    "torque_noise__offset": 0.0,
    "krc__payload_error": 0.0,
    "krc__inertia_error": 0.0,
}
IN_HAND = np.array([-0.08, 0.0, -0.05])


def scene(session, **parameters):
    """Session in monitor mode, and the position of the hand at which the object is 20 mm before the palm."""
    s = session(**parameters)
    s.monitor()
    palm = s.cell.truth()["robot_hand"]["position"]
    return s, palm + [0.0, 0.06, -0.05] - IN_HAND


def approach(s, hand, speed=0.1, distance=0.03):
    """The person brings the object to the palm (toward -y) and presses."""
    for _ in range(60):
        s.cell.set_human(hand, grip=1.0)
        s.tick()
    first_touch = None
    for _ in range(int(distance / (speed * s.cell.period))):
        hand = hand - [0.0, speed * s.cell.period, 0.0]
        s.cell.set_human(hand, velocity=[0.0, -speed, 0.0], grip=1.0)
        s.tick()
        if first_touch is None and np.linalg.norm(s.cell.truth()["palm_force"]) > 0.1:
            first_touch = s.cell.time
    for _ in range(100):
        s.cell.set_human(hand, grip=1.0)
        s.tick()
    return hand, first_touch


PRESHAPE = [245 / 255, 5 / 255, 30 / 255, 50 / 255, 50 / 255]
CLOSED = [245 / 255, 1.0, 1.0, 1.0, 1.0]


def preshape(s):
    """The hand takes the shape from which it closes around the mug."""
    s.cell.set_motors([1.0] * 5, PRESHAPE, [640.0] * 5)


def close(s, hand, current=240.0, grip=1.0, seconds=1.6):
    """Fingers close until the motors reach a current; the person keeps holding."""
    s.cell.set_motors([1.0] * 5, CLOSED, [current] * 5)
    for _ in range(int(seconds / s.cell.period)):
        s.cell.set_human(hand, grip=grip)
        s.tick()


def let_go(s, hand, seconds=0.5, away=0.3):
    """The person opens their hand and takes it away; truths on the way."""
    truths = []
    for i in range(int((seconds + 1.0) / s.cell.period)):
        released = i * s.cell.period / seconds
        s.cell.set_human(hand + [away if released > 1.2 else 0.0, 0.0, 0.0], grip=max(0.0, 1.0 - released))
        s.tick()
        truths.append(s.cell.truth())
    return truths


def test_touch_is_felt_in_the_joint_torques(session):
    s, hand = scene(session, **EXACT)
    preshape(s)
    before = np.array(s.run(0.5)["external_torque"])
    hand, touched = approach(s, hand)
    truth = s.cell.truth()
    assert touched is not None
    assert truth["palm_force"][1] < -1.0  # pressed into the palm, toward -y
    fields = parse(s.measurement)
    felt = np.array(fields["external_torque"]) - before
    assert np.abs(felt - truth["external_torque"]).max() < 0.01
    # The wrench is this force at a point of the hand. The remaining torque has a lever of at most the object's offset
    # from the middle of the palm (15 mm, as above).
    jacobian = np.array(fields["jacobian"]).reshape(6, 7)[[0, 1, 2, 5, 4, 3]]
    rest = felt - jacobian[:3].T @ truth["palm_force"]
    assert np.abs(rest).max() < 0.15
    torque, *_ = np.linalg.lstsq(jacobian[3:].T, rest, rcond=None)
    assert np.abs(rest - jacobian[3:].T @ torque).max() < 0.01
    assert np.linalg.norm(torque) < 0.015 * np.linalg.norm(truth["palm_force"])
    assert abs(felt[0]) > 0.5


def test_load_moves_from_person_to_robot(session):
    s, hand = scene(session)
    preshape(s)
    hand, _ = approach(s, hand)
    close(s, hand)
    assert s.cell.truth()["held_by"] == "both"
    motors = s.cell.motors()
    assert all(motor["locked"] and 0.1 < motor["position"] < 0.95 and motor["current"] == 0.0 for motor in motors[1:])
    truths = let_go(s, hand)
    robot = np.array([truth["robot_load_share"] for truth in truths])
    assert robot[0] < 0.2 and robot[-1] == pytest.approx(1.0, abs=0.02) and truths[-1]["human_load_share"] < 0.02
    assert np.abs(np.diff(robot)).max() < 0.2
    assert max(np.linalg.norm(truth["object_velocity"]) for truth in truths) < 0.1
    truth = truths[-1]
    assert truth["held_by"] == "robot" and not truth["dropped"]
    assert truth["palm_force"][2] == pytest.approx(-WEIGHT, abs=0.05)
    touch = s.cell.touch()
    assert (
        touch["palm"][0] < -1.0
        and sum(np.linalg.norm(touch[f"{f}_distal"]) > 1.0 for f in ("index", "middle", "ring")) >= 2
    )


def test_touch_of_the_hand_is_distinguished_from_the_object(session):
    """A person's hand on the robot's hand is a touch, and no force of the object."""
    s, _ = scene(session)
    s.cell.place("world", [0.3, 0.9, 0.5])  # it falls beside
    preshape(s)
    hand = s.cell.truth()["robot_hand"]["position"] + [0.0, 0.15, 0.0]
    for _ in range(int(0.15 / (0.05 * s.cell.period))):
        hand = hand - [0.0, 0.05 * s.cell.period, 0.0]
        s.cell.set_human(hand, velocity=[0.0, -0.05, 0.0], grip=0.0)
        s.tick()
        truth = s.cell.truth()
        if np.linalg.norm(truth["touch_force"]) > 0.5:
            break
    assert np.linalg.norm(truth["touch_force"]) > 0.5 and np.linalg.norm(truth["palm_force"]) == 0.0
    rotation = Rotation.from_quat(truth["robot_hand"]["rotation"])
    felt = sum(rotation.apply(force) for force in s.cell.touch().values())
    assert truth["touch_force"] == pytest.approx(felt, abs=1e-3)  # the palm has turned a step since


def test_touch_within_a_period_is_not_lost():
    """Forces of the truth and of the touch sensors are means over the FRI period: a hand that bumps into the palm and
    is away again 40 ms before the end of a long period leaves the same impulse as with short ones."""
    sums = []
    for period in (0.1, 0.001):
        s = Session(URDF, krc__period=period, object__start="world", object__position=[0.3, 0.9, 0.5])
        palm = s.cell.truth()["robot_hand"]["position"]
        s.cell.set_human(palm + [0.0, 0.12, 0.0], velocity=[0.0, -2.0, 0.0], grip=0.0)
        impulse, touch = np.zeros(3), np.zeros(3)
        for _ in range(round(0.1 / period)):
            s.cell.step(None)
            impulse += period * s.cell.truth()["touch_force"]
            touch += period * sum(s.cell.touch().values())
        sums.append((impulse, touch))
    (long, long_touch), (short, short_touch) = sums
    assert np.linalg.norm(short) > 0.1, "Ns"
    assert long == pytest.approx(short, abs=1e-3) and long_touch == pytest.approx(short_touch, abs=1e-3)


def test_fingers_folded_before_the_object_came_do_not_grasp(session):
    """Ring and little finger are closed, the thumb is open: they push the object, and nothing opposes them.

    The holder is not checked: the person presses the object on fingers whose friction (0.6 x 11 N) could carry it."""
    s, hand = scene(session)
    folded = [254 / 255, 5 / 255, 80 / 255, 80 / 255, 245 / 255]
    s.cell.set_motors([1.0] * 5, folded, [640.0] * 5)
    for _ in range(300):
        s.cell.set_human(hand + [0.0, 0.2, 0.0], grip=1.0)
        s.tick()
    hand, touched = approach(s, hand)
    truth = s.cell.truth()
    assert touched is not None and np.linalg.norm(s.cell.touch()["ring_distal"]) > 1.0
    assert truth["held_by"] == "human"
    s.cell.set_motors([1.0] * 5, [254 / 255, 1.0, 1.0, 1.0, 245 / 255], [240.0] * 5)
    for _ in range(320):
        s.cell.set_human(hand, grip=1.0)
        s.tick()
    assert s.cell.truth()["held_by"] == "both"


def test_robot_hands_over_to_a_person(session):
    s = session(object__start="robot_hand", object__position=[0.04, 0.0, 0.0], object__rotation=[-0.5, -0.5, -0.5, 0.5])
    s.monitor()
    truth = s.cell.truth()
    assert truth["held_by"] == "robot" and truth["robot_load_share"] == pytest.approx(1.0, abs=0.02)
    assert np.allclose(np.abs(truth["object"]["rotation"]), [0, 0, 0, 1], atol=0.05)
    hand = truth["object"]["position"] - IN_HAND
    for i in range(100):
        s.cell.set_human(hand, grip=min(1.0, i / 50))
        s.tick()
    assert s.cell.truth()["held_by"] == "both"
    s.cell.set_motors([1.0] * 5, [245 / 255, 0.0, 0.0, 0.0, 0.0], [640.0] * 5)
    for _ in range(200):
        s.cell.set_human(hand, grip=1.0)
        s.tick()
    truth = s.cell.truth()
    assert truth["held_by"] == "human" and truth["human_load_share"] == pytest.approx(1.0, abs=0.05)
    assert not truth["dropped"]


def test_a_board_through_the_hand_is_refused_before_anything_moves(session):
    palm = session().cell.truth()["robot_hand"]["position"]
    depth = r"would stand \d+(\.\d+)? mm inside"
    with pytest.raises(ValueError, match=rf"(board {depth} (ih2|lwr)_\w+|\w+ {depth} board) at the start"):
        session(contact__board_center=[float(v) for v in palm])


@pytest.mark.parametrize(
    "shape, size, mass",
    [
        ("box", [0.06, 0.05, 0.12], 0.5),
        ("sphere", [0.07, 0.07, 0.07], 0.1),
        ("cylinder", [0.03, 0.03, 0.15], 0.03),
        ("box", [0.2, 0.2, 0.2], 3.0),
    ],
)
def test_other_objects_neither_explode_nor_sink(session, shape, size, mass):
    center = [0.0, 0.0, size[2] / 2]
    s = session(
        object__shape=shape,
        object__size=size,
        object__mass=mass,
        object__center=center,
        object__start="world",
        object__position=[0.45, -0.55, 0.15],
    )
    for _ in range(600):
        s.tick()
        assert np.linalg.norm(s.cell.truth()["object_velocity"]) < 2.0
    truth = s.cell.truth()
    middle = truth["object"]["position"] + [0, 0, size[2] / 2]
    assert truth["held_by"] == "board" and 0.04 < middle[2] < 0.2
    s.cell.place("human_hand", [-0.08, 0.0, -size[2] / 2])
    for _ in range(400):
        s.cell.set_human([1.0, 0.2, 0.5], grip=1.0, grip_force=60.0)
        s.tick()
    truth = s.cell.truth()
    assert truth["held_by"] == "human" and truth["human_load_share"] == pytest.approx(1.0, abs=0.05)


def test_rotations_are_reversed_on_the_wire_and_axes_are_those_of_the_base(session):
    """Table: wrench Fx Fy Fz Tz Ty Tx, Jacobian rows X Y Z RZ RY RX; read here against the model's own terms."""
    from coglab_sim import _cell
    from conftest import URDF

    s = session(**EXACT)
    s.monitor()
    s.cell.set_push([1.0, 2.0, 3.0], [0.4, 0.5, 0.6])
    fields = s.run(0.5)
    assert np.abs(np.array(fields["wrench"]) - [1.0, 2.0, 3.0, 0.6, 0.5, 0.4]).max() < 0.02
    terms = _cell.arm_terms(URDF, fields["position"], [0.0] * 7)
    jacobian = np.array(fields["jacobian"]).reshape(6, 7)
    assert np.abs(jacobian - terms["jacobian"][[0, 1, 2, 5, 4, 3]]).max() < 1e-6
    assert np.abs(np.array(fields["mass"]).reshape(7, 7) - terms["mass"]).max() < 1e-5
    assert np.abs(np.array(fields["gravity"]) - terms["gravity"]).max() < 1e-4
    frame = np.array(fields["frame"]).reshape(3, 4)
    assert np.abs(frame[:, 3] - terms["tip"]["position"]).max() < 1e-6
    assert (
        np.abs(
            np.array(fields["torque"])
            - fields["gravity"]
            + jacobian[[0, 1, 2, 5, 4, 3]].T @ [1.0, 2.0, 3.0, 0.4, 0.5, 0.6]
        ).max()
        < 0.01
    )
