"""Trace of every byte between host and hand as text: time, direction, hex, meaning."""

from __future__ import annotations

from ih2_hand import frames
from ih2_hand.emulator.parser import FrameParser
from ih2_hand.status import describe_status
from ih2_hand.wire_choices import WIRE

_NAMES = {
    frames.STOP_ALL: "StopALL",
    frames.FIRST_CALIBRATION: "FirstCalibration (complete)",
    frames.FAST_CALIBRATION: "FastCalibration",
    frames.OPEN_ALL: "OpenALL",
}


def describe_frame(frame: bytes) -> str:
    """Meaning of one complete frame from the host to the hand."""
    first = frame[0]
    if first in _NAMES:
        return _NAMES[first]
    if first < 0x40:
        return f"GetFingerForce motor {first & 0x0F}"
    if first >= 0x80:
        way = "close" if first & 0x40 else "open"
        return f"MoveMotor motor {first >> 2 & 0x0F} {way} speed {(first & 1) << 8 | frame[1]}"
    if first in (frames.GET_POSITION, frames.GET_CURRENT, frames.GET_STATUS):
        name = {
            frames.GET_POSITION: "GetFingerPosition",
            frames.GET_CURRENT: "GetMotorCurrent",
            frames.GET_STATUS: "GetFingerStatus",
        }[first]
        return f"{name} motor {frame[1] & 0x0F}"
    if first == frames.SET_POSITION:
        return f"SetFingerPosition motor {frame[1] & 0x0F} to {frame[2]}"
    if first == frames.SET_TENSION:
        return f"SetFingerForce motor {frame[1] & 0x0F} tension {(frame[1] >> 6) << 8 | frame[2]}"
    if first == frames.SET_POSTURE:
        return f"SetHandPosture {list(frame[1:-1])}"
    if first in frames.LEGACY_GRASPS:
        mode, level, is_current = frames.LEGACY_GRASPS[first]
        return f"grasp {mode} {level} by {'current' if is_current else 'tension'}"
    if first == frames.GRASP_V17:
        return f"grasp type {frame[1]} GF {frame[2]} step {frame[3]}"
    if first in frames.MEM_PRESHAPE:
        return f"MemPreShape {frames.MEM_PRESHAPE[first]} {list(frame[1:-1])}"
    if first in frames.MEM_TENSION or first in frames.MEM_CURRENT:
        return f"Mem force levels {frame[1:-1].hex(' ')}"
    return f"LLMC command {frame[2]:02x} motor {frame[1] & 0x0F} data {frame[3:-1].hex(' ') or 'none'}"


def describe_answer(frame: bytes, answer: bytes) -> str:
    """Meaning of the hand's complete answer to `frame`."""
    first = frame[0]
    if first == frames.GET_STATUS or (first == frames.LLMC and frame[2] == 0x70):
        return f"status: {describe_status(answer[0])}"
    if first == frames.GET_POSITION:
        return f"position {answer[0]}"
    if first == frames.GET_CURRENT:
        return f"current {int.from_bytes(answer, 'big')} counts"
    if first < 0x40:
        return f"tension {int.from_bytes(answer, 'big')} counts"
    return f"value {int.from_bytes(answer, 'big')}"


class Tracer:
    """Converts the bytes of both directions to lines of text. Handles incomplete frames and late answers."""

    def __init__(self) -> None:
        self._parser = FrameParser("both")
        self._asked: list[bytes] = []
        self._answer = b""

    def feed(self, direction: str, data: bytes, stamp: float) -> list[str]:
        """Lines for bytes seen at `stamp` (s). Direction ">" is to the hand, "<" is from the hand."""
        lines = self._to_hand(data) if direction == ">" else self._to_host(data)
        return [f"{stamp:14.6f} {direction} {shown.hex(' '):<20} {meaning}" for shown, meaning in lines]

    def _to_hand(self, data: bytes) -> list[tuple[bytes, str]]:
        # A late reader finds the frames before and after the filler in the same read.
        before, filler, after = data.partition(WIRE.resync_filler)
        if before and filler:
            return self._to_hand(before) + self._to_hand(filler + after)
        if not filler and data.count(frames.STOP_ALL) == len(data) > 1:
            filler, after = data, b""
        if filler:
            self._parser.clear()
            self._asked, self._answer = [], b""
            return [(filler, "StopALL as filler: resynchronisation"), *self._to_hand(after)]
        lines: list[tuple[bytes, str]] = []
        start = 0
        for end, byte in enumerate(data, 1):
            waited = self._parser.waiting
            frame = self._parser.feed(byte)
            if frame is not None:
                lines.append((frame, describe_frame(frame)))
                start = end
                if frames.reply_length(frame):
                    self._asked.append(frame)
            elif not self._parser.waiting:
                lines.append((waited + bytes((byte,)), "not a frame: dropped by the hand"))
                start = end
        if start < len(data):
            lines.append((data[start:], "incomplete frame: the hand waits for the rest"))
        return lines

    def _to_host(self, data: bytes) -> list[tuple[bytes, str]]:
        lines: list[tuple[bytes, str]] = []
        self._answer += data
        while self._answer and self._asked:
            length = frames.reply_length(self._asked[0])
            if len(self._answer) < length:
                lines.append((self._answer, "part of an answer"))
                return lines
            answer, self._answer = self._answer[:length], self._answer[length:]
            lines.append((answer, describe_answer(self._asked.pop(0), answer)))
        if self._answer:
            lines.append((self._answer, "bytes without a request"))
            self._answer = b""
        return lines
