"""Errors between host and hand. Each class needs another reaction of the caller."""

from __future__ import annotations

from ih2_hand.reasons import Reason


class HandError(Exception):
    """Base of every error of the hand; `reason` is its code."""

    reason = Reason.UNEXPECTED


class RefusedError(ValueError):
    """A request that is not accepted; nothing was sent."""

    def __init__(self, message: str, reason: Reason):
        super().__init__(message)
        self.reason = reason


class HandPortError(HandError):
    """The port cannot be opened: it does not exist, access is denied, it is busy, or it is ambiguous."""

    reason = Reason.HAND_LINK_LOST


class HandConnectionLost(HandError):
    """The port was open and is lost: cable pulled, adapter reset, or peer closed."""

    reason = Reason.HAND_LINK_LOST


class HandTimeoutError(HandError):
    """No complete answer, not even after one resynchronisation and one retry."""

    reason = Reason.HAND_LINK_LOST


class HandInconsistentError(HandError):
    """Repeated readings of one value contradict each other: the line is disturbed."""

    reason = Reason.HAND_LINK_LOST


class HandCalibratingError(HandError):
    """The hand calibrates and discards every request until the end."""

    reason = Reason.HAND_CALIBRATING


class HandCalibrationError(HandError):
    """The calibration did not end in time, or ended in a wrong state (`reason`)."""

    def __init__(self, message: str, reason: Reason):
        super().__init__(message)
        self.reason = reason


class NoForceSensorError(HandError, ValueError):
    """Motor 0 (thumb abduction) has no tension sensor: its force can neither be set nor read."""

    reason = Reason.NOT_SUPPORTED


class NoGraspModeError(HandError):
    """grasp_mode_close was called before set_grasp_mode."""

    reason = Reason.HAND_REFUSED
