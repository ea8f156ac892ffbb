"""The limits in force at the controller manager, from its parameters, as it reads them itself at its start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import coglab_controllers as cc
import numpy as np
from coglab_py.packages import package_path

from coglab_smach.kinematics.motion_time import MotionLimits


def read_limits(parameters: Mapping[str, Any]) -> MotionLimits:
    """From the parameters below /controller_manager; what is not there has the manager's own default."""
    table = str(parameters.get("joint_limits_file") or package_path("lwr_description", "config", "joint_limits.yaml"))
    limits = cc.load_joint_limits(table, str(parameters.get("joint_limits_profile", "default")))
    velocity = np.asarray(parameters.get("joint_vel_limit", limits.velocity), dtype=float)
    acceleration = np.asarray(limits.acceleration, dtype=float)
    ptp = dict(parameters.get("ptp", {}))
    speeds = [float(parameters.get(name, 1.0)) for name in ("hand_speed_limit", "elbow_speed_limit")]
    return MotionLimits(
        tuple(velocity),
        tuple(acceleration),
        tuple(float(ptp.get("default_speed", 0.3)) * velocity),
        tuple(float(ptp.get("default_acceleration", 0.2)) * acceleration),
        min((v for v in speeds if v > 0.0), default=float("inf")),
    )
