"""How long frames and answers are, and which frames the hand drops."""

from __future__ import annotations

import pytest
from ih2_hand import frames
from ih2_hand.clock import SteppedClock
from ih2_hand.emulator.hand import EmulatedHand
from ih2_hand.emulator.parser import FrameParser

# Bytes of an answer by its request, typed here a second time.
REPLIES = (
    {"00": 2, "03": 2, "33": 2, "45 02": 1, "49 02": 2, "4B 02": 1}
    | {"41": 0, "42": 0, "44 02 64": 0, "4A 02 64": 0, "C9 2C": 0, "61": 0, "6F 04 C8 14": 0}
    | {f"5F 02 {command} 02": 0 for command in ("71", "21", "31", "23", "41", "43", "61", "63", "66", "7F")}
    | {"5F 02 70 02": 1, "5F 02 76 02": 2, "5F 02 77 02": 2, "5F 02 22 02": 3, "5F 02 42 02": 2, "5F 02 62 02": 2}
    | {"5F 02 25 02": 4, "5F 02 45 02": 4, "5F 02 65 02": 4}
)


@pytest.mark.parametrize("frame", REPLIES)
def test_an_answer_is_as_long_as_the_host_expects(frame):
    assert frames.reply_length(bytes.fromhex(frame)) == REPLIES[frame]
    hand = EmulatedHand(SteppedClock(), greeting=True)
    answers = [answer for _, answer in hand.receive(bytes.fromhex(frame))]
    assert len(b"".join(answers)) == REPLIES[frame]


# Frames that repeat their first byte at the end, and how many bytes lie between.
CLOSED = {0x48: 5} | dict.fromkeys(frames.MEM_PRESHAPE, 5) | dict.fromkeys((0x5C, 0x5D, 0x5E), 4)
CLOSED |= dict.fromkeys((0x6C, 0x6D, 0x6E), 8)


@pytest.mark.parametrize("first", CLOSED)
def test_a_frame_counts_only_with_its_closing_byte(first):
    parser = FrameParser()
    whole = bytes((first, *[1] * CLOSED[first], first))
    for frame in (whole, whole[:-1] + b"\x01", whole):
        given = [parser.feed(byte) for byte in frame]
        assert given == [None] * (len(frame) - 1) + [frame if frame == whole else None]
    counters = parser.counters
    assert (counters.frames, counters.bad_closing, counters.unknown) == (2, 1, 0)
    assert parser.waiting == b""


@pytest.mark.parametrize(
    ("dialects", "known"), [(("legacy",), {0x61}), (("v17",), {0x6F}), (("legacy", "v17"), {0x61, 0x6F})]
)
def test_a_grasp_is_known_in_its_dialect(dialects, known):
    assert {first for first in (0x61, 0x6F) if frames.is_known(first, dialects)} == known


def test_no_length_is_told_before_it_can_be():
    assert frames.frame_length(b"") is None
    assert frames.frame_length(b"\x5f\x02") is None
    assert frames.frame_length(b"\x5f\x02\x7f") == 4
    assert (frames.frame_length(b"\x6f"), frames.frame_length(b"\x6f", v17=False)) == (4, 1)


def test_a_hand_of_an_unknown_dialect_is_refused():
    with pytest.raises(ValueError, match="dialect must be one of both, legacy, v17"):
        FrameParser("v18")


def test_a_power_cycle_forgets_half_a_frame():
    parser = FrameParser()
    parser.feed(0x45)
    assert parser.waiting == b"\x45"
    parser.clear()
    assert parser.waiting == b"" and parser.feed(0x41) == b"\x41"
