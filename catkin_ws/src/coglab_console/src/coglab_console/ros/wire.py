"""Frames read straight from the bytes of tf messages, which come often: a tenth of the time of a whole decoding.

Layout of ROS 1 serialisation: little-endian, strings and arrays preceded by a uint32 length.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

_U32 = struct.Struct("<I")
_STAMP = struct.Struct("<III")
_POSE = struct.Struct("<7d")
LONGEST_NAME = 256


class BadBytes(ValueError):
    """Not such a message."""


def _text(data: bytes, at: int) -> tuple[str, int]:
    (size,) = _U32.unpack_from(data, at)
    if size > LONGEST_NAME:
        raise BadBytes(f"a name of {size} bytes")
    return data[at + 4 : at + 4 + size].decode("utf-8", "replace"), at + 4 + size


def transforms(data: bytes) -> Iterator[tuple[str, str, float, tuple[float, ...]]]:
    """tf2_msgs/TFMessage: parent, child, stamp (s) and (x, y, z, qx, qy, qz, qw) of each. BadBytes if it is none."""
    try:
        (count,) = _U32.unpack_from(data, 0)
        at = 4
        for _ in range(count):
            _, seconds, nanoseconds = _STAMP.unpack_from(data, at)
            parent, at = _text(data, at + 12)
            child, at = _text(data, at)
            yield parent, child, seconds + nanoseconds * 1e-9, _POSE.unpack_from(data, at)
            at += 56
    except struct.error as error:
        raise BadBytes(str(error)) from error
