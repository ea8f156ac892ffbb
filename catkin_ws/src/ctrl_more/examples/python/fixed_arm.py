#!/usr/bin/env python3
"""Fixed arm: the hand yields at a wall (EeAdmittance), and the elbow stops before its limit (JointLimits).

The reference leads the hand 7 cm into the wall, and then so far back that the elbow would leave its range.
    fixed_arm.py [--plot FILE]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from ctrl_more import ControlStates, Cycle, FeedbackControllersManager, RobotStates
from plants import FixedArm

LIST = Path(__file__).with_suffix(".yaml")
DT = 0.005  # s
WALL = 0.65  # m
ELBOW_END = 1.6  # rad, as in fixed_arm_limits.yaml
PULL = 5.0  # 1/s, rate at which errors of the pose decay
# Reference of the hand along x: m at times in s. Between them it moves with minimum jerk.
WAY = ((0.0, 0.607), (2.0, 0.72), (3.0, 0.72), (5.0, 0.30), (7.0, 0.30))


def reference(t: float) -> tuple[float, float]:
    """Place in m and speed in m/s of the hand along x at `t` s."""
    for (begin, a), (end, b) in zip(WAY, WAY[1:], strict=False):
        if t <= end:
            s = (t - begin) / (end - begin)
            place = a + (b - a) * (10 * s**3 - 15 * s**4 + 6 * s**5)
            return place, (b - a) * (30 * s**2 - 60 * s**3 + 30 * s**4) / (end - begin)
    return WAY[-1][1], 0.0


def inverse_kinematics(arm: FixedArm, pose: npt.ArrayLike, twist: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Joint velocities [3] in rad/s toward a pose [7] without turn, with a twist [6]."""
    error = np.append(np.asarray(pose)[:2] - arm.pose[:2], -arm.joints.sum())
    planar = np.asarray(twist)[[0, 1, 5]] + PULL * error
    return np.asarray(np.linalg.solve(arm.jacobian, planar))


def run(enabled: Sequence[str]) -> dict[str, npt.NDArray[np.float64]]:
    """Move the arm with some of the controllers. Returns t, reference, x, force (N on the wall), elbow (rad)."""
    arm = FixedArm([0.3, 1.2, -1.5], wall_x=WALL)
    y = arm.pose[1]
    robot, control = RobotStates(), ControlStates(joints=3, period=DT)
    manager = FeedbackControllersManager(robot, control)
    manager.load(LIST)
    for name in enabled:
        manager.enable(name)

    rows = []
    for number in range(1, round(WAY[-1][0] / DT) + 1):
        now_ns = round(number * DT * 1e9)
        robot.set_measured_data("wrench", arm.wrench, now_ns)
        robot.set_measured_data("joint_position", arm.joints, now_ns)
        place, speed = reference(number * DT)
        control.set_task_space_reference_pose("ee", [place, y, 0, 0, 0, 0, 1])
        control.set_task_space_reference_vel("ee", [speed, 0, 0, 0, 0, 0])

        # Inverse kinematics runs between the two stages: EeAdmittance before it, JointLimits after it.
        manager.begin_cycle(Cycle(now_ns, DT, number))
        manager.update_stage("task")
        pose, twist = control.get_task_space_reference_pose("ee"), control.get_task_space_reference_vel("ee")
        control.set_joint_space_reference("Velocity", inverse_kinematics(arm, pose, twist))
        manager.update_stage("joint")
        manager.end_cycle()

        arm.step(control.get_joint_space_reference("Velocity"), DT)
        rows.append((number * DT, place, arm.pose[0], -arm.wrench[0], arm.joints[1]))
    return dict(zip(("t", "reference", "x", "force", "elbow"), np.array(rows).T, strict=True))


def plot(runs: dict[str, dict[str, npt.NDArray[np.float64]]], file: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.8), layout="constrained")
    places, forces, elbows = figure.subplots(1, 3)
    for (name, one), colour in zip(runs.items(), ("C3", "C0"), strict=True):
        places.plot(one["t"], one["x"], colour, label=name)
        forces.plot(one["t"], one["force"], colour)
        elbows.plot(one["t"], one["elbow"], colour)
    places.plot(one["t"], one["reference"], "k--", lw=1, label="reference")
    places.axhline(WALL, color="0.6", label="wall")
    elbows.axhline(ELBOW_END, color="0.6", label="end of its range")
    places.set(title="Hand", xlabel="time [s]", ylabel="x [m]")
    forces.set(title="Wall", xlabel="time [s]", ylabel="force [N]")
    elbows.set(title="Elbow", xlabel="time [s]", ylabel="angle [rad]")
    places.legend()
    elbows.legend()
    figure.savefig(file, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plot", type=Path, metavar="FILE", help="write a figure, such as arm.png")
    options = parser.parse_args()
    runs = {"without feedback": run([]), "with both controllers": run(["admittance", "limits"])}
    for name, one in runs.items():
        rest = one["force"][round(3.0 / DT) - 1]
        print(f"{name}: wall {one['force'].max():.0f} N at most, {rest:.0f} N at rest; "
              f"elbow up to {one['elbow'].max():.2f} rad of {ELBOW_END} rad")  # fmt: skip
    if options.plot:
        plot(runs, options.plot)


if __name__ == "__main__":
    main()
