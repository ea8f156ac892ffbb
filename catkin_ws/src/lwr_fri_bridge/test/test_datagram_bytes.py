"""The bytes of both datagrams, read a second time.

The tables below are typed from the description of the interface (offset, format, name) and share nothing
with the C++ header: every field gets values that occur nowhere else, and both directions are checked. A
swapped pair of fields, a shifted offset, another joint order or wrong order of the rotations turns these
tests red.
"""

from __future__ import annotations

import pathlib
import struct

import lwr_fri_bridge
import pytest

HEADER = [
    (0, "H", "counter"),
    (2, "H", "reflected"),
    (4, "H", "size"),
    (6, "H", "id"),
    (8, "16f", "krl_reals"),
    (72, "16i", "krl_ints"),
    (136, "H", "krl_bools"),
]
MEASUREMENT = HEADER + [
    (140, "f", "timestamp"),
    (144, "H", "state"),
    (146, "H", "quality"),
    (148, "f", "measurement_period"),
    (152, "f", "command_period"),
    (156, "f", "safety_scale"),
    (160, "f", "answer_rate"),
    (164, "f", "latency"),
    (168, "f", "jitter"),
    (172, "f", "miss_rate"),
    (176, "I", "miss_counter"),
    (180, "H", "power"),
    (182, "H", "control"),
    (184, "H", "drive_error"),
    (186, "H", "drive_warning"),
    (188, "7f", "temperature"),
    (216, "7f", "measured_position"),
    (244, "12f", "measured_frame"),
    (292, "7f", "commanded_position"),
    (320, "7f", "commanded_position_offset"),
    (348, "12f", "commanded_frame"),
    (396, "12f", "commanded_frame_offset"),
    (444, "7f", "measured_torque"),
    (472, "7f", "external_torque"),
    (500, "6f", "external_wrench"),
    (524, "42f", "jacobian"),
    (692, "49f", "mass_matrix"),
    (888, "7f", "gravity"),
]
COMMAND = HEADER + [
    (140, "I", "flags"),
    (144, "7f", "joint_position"),
    (172, "12f", "cartesian_frame"),
    (220, "7f", "joint_torque"),
    (248, "6f", "cartesian_force"),
    (272, "7f", "joint_stiffness"),
    (300, "7f", "joint_damping"),
    (328, "6f", "cartesian_stiffness"),
    (352, "6f", "cartesian_damping"),
]
SIZES = {"measurement": 916, "command": 376}
TABLES = {"measurement": MEASUREMENT, "command": COMMAND}
LIMITS = pathlib.Path(__file__).parents[2] / "lwr_description" / "config" / "joint_limits.yaml"


def distinct_values(table: list[tuple[int, str, str]]) -> dict[str, object]:
    """A value per entry that no other entry has, exactly representable in float32."""
    values: dict[str, object] = {}
    number = 1
    for _, form, name in table:
        count = int(form[:-1] or 1)
        entries = [number + i for i in range(count)]
        number += count
        if form[-1] == "f":
            entries = [entry + 0.25 for entry in entries]
        values[name] = entries if count > 1 else entries[0]
    return values


def pack(table: list[tuple[int, str, str]], size: int, values: dict[str, object]) -> bytes:
    """The datagram as the table describes it."""
    data = bytearray(size)
    for offset, form, name in table:
        value = values[name]
        struct.pack_into("<" + form, data, offset, *(value if isinstance(value, list) else [value]))
    return bytes(data)


@pytest.mark.parametrize("kind", ["measurement", "command"])
def test_table_is_complete(kind: str) -> None:
    """Fields follow each other without hole or overlap, besides the two bytes of padding."""
    end = 0
    for offset, form, name in TABLES[kind]:
        assert offset - end == (2 if end == 138 else 0), name
        end = offset + struct.calcsize("<" + form)
    assert end == SIZES[kind]


@pytest.mark.parametrize("kind", ["measurement", "command"])
def test_both_directions(kind: str) -> None:
    table, size = TABLES[kind], SIZES[kind]
    values = distinct_values(table)
    data = pack(table, size, values)
    assert getattr(lwr_fri_bridge, f"decode_{kind}")(data) == values
    assert getattr(lwr_fri_bridge, f"encode_{kind}")(values) == data


@pytest.mark.parametrize("kind", ["measurement", "command"])
def test_wrong_size_is_refused(kind: str) -> None:
    for size in (0, SIZES[kind] - 1, SIZES[kind] + 1):
        with pytest.raises(ValueError, match=str(SIZES[kind])):
            getattr(lwr_fri_bridge, f"decode_{kind}")(bytes(size))


