"""Conversion of driver readings to ROS messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from coglab_msgs.msg import MotorStatus
from sensor_msgs.msg import JointState

JOINTS = (
    "ih2_thumb_abduction",
    "ih2_thumb_flexion",
    "ih2_index_flexion",
    "ih2_middle_flexion",
    "ih2_ring_little_flexion",
)
"""Joint of each motor in the URDF."""

JOINT_RANGES = (1.4, 1.5, 1.5, 1.5, 1.5)
"""Joint angle (rad) at position 254; 0 at position 0."""

FULL_SCALE = 254.0


def motor_status(reading: dict[str, Any]) -> MotorStatus:
    """MotorStatus from one reading of `HandSerialDriver.read_motors`."""
    return MotorStatus(
        motor=reading["motor"],
        raw=reading["raw"],
        mode=reading["mode"],
        mode_code=reading["mode_code"],
        target_reached=bool(reading["target_reached"]),
        fully_open=bool(reading["fully_open"]),
        fully_closed=bool(reading["fully_closed"]),
        over_current=bool(reading["over_current"]),
        moving=bool(reading["moving"]),
        com_error=reading["com_error"],
        position=reading["position"],
        force=reading["force"],
        current=reading["current"],
    )


def joint_state(readings: Sequence[dict[str, Any]], stamp: rospy.Time) -> JointState:
    """Angles (rad) of the hand's joints, proportional to the motor positions."""
    state = JointState(
        name=list(JOINTS),
        position=[reading["position"] / FULL_SCALE * JOINT_RANGES[reading["motor"]] for reading in readings],
    )
    state.header.stamp = stamp
    return state
