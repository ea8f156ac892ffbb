"""Commands that the controller refuses, field by field: the largest accepted value, the next one, and the line of the
message window."""

import struct

import numpy as np
import pytest
from fri_client import CARTESIAN_IMPEDANCE, COMMAND, JOINT_IMPEDANCE, MONITOR, parse, set_point
from scipy.spatial.transform import Rotation

NAN, INF = float("nan"), float("inf")
OFFSETS = {"position": 144, "frame": 172, "torque": 220, "force": 248, "stiffness": 272, "damping": 300}
OFFSETS |= {"cartesian stiffness": 328, "cartesian damping": 352}
"""of arrays of float32 in a command; typed from the protocol's table"""


def answered(s, field, values, flags=None):
    """One period with an answer in which ``values`` (index: number) replace those of a field."""
    data = bytearray(s.client.answer(s.measurement, **({} if flags is None else {"flags": flags})))
    for index, value in values.items():
        struct.pack_into("<f", data, OFFSETS[field] + 4 * index, value)
    s.measurement = s.cell.step(bytes(data))
    return parse(s.measurement)


def followed(s, field, values):
    """True if command mode continues with such an answer; else the newest line of the message window."""
    return answered(s, field, values)["state"] == COMMAND or s.texts()[-1]


JOINTS = [
    ("stiffness", {0: 5000.0, 6: 0.0}, True),
    ("stiffness", {6: 5001.0}, "cmd.jntStiffness out of range"),
    ("stiffness", {3: NAN}, "cmd.jntStiffness out of range"),
    ("damping", {0: 1.0, 6: 0.0}, True),
    ("damping", {6: -0.01}, "cmd.jntDamping out of range"),
    ("torque", {0: 0.99, 6: -0.99}, True),
    ("torque", {6: -1.01}, "cmd.addJntTrq not properly initialized"),
    ("torque", {2: NAN}, "cmd.addJntTrq not properly initialized"),
]


@pytest.mark.parametrize("field, values, expected", JOINTS)
def test_joint_impedance(session, field, values, expected):
    s = session()
    s.command(30)
    assert followed(s, field, values) == expected


TIP = [
    ("cartesian stiffness", {0: 10000.0, 2: 0.0, 3: 1000.0, 5: 0.0}, True),
    ("cartesian stiffness", {2: 10001.0}, "cmd.cartStiffness out of range"),
    ("cartesian stiffness", {5: 1001.0}, "cmd.cartStiffness out of range"),
    ("cartesian stiffness", {4: -1.0}, "cmd.cartStiffness out of range"),
    ("cartesian damping", {0: 1.0, 5: 0.0}, True),
    ("cartesian damping", {5: -0.01}, "cmd.cartDamping out of range"),
    ("force", {0: 3.0, 5: -1.0}, True),
    ("force", {5: NAN}, "cmd.addTcpFT not properly initialized"),
    ("frame", {3: NAN}, "cmd.cartPos not properly initialized"),
    ("frame", {0: 0.0, 1: 0.0, 2: 0.0}, "cmd.cartPos not properly initialized"),
]


@pytest.mark.parametrize("field, values, expected", TIP)
def test_cartesian_impedance(session, field, values, expected):
    s = session()
    s.command(20)
    assert followed(s, field, values) == expected


def frame_of(fields):
    """Rotation and position of the commanded frame."""
    frame = np.array(fields["commanded_frame"]).reshape(3, 4)
    return frame[:, :3].copy(), frame[:, 3].copy()


def wire(rotation, position):
    return dict(enumerate(np.column_stack([rotation, position]).ravel()))


def test_a_frame_has_to_be_a_rotation(session):
    for change, ok in ((1.0004, True), (1.0006, False), (-1.0, False)):
        s = session()
        rotation, position = frame_of(s.command(20))
        found = followed(s, "frame", wire(rotation * [1.0, 1.0, change], position))
        assert found == (True if ok else "cmd.cartPos not properly initialized"), change


