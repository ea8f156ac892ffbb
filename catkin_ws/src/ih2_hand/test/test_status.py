"""The STATUS byte of one motor, bit by bit."""

from __future__ import annotations

import pytest
from ih2_hand.status import at_rest, decode_status, describe_status


@pytest.mark.parametrize(
    ("raw", "mode", "flags"),
    [
        (0x00, "stop", ""),
        (0x21, "speed", "moving"),
        (0x50, "position", "target_reached"),
        (0x68, "tension", "fully_open"),
        (0x84, "current", "fully_closed"),
        (0xA0, "unassigned", ""),
        (0xC0, "current_position", ""),
        (0x02, "stop", "over_current"),
        (0x5F, "position", "target_reached, fully_open, fully_closed, over_current, moving"),
    ],
)
def test_a_status_is_mode_and_flags(raw, mode, flags):
    status = decode_status(3, raw)
    assert (status["motor"], status["raw"], status["mode"], status["mode_code"]) == (3, raw, mode, raw >> 5)
    assert ", ".join(name for name, value in status.items() if value is True) == flags
    assert status["com_error"] is False
    assert describe_status(raw) == ", ".join([mode, *([flags.replace("_", " ")] if flags else [])])


@pytest.mark.parametrize(
    ("raw", "rests"),
    [
        (0x00, True),
        (0x08, True),
        (0x10, True),
        (0x01, True),
        (0x50, True),
        (0x51, False),
        (0x40, False),
        (0x41, False),
        (0x70, False),
        (0x20, False),
        (0xD0, False),
        (0xF0, False),
    ],
)
def test_a_motor_rests_when_it_is_off_or_stands_at_its_position(raw, rests):
    assert at_rest(raw) is rests
