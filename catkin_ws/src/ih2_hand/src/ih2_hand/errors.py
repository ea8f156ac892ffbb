"""What can go wrong between host and hand, one class per thing the caller can do about it."""

from __future__ import annotations

from ih2_hand.reasons import Reason


class HandError(Exception):
    """Base of every error of the hand; `reason` says what it means."""

    reason = Reason.UNEXPECTED


class RefusedError(ValueError):
    """A request that cannot be taken as it is; nothing was sent."""

    def __init__(self, message: str, reason: Reason):
        super().__init__(message)
        self.reason = reason


class HandPortError(HandError):
    """The port cannot be opened: it does not exist, is not permitted, is busy, or is ambiguous."""

    reason = Reason.HAND_LINK_LOST


class HandConnectionLost(HandError):
    """The port was open and is gone: cable pulled, adapter reset, peer closed."""

    reason = Reason.HAND_LINK_LOST


class HandTimeoutError(HandError):
    """No complete answer, neither at once nor after one resynchronisation and one retry."""

    reason = Reason.HAND_LINK_LOST


class HandInconsistentError(HandError):
    """Repeated readings of one value contradict each other: the line is disturbed."""

    reason = Reason.HAND_LINK_LOST


class HandCalibratingError(HandError):
    """The hand calibrates and discards every request meanwhile."""

    reason = Reason.HAND_CALIBRATING


class HandCalibrationError(HandError):
    """The calibration did not end in time, or not in the state it must end in (`reason`)."""

    def __init__(self, message: str, reason: Reason):
        super().__init__(message)
        self.reason = reason


class NoForceSensorError(HandError, ValueError):
    """Motor 0 (thumb abduction) has no tension sensor: neither set nor read its force."""

    reason = Reason.NOT_SUPPORTED


class NoGraspModeError(HandError):
    """grasp_mode_close before set_grasp_mode: there is nothing to close to."""

    reason = Reason.HAND_REFUSED
