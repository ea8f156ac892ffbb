#!/usr/bin/env python3
"""User code of the Ctrl-MORE paper, section VI-A: corrects the pelvis orientation by IMU data."""

import sys
from pathlib import Path

import numpy as np
from ctrl_more import CentralModule, ControlStates, RobotStates


def main() -> None:
    # Load controllers.
    default = Path(__file__).resolve().parent.parent / "central.yaml"
    locomotor = CentralModule(sys.argv[1] if len(sys.argv) > 1 else default)
    locomotor.feedbackControllers().enable("Attitude")

    # Encapsulate data in the robot states: roll, pitch, yaw; angular velocity; acceleration.
    robot_state, control_state = RobotStates(), ControlStates()
    robot_state.setMeasuredData("imu", np.array([0.1, -0.05, 0, 0, 0, 0, 0, 0, 9.81]), 0)

    # Apply the controllers.
    locomotor.update(robot_state, control_state)
    print(control_state.getPelvisOrientation())


if __name__ == "__main__":
    main()