@pytest.mark.parametrize("axis", range(3))
def test_a_frame_may_move_and_turn_so_fast_and_no_faster(session, axis):
    """2 m/s and 4 rad/s, at 5 ms."""
    along = np.eye(3)[axis]
    for faster, turning in ((0.0102, 0.0), (0.0, 0.0204)):
        s = session()
        rotation, position = frame_of(s.command(20))
        turned = Rotation.from_rotvec(0.0196 * along).as_matrix() @ rotation
        assert followed(s, "frame", wire(turned, position + 0.0098 * along)) is True
        turned = Rotation.from_rotvec(turning * along).as_matrix() @ turned
        assert followed(s, "frame", wire(turned, position + (0.0098 + faster) * along)) == "FRI speed limit TCP"


NAMES = ("A1", "A2", "E1", "A3", "A4", "A5", "A6")


@pytest.mark.parametrize("joint", range(7))
def test_every_axis_has_its_limit_switch_for_commands_and_for_going_on(session, joint):
    side = 1.0 if joint % 2 else -1.0
    limits = [0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9]
    home = np.array([0.0, 0.5, 0.0, -0.7, 0.0, 0.5, 0.0])
    home[joint] = side * 0.894
    for going_on in (False, True):
        s = session(home=list(home), krc__position_limit=limits)
        target = np.array(set_point(s.command()))
        for _ in range(2):
            target[joint] += side * 0.0025
            assert s.tick(position=target)["state"] == COMMAND and s.cell.limit_switches == 0
        if going_on:
            s.tick(answer=False)
            fields = s.tick(answer=False)
        else:
            target[joint] += side * 0.0025
            fields = s.tick(position=target)
        assert fields["state"] == MONITOR and s.cell.limit_switches == 1
        assert s.texts() == [f"software limit switch {NAMES[joint]}"]


@pytest.mark.parametrize(
    "strategy, flags, ok",
    [
        (10, 0x0001, True),
        (10, 0x0000, False),
        (10, 0x0003, False),
        (30, JOINT_IMPEDANCE, True),
        (30, 0x0034, False),
        (20, CARTESIAN_IMPEDANCE, True),
        (20, 0x3501, True),
        (20, 0x3701, False),
    ],
)
def test_flags_on_entry(session, strategy, flags, ok):
    s = session()
    s.monitor()
    s.client.flags = flags
    s.client.request(1, strategy)
    fields = s.run(0.3)
    assert (fields["state"] == COMMAND) is ok
    assert s.texts() == ([] if ok else ["cmdFlags do not fit the control strategy"])
    if ok:
        assert s.tick(flags=flags ^ 0x8000)["state"] == MONITOR
        assert s.texts() == ["cmdFlags changed during cmd mode"]


def period(s, latency=None):
    """One period whose answer takes so long (s); None: no answer."""
    if latency is not None and s.measurement is not None:
        s.cell.receive(s.client.answer(s.measurement), latency)
    s.measurement = s.cell.step(None)
    return parse(s.measurement)


def test_the_window_is_the_last_hundred_packets(session):
    s = session()
    period(s)
    for _ in range(100):
        fields = period(s, 0.002)
    assert fields["answer_rate"] == 1.0 and fields["latency"] == pytest.approx(0.002)
    before = fields["miss_counter"]
    for missed in range(1, 11):
        fields = period(s)
        assert fields["answer_rate"] == pytest.approx(1.0 - missed / 100)
        assert fields["miss_counter"] == before + missed
    for _ in range(90):
        fields = period(s, 0.004)
    assert fields["answer_rate"] == pytest.approx(0.90) and fields["latency"] == pytest.approx(0.004)
    fields = period(s, 0.004)
    assert fields["answer_rate"] == pytest.approx(0.91) and fields["miss_counter"] == before + 10


@pytest.mark.parametrize("every, entry_quality, starts", [(25, 2, True), (25, 3, False), (13, 2, False), (13, 1, True)])
def test_a_start_needs_the_entry_quality(session, every, entry_quality, starts):
    """4 % missing is OK, nearly 8 % is BAD; the program of Stanford does not wait for a quality by itself."""
    s = session(krc__convention="stanford", krc__entry_quality=entry_quality)
    for packet in range(300):
        s.tick(answer=packet % every != 0)
    s.client.ints[14], s.client.ints[15] = 10, 10
    for packet in range(400):
        fields = s.tick(answer=packet % every != 0)
        if fields["state"] == COMMAND:
            break
    assert (fields["state"] == COMMAND) is starts and fields["quality"] == (2 if every == 25 else 1)
    told = [text for text in s.texts() if text.startswith("friStart: quality too low, answer rate 0.9")]
    assert bool(told) is not starts
