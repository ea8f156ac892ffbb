"""The STATUS byte of one motor (EH1 guide 2.4.3)."""

from __future__ import annotations

from typing import Any

from ih2_hand.wire_choices import WIRE

MODES = ("stop", "speed", "position", "tension", "current", "unassigned", "current_position", "bus_error")
"""Control mode by its code (bits 7..5)."""

REACHED, OPEN_END, CLOSED_END, OVER_CURRENT = 0x10, 0x08, 0x04, 0x02


def _decode(raw: int) -> dict[str, Any]:
    code = raw >> 5
    com_error = code == WIRE.com_error_mode

    def flag(bit: int) -> bool | None:
        return None if com_error else bool(raw & bit)

    return {
        "raw": raw,
        "mode": MODES[code],
        "mode_code": code,
        "target_reached": flag(REACHED),
        "fully_open": flag(OPEN_END),
        "fully_closed": flag(CLOSED_END),
        "over_current": flag(OVER_CURRENT),
        "moving": flag(WIRE.moving_bit),
        "com_error": com_error,
    }


_DECODED = tuple(_decode(raw) for raw in range(256))


def decode_status(motor: int, raw: int) -> dict[str, Any]:
    """Status of `motor` from its STATUS byte.

    Keys: motor, raw, mode (text), mode_code, target_reached, fully_open, fully_closed,
    over_current, moving, com_error. With `com_error` the five flags are None (W27).
    """
    return {"motor": motor, **_DECODED[raw]}


def at_rest(raw: int) -> bool:
    """True if a motor with this STATUS byte stays as it is: switched off, or at its target position."""
    mode = MODES[raw >> 5]
    return mode == "stop" or (mode == "position" and bool(raw & REACHED) and not raw & WIRE.moving_bit)


def describe_status(raw: int) -> str:
    """One STATUS byte as text, for traces."""
    status = _DECODED[raw]
    words = [status["mode"]]
    if not status["com_error"]:
        words += [
            name.replace("_", " ")
            for name in ("target_reached", "fully_open", "fully_closed", "over_current", "moving")
            if status[name]
        ]
    return ", ".join(words)