def test_golden_headers() -> None:
    command = lwr_fri_bridge.encode_command({"counter": 1, "reflected": 0x1234, "size": 376, "id": 0x1005})
    assert command[:8] == bytes.fromhex("01 00 34 12 78 01 05 10")
    measurement = lwr_fri_bridge.encode_measurement({"counter": 2, "reflected": 1, "size": 916, "id": 0x2006})
    assert measurement[:8] == bytes.fromhex("02 00 01 00 94 03 06 20")
    # The controller's own self-test of the byte order of floats.
    assert struct.pack("<I", 0x40490FDB) == bytes.fromhex("DB 0F 49 40")
    pi = lwr_fri_bridge.decode_command(bytes(8) + bytes.fromhex("DB0F4940") + bytes(364))
    assert pi["krl_reals"][0] == pytest.approx(3.14159274, abs=1e-8)


def monitor_datagram(counter: int, **fields: object) -> bytes:
    values: dict[str, object] = {name: [0] * int(form[:-1]) if len(form) > 1 else 0 for _, form, name in MEASUREMENT}
    identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]
    values.update(
        counter=counter,
        size=916,
        id=0x2006,
        state=1,
        quality=3,
        control=1,
        power=0x7F,
        measurement_period=0.005,
        command_period=0.005,
        commanded_frame=identity,
        commanded_frame_offset=identity,
    )
    values.update(fields)
    return pack(MEASUREMENT, 916, values)


def read(table: list[tuple[int, str, str]], data: bytes, name: str) -> tuple:
    offset, form = next((o, f) for o, f, n in table if n == name)
    return struct.unpack_from("<" + form, data, offset)


def test_bridge_reads_joint_order_and_reversed_torques() -> None:
    """What the bridge tells the controllers: wire order of the joints, Tx Ty Tz from Tz Ty Tx."""
    bridge = lwr_fri_bridge.Bridge(str(LIMITS))
    joints = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    data = monitor_datagram(
        5,
        measured_position=joints,
        measured_frame=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0],  # the tool lies along the base's axes
        commanded_position=joints,
        measured_torque=[1, 2, 3, 4, 5, 6, 7],
        external_torque=[11, 12, 13, 14, 15, 16, 17],
        external_wrench=[21, 22, 23, 24, 25, 26],
    )
    assert bridge.answer(data, 10**9) is not None
    sample = bridge.snapshot()
    assert list(sample["position"]) == pytest.approx(joints, abs=1e-7)
    assert list(sample["torque"]) == [1, 2, 3, 4, 5, 6, 7]
    assert list(sample["external_torque"]) == [11, 12, 13, 14, 15, 16, 17]
    assert list(sample["tool_wrench"]) == [21, 22, 23, 26, 25, 24]


def test_bridge_writes_stiffness_with_reversed_rotations() -> None:
    bridge = lwr_fri_bridge.Bridge(
        str(LIMITS),
        control_mode="cartesian_impedance stiffness 1 2 3 4 5 6 damping .1 .2 .3 .4 .5 .6",
    )
    answer = bridge.answer(monitor_datagram(5), 10**9)
    assert read(COMMAND, answer, "cartesian_stiffness") == (1, 2, 3, 6, 5, 4)
    assert read(COMMAND, answer, "cartesian_damping") == pytest.approx((0.1, 0.2, 0.3, 0.6, 0.5, 0.4))
    assert read(COMMAND, answer, "flags") == (0x3500,)


def test_bridge_mirrors_the_sum() -> None:
    bridge = lwr_fri_bridge.Bridge(str(LIMITS))
    own = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    offset = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07]
    answer = bridge.answer(
        monitor_datagram(
            65535,
            commanded_position=own,
            commanded_position_offset=offset,
            measured_position=[0.0] * 7,
        ),
        10**9,
    )
    assert read(COMMAND, answer, "joint_position") == pytest.approx(
        [a + b for a, b in zip(own, offset, strict=True)], abs=1e-7
    )
    assert read(COMMAND, answer, "reflected") == (65535,)
    assert read(COMMAND, answer, "size") == (376,)
    assert read(COMMAND, answer, "id") == (0x1005,)
    assert read(COMMAND, answer, "joint_torque") == (0,) * 7
    assert read(COMMAND, answer, "cartesian_force") == (0,) * 6


def test_base_axes() -> None:
    """Signs of the kinematics: +A1 turns towards +y, +A2 leans backwards from the candle (axis -y)."""
    candle = lwr_fri_bridge.flange_pose([0.0] * 7)
    assert candle[:3, 3] == pytest.approx([0, 0, 1.1785], abs=1e-12)
    leaned = lwr_fri_bridge.flange_pose([0, 0.5, 0, 0, 0, 0, 0])
    turned = lwr_fri_bridge.flange_pose([0.5, 0.5, 0, 0, 0, 0, 0])
    assert leaned[0, 3] < -0.3 and abs(leaned[1, 3]) < 1e-12
    assert turned[1, 3] < -0.15  # the leaning arm (-x) turned by +0.5 about +z
    bent = lwr_fri_bridge.flange_pose([0, 0, 0, 0.5, 0, 0, 0])
    assert bent[0, 3] > 0.1  # A3 about +y
