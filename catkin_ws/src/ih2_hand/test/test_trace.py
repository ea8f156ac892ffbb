"""The trace: every frame in hex with its meaning."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from ih2_hand.trace import Tracer


def said(tracer: Tracer, direction: str, text: str) -> list[str]:
    return [line[17:] for line in tracer.feed(direction, bytes.fromhex(text), 1.0)]


@pytest.mark.parametrize(
    ("frame", "meaning"),
    [
        ("41", "StopALL"),
        ("44 04 64", "SetFingerPosition motor 4 to 100"),
        ("C9 2C", "MoveMotor motor 2 close speed 300"),
        ("4A 84 00", "SetFingerForce motor 4 tension 512"),
        ("48 00 1E FE C8 64 48", "SetHandPosture [0, 30, 254, 200, 100]"),
        ("61", "grasp cylindrical medium by current"),
        ("6F 04 C8 14", "grasp type 4 GF 200 step 20"),
        ("4B 02", "GetFingerStatus motor 2"),
        ("03", "GetFingerForce motor 3"),
        ("5F 03 61 00 64 03", "LLMC command 61 motor 3 data 00 64"),
        ("59 0A 14 1E 28 32 59", "MemPreShape lateral [10, 20, 30, 40, 50]"),
        ("5C 01 02 03 04 5C", "Mem force levels 01 02 03 04"),
        ("48 00 1E FE C8 64 49", "not a frame: dropped by the hand"),
        ("44 02", "incomplete frame"),
        ("41 41", "resynchronisation"),
    ],
)
def test_frames(frame, meaning):
    lines = said(Tracer(), ">", frame)
    assert len(lines) == 1
    assert lines[0].startswith(frame.strip().lower())
    assert meaning in lines[0]


@pytest.mark.parametrize(
    ("request_hex", "answer", "meaning"),
    [
        ("5F 01 70 01", "08", "status: stop, fully open"),
        ("5F 02 22 02", "00 01 90", "value 400"),
        ("03", "01 02", "tension 258 counts"),
    ],
)
def test_what_an_answer_means_depends_on_the_request(request_hex, answer, meaning):
    tracer = Tracer()
    said(tracer, ">", request_hex)
    (line,) = said(tracer, "<", answer)
    assert line.endswith(f" {meaning}") and line.startswith(answer.lower())


def test_answer_in_two_pieces_is_traced_when_complete():
    tracer = Tracer()
    said(tracer, ">", "49 02")
    assert "part" in said(tracer, "<", "03")[0]
    assert "current 980 counts" in said(tracer, "<", "D4")[0]


def test_requests_before_a_resynchronisation_expect_no_answer():
    tracer = Tracer()
    said(tracer, ">", "49 02")
    said(tracer, "<", "03")
    said(tracer, ">", "44 02")
    said(tracer, ">", "41 " * 13)
    assert "StopALL" in said(tracer, ">", "41")[0]
    assert "request" in said(tracer, "<", "D4")[0]


def test_a_filler_read_with_other_frames_is_named():
    """A late emulator reads all that waits at once."""
    meanings = ["motor 1", "incomplete frame", "resynchronisation", "GetFingerStatus motor 0"]
    lines = said(Tracer(), ">", "4B 01 44 02" + " 41" * 13 + " 4B 00")
    assert len(lines) == 4 and all(meaning in line for meaning, line in zip(meanings, lines, strict=True))


def test_script_explains_hex():
    script = Path(__file__).resolve().parents[1] / "scripts" / "hand_trace.py"
    done = subprocess.run(
        [sys.executable, str(script), "--hex", "44 04 64 61"], capture_output=True, text=True, timeout=600, check=True
    )
    assert "SetFingerPosition motor 4 to 100" in done.stdout
    assert "grasp cylindrical medium" in done.stdout
    bad = subprocess.run(
        [sys.executable, str(script), "--hex", "4"], capture_output=True, text=True, timeout=600, check=False
    )
    assert bad.returncode == 2 and "hex" in bad.stderr
