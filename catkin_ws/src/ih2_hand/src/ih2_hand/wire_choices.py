"""The open points of the IH2 wire protocol: one table for driver and emulator.

The vendor's IH2 guide is not public. The table is based on the EH1 guide of 2013 (a related hand with
the same board family) and on the common parts of published IH2 drivers. Each row is one decision. A
laboratory that has the guide, or a hand, corrects the row only here. `WIRE.<name>` is the value.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

GUIDE = "EH1 guide 2013"
DRIVERS = "published IH2 drivers"
GUESS = "guess"


@dataclass(frozen=True)
class Choice:
    """One row: `id` W1..W30, `name` of the value, the value, the open point, its basis, the risk if it is wrong."""

    id: str
    name: str
    value: Any
    point: str
    basis: str
    if_wrong: str


TABLE: tuple[Choice, ...] = (
    Choice(
        "W1",
        "dialect",
        "legacy",
        "grasp commands: one byte each (legacy) or 6F frames (v17)",
        f"{GUIDE}; newer {DRIVERS}",
        "grasps do nothing, or 6F arguments run as commands",
    ),
    Choice(
        "W2", "motors", 5, "number of motors; posture frames carry one byte for each", DRIVERS, "the whole stream slips"
    ),
    Choice(
        "W3",
        "moving_bit",
        0x01,
        "STATUS bit 0: 1 while moving; reported, never decided upon",
        f"{DRIVERS}; unused in the {GUIDE}",
        "only the field `moving` is wrong",
    ),
    Choice(
        "W4",
        "position_max",
        254,
        "largest position sent; readings are cut to it",
        "D4.10 range; 255 reads back as 0 on a real EH1",
        "one count is never commanded",
    ),
    Choice(
        "W5",
        "force_scale",
        4,
        "D4.10 force 0..254 times this is the wire's tension 0..1023",
        GUIDE,
        "forces off by this factor: check first on a real hand, low settings first",
    ),
    Choice("W6", "unsensed_motor", 0, "motor without tension sensor: refused before any byte", GUIDE, "one time-out"),
    Choice(
        "W6", "unsensed_force_reply", b"\x00\x00", "emulator's answer to byte 00 unless strict", DRIVERS, "one time-out"
    ),
    Choice(
        "W7", "wrong_motor_silent", True, "frame for a motor above 4: consumed, not answered", GUESS, "one time-out"
    ),
    Choice(
        "W8",
        "bad_closing_drops_frame",
        True,
        "wrong closing byte: the whole frame is dropped",
        GUIDE,
        "the stream slips by less than one frame",
    ),
    Choice("W9", "unknown_byte_drops_one", True, "unknown first byte: dropped alone", GUIDE, "the stream slips"),
    Choice(
        "W10",
        "resync_filler",
        b"\x41" * 13,
        "StopALL, more often than any frame is long: completes whatever the hand waits for",
        f"the hand waits for ever for the rest of a frame ({GUIDE})",
        "the line stays out of step",
    ),
    Choice(
        "W10",
        "resync_wait_s",
        0.020,
        "silence after the filler before the input is flushed",
        GUESS,
        "stale answers survive the flush; they are caught at the next request",
    ),
    Choice(
        "W11",
        "calibration_poll_s",
        0.100,
        "period of the 4B 02 polls that find the end",
        DRIVERS,
        "the end is noticed later",
    ),
    Choice("W11", "calibration_poll_motor", 2, "motor polled to find the end of a calibration", DRIVERS, "none"),
    Choice(
        "W12",
        "calibration_fast_s",
        1.5,
        "duration of the fast calibration in the emulator",
        f"{DRIVERS} wait 2.0 s and then send: it ends before",
        "only simulated times",
    ),
    Choice(
        "W12",
        "calibration_complete_s",
        10.0,
        "duration of the complete calibration, emulator",
        GUESS,
        "only simulated times",
    ),
    Choice(
        "W12",
        "calibration_fast_limit_s",
        10.0,
        "longest wait for the fast calibration",
        GUESS,
        "a slow hand is reported as not calibrated",
    ),
    Choice(
        "W12",
        "calibration_complete_limit_s",
        90.0,
        "longest wait for the complete one",
        f"60 s seen in {DRIVERS}",
        "a slow hand is reported as not calibrated",
    ),
    Choice(
        "W13",
        "status_after_calibration",
        0x08,
        "all positions 0, stopped, open end sensor on",
        GUIDE,
        "the end check of the calibration refuses a good one",
    ),
    Choice(
        "W14",
        "uncalibrated_ignores_positions",
        True,
        "before a calibration the hand ignores position writes and grasps, reads are answered",
        GUIDE,
        "an uncalibrated hand moves to wrong positions",
    ),
    Choice(
        "W15",
        "full_stroke_s",
        1.0,
        "255 counts at speed 511; linear in speed (emulator)",
        GUESS,
        "only simulated times",
    ),
    Choice(
        "W15", "position_speed", 511, "speed of position and posture moves (emulator)", GUESS, "only simulated times"
    ),
    Choice(
        "W16",
        "reached_counts",
        4,
        "bit 4 is set within this many counts of the target",
        "read-backs of a real EH1",
        "a move is reported done earlier or later",
    ),
    Choice(
        "W17",
        "stop_at_end",
        True,
        "a speed move into an end sensor ends in mode STOP",
        GUIDE,
        "hand_open and hand_close end by their stall rule instead",
    ),
    Choice("W18", "speed_max", 511, "speed argument 0..511, nine bits", GUIDE, "none"),
    Choice("W19", "move_dont_care_bit", 0, "bit 1 of MoveMotor's first byte: sent as 0", GUIDE, "none"),
    Choice(
        "W20",
        "close_direction",
        1,
        "direction bit: 1 closes",
        f"{GUIDE}; {DRIVERS}",
        "fingers move the wrong way: check first, at low speed",
    ),
    Choice(
        "W21",
        "send_preshape",
        True,
        "set_grasp_mode sends the mode's preshape of grasps.yaml as a posture",
        "D4.10: the hand gets pre-shaped while the arm moves",
        "the posture differs from the hand's stored one",
    ),
    Choice(
        "W22",
        "legacy_grasps",
        {
            # (mode, level): (current byte, tension byte)
            ("cylindrical", "low"): (0x60, 0x50),
            ("cylindrical", "medium"): (0x61, 0x51),
            ("cylindrical", "high"): (0x62, 0x52),
            ("lateral", "high"): (0x63, 0x53),
            ("tridigit", "low"): (0x64, 0x54),
            ("tridigit", "medium"): (0x65, 0x55),
            ("tridigit", "high"): (0x66, 0x56),
            ("bidigit", "low"): (0x67, 0x57),
            ("bidigit2", "low"): (0x69, 0x68),
            ("tridigit2", "low"): (0x71, 0x70),
        },
        "one-byte grasps that exist; a missing pair is refused, naming the levels of the mode",
        GUIDE,
        "a grasp closes with another force",
    ),
    Choice(
        "W23",
        "v17_types",
        {"lateral": 1, "bidigit": 2, "tridigit": 3, "cylindrical": 4, "bidigit2": 21, "tridigit2": 31},
        "grasp type of the 6F frame",
        f"newer {DRIVERS}",
        "another grasp is taken",
    ),
    Choice(
        "W23",
        "v17_force",
        {"low": 80, "medium": 140, "high": 200},
        "GF of the 6F frame by level",
        GUESS,
        "grip force off: low first",
    ),
    Choice("W23", "v17_step", 20, "step of the 6F frame, unit unknown", DRIVERS, "closing pace"),
    Choice(
        "W24",
        "llmc_reading_bytes",
        2,
        "reply length of LLMC 42 and 62 (2 or 3)",
        f"{GUIDE}, which contradicts itself",
        "emulator only: the driver never sends them",
    ),
    Choice(
        "W25",
        "mem_current_length",
        10,
        "MemHigh/Med/LowCurr frame",
        f"{GUIDE}, deduced",
        "emulator only: the driver never sends them",
    ),
    Choice(
        "W25", "mem_tension_length", 6, "MemHigh/Med/LowTens frame", GUIDE, "emulator only: the driver never sends them"
    ),
    Choice(
        "W26",
        "open_all_motors",
        (1, 2, 3, 4),
        "OpenALL leaves motor 0 alone",
        f"{GUIDE}; {DRIVERS}",
        "the thumb moves sideways",
    ),
    Choice(
        "W27",
        "com_error_mode",
        0b111,
        "mode 111: internal bus error, other flags mean nothing",
        GUIDE,
        "flags of a failing motor are believed",
    ),
    Choice(
        "W28",
        "streaming",
        False,
        "streamed readings: their bytes are not public; not used",
        "a catalogue's note",
        "none",
    ),
    Choice(
        "W29",
        "grip_held_after_stop",
        True,
        "after StopALL the fingers keep their place and with it the grip (no back-driving)",
        GUESS,
        "a stop, or a resynchronisation, lets the object go",
    ),
    Choice(
        "W30",
        "relax_speed",
        255,
        "grasp type 0 of the 6F frame, relax: the flexion motors unwind at this speed until the "
        "fingers are open (emulator)",
        f"named in newer {DRIVERS}; {GUESS}",
        "only simulated times",
    ),
    Choice(
        "-",
        "baud",
        115200,
        "8 data bits, no parity, 1 stop bit, no flow control",
        f"{GUIDE}; {DRIVERS}",
        "nothing is understood",
    ),
    Choice(
        "-", "posture_spacing_s", 0.003, "the hand needs this long to execute a posture", GUIDE, "a command is lost"
    ),
    Choice(
        "-",
        "read_timeout_s",
        0.050,
        "longest wait for an answer (the hand takes 1 ms)",
        GUIDE,
        "slow USB adapters cause retries",
    ),
)

WIRE = SimpleNamespace(**{choice.name: choice.value for choice in TABLE})
"""Values of the table by name."""


def as_markdown() -> str:
    """The table as Markdown, as in the README."""
    lines = ["| id | value of `WIRE.` | value | point | rests on | if wrong |", "| --- | --- | --- | --- | --- | --- |"]
    for row in TABLE:
        if isinstance(row.value, bytes):
            short = len(row.value) < 4
            value = row.value.hex(" ") if short else f"{row.value[0]:02x} x {len(row.value)}"
        elif isinstance(row.value, dict):
            value = f"{len(row.value)} entries"
        else:
            value = str(row.value)
        lines.append(f"| {row.id} | `{row.name}` | {value} | {row.point} | {row.basis} | {row.if_wrong} |")
    return "\n".join(lines)
