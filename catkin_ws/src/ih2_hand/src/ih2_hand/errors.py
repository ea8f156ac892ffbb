"""What can go wrong between host and hand, one class per thing the caller can do about it."""

from __future__ import annotations


class HandError(Exception):
    """Base of every error of the hand."""


class HandPortError(HandError):
    """The port cannot be opened: it does not exist, is not permitted, is busy, or is ambiguous."""


class HandConnectionLost(HandError):
    """The port was open and is gone: cable pulled, adapter reset, peer closed."""


class HandTimeoutError(HandError):
    """No complete answer, neither at once nor after one resynchronisation and one retry."""


class HandInconsistentError(HandError):
    """Repeated readings of one value contradict each other: the line is disturbed."""


class HandCalibratingError(HandError):
    """The hand calibrates and discards every request meanwhile."""


class HandCalibrationError(HandError):
    """The calibration did not end in time, or not in the state it must end in."""


class NoForceSensorError(HandError, ValueError):
    """Motor 0 (thumb abduction) has no tension sensor: neither set nor read its force."""


class NoGraspModeError(HandError):
    """grasp_mode_close before set_grasp_mode: there is nothing to close to."""
