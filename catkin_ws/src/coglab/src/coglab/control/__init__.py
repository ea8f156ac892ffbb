"""Own motions and feedback controllers in Python."""

from coglab.control.motion import (
    Argument,
    ControlError,
    Motion,
    MotionCycle,
    MotionSetup,
    MotionStart,
    Reference,
    SetPoint,
)
from coglab.control.simulation import Simulated, simulate

__all__ = [
    "Argument",
    "ControlError",
    "Motion",
    "MotionCycle",
    "MotionSetup",
    "MotionStart",
    "Reference",
    "SetPoint",
    "Simulated",
    "simulate",
]
