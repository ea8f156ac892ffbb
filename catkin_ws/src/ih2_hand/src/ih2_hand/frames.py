"""Frames from the host to the hand: encoders, lengths by first byte, names.

Functions with the name of a command return its frame as bytes. The driver has checked the arguments.
Multi-byte values are sent with the most significant byte first.
"""

from __future__ import annotations

from collections.abc import Sequence

from ih2_hand.wire_choices import WIRE

STOP_ALL, FIRST_CALIBRATION, FAST_CALIBRATION, OPEN_ALL = 0x41, 0x42, 0x46, 0x4C
SET_POSITION, GET_POSITION, SET_POSTURE, GET_CURRENT = 0x44, 0x45, 0x48, 0x49
SET_TENSION, GET_STATUS, LLMC, GRASP_V17 = 0x4A, 0x4B, 0x5F, 0x6F

MEM_PRESHAPE = {
    0x58: "cylindrical",
    0x59: "lateral",
    0x5A: "tridigit",
    0x5B: "bidigit",
    0x6A: "bidigit2",
    0x6B: "tridigit2",
}
MEM_TENSION = {0x5C: "high", 0x5D: "medium", 0x5E: "low"}
MEM_CURRENT = {0x6C: "high", 0x6D: "medium", 0x6E: "low"}

LEGACY_GRASPS = {
    byte: (mode, level, byte == pair[0]) for (mode, level), pair in WIRE.legacy_grasps.items() for byte in pair
}
"""Grasp byte -> (mode, level, is_current)."""

LLMC_DATA = {
    0x70: 0,
    0x71: 0,
    0x72: 2,
    0x73: 2,
    0x74: 2,
    0x76: 0,
    0x77: 0,
    0x21: 2,
    0x31: 2,
    0x22: 0,
    0x23: 0,
    0x24: 4,
    0x25: 0,
    0x41: 2,
    0x42: 0,
    0x43: 0,
    0x44: 4,
    0x45: 0,
    0x61: 2,
    0x62: 0,
    0x63: 0,
    0x64: 4,
    0x65: 0,
    0x66: 2,
}
"""Number of data bytes of each low-level command. An unknown command is framed as if it had none."""

LLMC_REPLY = {
    0x70: 1,
    0x76: 2,
    0x77: 2,
    0x22: 3,
    0x25: 4,
    0x42: WIRE.llmc_reading_bytes,
    0x45: 4,
    0x62: WIRE.llmc_reading_bytes,
    0x65: 4,
}
"""Number of reply bytes of the low-level commands that are answered."""


def move_motor(motor: int, speed: int, close: bool) -> bytes:
    """MoveMotor: `1 S M3 M2 M1 M0 X D8`, `D7..D0`."""
    direction = WIRE.close_direction if close else 1 - WIRE.close_direction
    return bytes((0x80 + 0x40 * direction + 4 * motor + 2 * WIRE.move_dont_care_bit + (speed >> 8), speed & 0xFF))


def set_finger_position(motor: int, position: int) -> bytes:
    """SetFingerPosition, position 0..254."""
    return bytes((SET_POSITION, motor, position))


def set_finger_tension(motor: int, tension: int) -> bytes:
    """SetFingerForce with tension 0..1023; bits 9 and 8 are sent in the byte of the motor number."""
    return bytes((SET_TENSION, ((tension >> 8) << 6) + motor, tension & 0xFF))


def set_finger_current(motor: int, current: int) -> bytes:
    """SetFingerCurrent, 0..1023 counts; closes only."""
    return bytes((LLMC, motor, 0x61, current >> 8, current & 0xFF, motor))


def set_hand_posture(positions: Sequence[int]) -> bytes:
    """SetHandPosture: five positions between two equal bytes."""
    return bytes((SET_POSTURE, *positions, SET_POSTURE))


def grasp(dialect: str, mode: str, level: str, is_current: bool) -> bytes:
    """Automatic grasp in a dialect. Raises KeyError if the table lacks this mode and level (W22)."""
    if dialect == "v17":
        return bytes((GRASP_V17, WIRE.v17_types[mode], WIRE.v17_force[level], WIRE.v17_step))
    return bytes((WIRE.legacy_grasps[mode, level][0 if is_current else 1],))


def _fixed_lengths() -> dict[int, int]:
    table = {first: 1 for first in range(256)}
    table.update({first: 2 for first in range(0x80, 0x100)})
    table.update({first: 2 for first in (GET_POSITION, GET_CURRENT, GET_STATUS)})
    table.update({first: 3 for first in (SET_POSITION, SET_TENSION)})
    table.update({first: WIRE.motors + 2 for first in (SET_POSTURE, *MEM_PRESHAPE)})
    table.update({first: WIRE.mem_tension_length for first in MEM_TENSION})
    table.update({first: WIRE.mem_current_length for first in MEM_CURRENT})
    table[GRASP_V17] = 4
    return table


_LENGTHS = _fixed_lengths()


def frame_length(start: bytes | bytearray, v17: bool = True) -> int | None:
    """Length of the frame that begins with `start`; None if more bytes are needed to determine it.

    With `v17` False the byte 6F is unknown, as in firmware of 2013.
    """
    if not start:
        return None
    first = start[0]
    if first == LLMC:
        return 4 + LLMC_DATA.get(start[2], 0) if len(start) > 2 else None
    if first == GRASP_V17 and not v17:
        return 1
    return _LENGTHS[first]


def is_known(first: int, dialects: Sequence[str] = ("legacy", "v17")) -> bool:
    """True if a first byte is a command in one of the given dialects."""
    if first in LEGACY_GRASPS:
        return "legacy" in dialects
    if first == GRASP_V17:
        return "v17" in dialects
    return (
        first < 0x40 or _LENGTHS[first] > 1 or first in (STOP_ALL, FIRST_CALIBRATION, FAST_CALIBRATION, OPEN_ALL, LLMC)
    )


def reply_length(frame: bytes) -> int:
    """Number of bytes with which the hand answers a complete frame."""
    first = frame[0]
    if first < 0x40 or first == GET_CURRENT:
        return 2
    if first in (GET_POSITION, GET_STATUS):
        return 1
    if first == LLMC:
        return LLMC_REPLY.get(frame[2], 0)
    return 0
