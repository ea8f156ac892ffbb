"""Reason codes of the hand, for programs."""

from __future__ import annotations

from enum import IntEnum


class Reason(IntEnum):
    """The numbers of coglab_msgs/ReasonCode that the hand uses, copied so that the driver needs no ROS."""

    NONE = 0
    INVALID_ARGUMENT = 100
    OUT_OF_RANGE = 101
    UNKNOWN_NAME = 102
    NOT_SUPPORTED = 110
    STOPPING = 205
    DRIVE_ERROR = 208
    CANCELLED = 400
    SUPERSEDED = 402
    TIME_LIMIT = 408
    HAND_LINK_LOST = 500
    HAND_NOT_CALIBRATED = 501
    HAND_CALIBRATING = 502
    HAND_STALLED = 504
    HAND_REFUSED = 505
    HAND_STARTED = 506
    HAND_ENDED = 507
    HAND_MOVING = 508
    UNEXPECTED = 699


NEUTRAL = (Reason.NONE, Reason.HAND_STARTED, Reason.HAND_ENDED, Reason.HAND_MOVING)
"""Codes that are not failures."""

BROKEN = (Reason.DRIVE_ERROR, Reason.TIME_LIMIT, Reason.HAND_LINK_LOST, Reason.HAND_STALLED, Reason.UNEXPECTED)
"""Failures of the hand or the line, but not of a request."""


def reason_of(error: Exception) -> Reason:
    """Reason code of an error of this package."""
    unknown = Reason.INVALID_ARGUMENT if isinstance(error, ValueError) else Reason.UNEXPECTED
    return getattr(error, "reason", unknown)
