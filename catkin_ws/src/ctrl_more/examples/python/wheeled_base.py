#!/usr/bin/env python3
"""Wheeled base: an own feedback controller in Python keeps a base on its circle while a wheel slips.

wheeled_base.py [--plot FILE]
python3 -m ctrl_more page wheeled_base.py:FollowPose    # the page of the controller, from describe()
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import ctrl_more
import numpy as np
import numpy.typing as npt
from plants import WheeledBase

LIST = Path(__file__).with_suffix(".yaml")
DT = 0.005  # s
SPEED = 0.5  # m/s, of the reference
TURN = 0.3  # rad/s, of the reference
SLIP = (0.0, 0.1)  # share of its speed that the right wheel loses


class FollowPose(ctrl_more.FeedbackController):
    """Corrects the twist of a base so that its pose follows the reference."""

    def describe(self) -> ctrl_more.Description:
        d = ctrl_more.Description(
            "Corrects the twist of a wheeled base so that it follows its reference pose.",
            use="Write the pose into `measuredData` `odometry`, and references of pose and twist under the key `base`.",
            when="For a base with two driven wheels that does not move sideways, while it moves forward.",
            limitations="No integral action: a steady slip leaves a steady error. It cannot correct y at rest.",
            law=r"v' = v \cos e_\theta + k_x e_x,\ \omega' = \omega + v (k_y e_y + k_\theta \sin e_\theta)",
            source="Kanayama et al., A stable tracking control method for an autonomous mobile robot, ICRA 1990.",
        )
        d.measured("odometry", size=3, unit="m, rad", frame="world", max_age=0.1, text="x, y and heading")
        d.reads("taskSpaceReferencePose", "base", unit="m, 1", frame="world", text="reference pose")
        bounds = ctrl_more.CorrectionLimit(size=2.0, angle=4.0)  # m/s, rad/s
        d.modifies("taskSpaceReferenceVel", "base", unit="m/s, rad/s", frame="base", limit=bounds,
                   text="speed and turn are corrected")  # fmt: skip
        d.gain("k_x", 2.0, low=0.0, high=20.0, unit="1/s", text="rate along the base")
        d.gain("k_y", 8.0, low=0.0, high=100.0, unit="1/m^2", text="turn per error across the base")
        d.gain("k_heading", 4.0, low=0.0, high=50.0, unit="1/m", text="turn per error of the heading")
        return d

    def initialize(self, setup: ctrl_more.Setup) -> None:
        self.odometry = setup.read("odometry")
        self.pose = setup.reference("taskSpaceReferencePose/base")
        self.twist = setup.modify("taskSpaceReferenceVel/base")
        self.k_x, self.k_y, self.k_heading = (setup.gain(name) for name in ("k_x", "k_y", "k_heading"))

    def update(
        self,
        cycle: ctrl_more.Cycle,
        robot: ctrl_more.RobotView,
        original: ctrl_more.ControlView,
        modified: ctrl_more.ModifiedControlStates,
    ) -> None:
        x, y, heading = robot.view(self.odometry)
        pose, twist = original.view(self.pose), modified[self.twist]
        ahead, left = pose[0] - x, pose[1] - y
        e_x = math.cos(heading) * ahead + math.sin(heading) * left
        e_y = -math.sin(heading) * ahead + math.cos(heading) * left
        e_heading = 2.0 * math.atan2(pose[5], pose[6]) - heading  # sine and cosine need no wrapping
        v = twist[0]
        twist[0] = v * math.cos(e_heading) + self.scalar(self.k_x) * e_x
        twist[5] += v * (self.scalar(self.k_y) * e_y + self.scalar(self.k_heading) * math.sin(e_heading))


def run(enabled: bool) -> npt.NDArray[np.float64]:
    """Drive along the circle for 20 s. Returns rows of t (s), reference x, y and base x, y (m)."""
    base, rows = WheeledBase((0.0, -0.3, 0.0), slip=SLIP), []
    robot, control = ctrl_more.RobotStates(), ctrl_more.ControlStates(period=DT)
    manager = ctrl_more.FeedbackControllersManager(robot, control)
    manager.load(LIST)
    if enabled:
        manager.enable("follow")
    for number in range(1, round(20.0 / DT) + 1):
        t = number * DT
        now_ns, heading, radius = round(t * 1e9), TURN * t, SPEED / TURN
        x, y = radius * math.sin(heading), radius * (1.0 - math.cos(heading))
        robot.set_measured_data("odometry", base.pose, now_ns)
        control.set_task_space_reference_pose("base", [x, y, 0, 0, 0, math.sin(heading / 2), math.cos(heading / 2)])
        control.set_task_space_reference_vel("base", [SPEED, 0, 0, 0, 0, TURN])
        manager.update(ctrl_more.Cycle(now_ns, DT, number))
        base.step(control.get_task_space_reference_vel("base")[[0, 5]], DT)
        rows.append((t, x, y, *base.pose[:2]))
    return np.array(rows)


def plot(runs: dict[str, npt.NDArray[np.float64]], file: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4.2), layout="constrained")
    paths, errors = figure.subplots(1, 2)
    for (name, one), colour in zip(runs.items(), ("C3", "C0"), strict=True):
        paths.plot(one[:, 3], one[:, 4], colour, label=name)
        errors.semilogy(one[:, 0], np.hypot(*(one[:, 3:] - one[:, 1:3]).T), colour)
    paths.plot(one[:, 1], one[:, 2], "k--", lw=1, label="reference")
    paths.set(title="Way of the base", xlabel="x [m]", ylabel="y [m]", aspect="equal")
    errors.set(title="Distance to the reference", xlabel="time [s]", ylabel="[m]")
    paths.legend(fontsize=8)
    figure.savefig(file, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plot", type=Path, metavar="FILE", help="write a figure, such as base.png")
    options = parser.parse_args()
    runs = {"without feedback": run(False), "with FollowPose": run(True)}
    for name, one in runs.items():
        away = np.hypot(*(one[-1, 3:] - one[-1, 1:3]))
        print(f"{name}: {away:.3f} m from the reference after {one[-1, 0]:.0f} s")
    if options.plot:
        plot(runs, options.plot)


if __name__ == "__main__":
    main()
