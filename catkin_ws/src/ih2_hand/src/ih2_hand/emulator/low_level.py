"""Low-level (LLMC) frames `5F MA cmd [data] MA` of the simulated hand."""

from __future__ import annotations

from collections.abc import Sequence

from ih2_hand import frames
from ih2_hand.emulator.motor import Motor
from ih2_hand.wire_choices import WIRE

RAW_PER_COUNT = 400  # raw encoder counts per position count; the real value is unknown, 17 bits are specified

_STORES = {0x24: 0x25, 0x44: 0x45, 0x64: 0x65, 0x72: 0x76, 0x73: 0x77}
"""Store command -> command that reads the stored value."""


class LowLevel:
    """Executes low-level frames on the motors and stores their values."""

    def __init__(self, motors: Sequence[Motor]):
        self._stored = {
            motor.number: {
                0x25: bytes(4),
                0x45: bytes(4),
                0x65: bytes(4),
                0x76: bytes((1, 0xFF)),
                0x77: bytes((3, 0xFF)),
            }
            for motor in motors
        }
        self._raw_zero = {motor.number: 0.0 for motor in motors}

    def execute(self, motor: Motor, frame: bytes) -> bytes:
        """Execute one frame whose addresses match. Returns its answer, which is empty for commands."""
        command, data = frame[2], frame[3:-1]
        number = motor.number
        value = int.from_bytes(data, "big")
        if command in _STORES:
            self._stored[number][_STORES[command]] = data
        elif command in self._stored[number]:
            return self._stored[number][command]
        elif command == 0x70:
            return bytes((motor.status_byte,))
        elif command == 0x71:
            motor.stop()
        elif command == 0x74:
            motor.drive(value & 0x1FF, bool(value >> 9 & 1) == bool(WIRE.close_direction))
        elif command in (0x21, 0x31):
            raw = (command >> 4 & 1) << 16 | value
            motor.go_to(max(0, min(255, round(raw / RAW_PER_COUNT + self._raw_zero[number]))))
        elif command == 0x22:
            raw = round((motor.position - self._raw_zero[number]) * RAW_PER_COUNT)
            return (raw & 0x1FFFF).to_bytes(3, "big")
        elif command == 0x23:
            self._raw_zero[number] = motor.position
        elif command == 0x41:
            motor.pull(value & 0x3FF)
        elif command in (0x61, 0x66):
            motor.close_to_current(value & 0x3FF, stop_after=command == 0x66)
        elif command in (0x42, 0x62):
            reading = motor.tension if command == 0x42 else min(1023, int(motor.current))
            return reading.to_bytes(frames.LLMC_REPLY[command], "big")
        return b""
