"""Divides the bytes that arrive at the hand into frames, without a time limit, like the firmware."""

from __future__ import annotations

from dataclasses import dataclass, field

from ih2_hand import frames

DIALECTS = {"both": ("legacy", "v17"), "legacy": ("legacy",), "v17": ("v17",)}
"""Grasp dialects accepted with each setting."""


@dataclass
class ParserCounters:
    """Frames and errors that the parser counted."""

    frames: int = 0
    unknown: int = 0
    bad_closing: int = 0


@dataclass
class FrameParser:
    """Collects bytes and returns complete frames for execution.

    An unknown first byte is dropped alone (W9). A frame with a wrong closing byte is dropped as a whole
    (W8). An incomplete frame is waited for without a time limit (W10).
    """

    dialect: str = "both"
    counters: ParserCounters = field(default_factory=ParserCounters)
    _waiting: bytearray = field(default_factory=bytearray)

    def __post_init__(self) -> None:
        if self.dialect not in DIALECTS:
            raise ValueError(f"dialect must be one of {', '.join(DIALECTS)}; got {self.dialect!r}")

    @property
    def waiting(self) -> bytes:
        """Bytes of an incomplete frame."""
        return bytes(self._waiting)

    def clear(self) -> None:
        """Discard an incomplete frame (power cycle)."""
        self._waiting.clear()

    def feed(self, byte: int) -> bytes | None:
        """Process one byte. Returns the frame to execute if the byte completes one, else None."""
        waiting = self._waiting
        waiting.append(byte)
        dialects = DIALECTS[self.dialect]
        length = frames.frame_length(waiting, v17="v17" in dialects)
        if length is None or len(waiting) < length:
            return None
        frame = bytes(waiting)
        waiting.clear()
        if not frames.is_known(frame[0], dialects):
            self.counters.unknown += 1
            return None
        if not _closed_well(frame):
            self.counters.bad_closing += 1
            return None
        self.counters.frames += 1
        return frame


def _closed_well(frame: bytes) -> bool:
    first = frame[0]
    if first == frames.LLMC:
        return frame[1] == frame[-1]
    if (
        first == frames.SET_POSTURE
        or first in frames.MEM_PRESHAPE
        or first in frames.MEM_TENSION
        or first in frames.MEM_CURRENT
    ):
        return frame[-1] == first
    return True
