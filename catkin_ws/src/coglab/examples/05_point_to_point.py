#!/usr/bin/python3
"""A point-to-point motion that begins while the arm still moves, through the bridge's interpolator."""

import coglab_controllers as cc
import numpy as np
from example import LIMITS, new_figure, parser, save

options = parser(__doc__).parse_args()
CYCLE = 0.005  # s
KP = 10.0  # 1/s, gain of the position error
limits = cc.load_joint_limits(str(LIMITS))
start = np.array([0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0])
velocity = np.array([0.5, -0.2, 0.0, 0.3, 0.0, 0.0, -0.6])
target = np.array([-0.6, 0.9, 0.4, -1.6, 0.5, 0.4, 1.0])
trajectory = cc.PtpTrajectory(start, velocity, target, 0.5 * limits.velocity, 0.3 * limits.acceleration)
print(f"all joints arrive after {trajectory.duration:.3f} s")

interpolator = cc.Interpolator(limits)
interpolator.reset(start)
time = np.arange(0.0, trajectory.duration + 0.5, CYCLE)
planned, followed = [], []
for t in time:
    position, speed, _ = trajectory.at(t)
    interpolator.step(speed + KP * (position - interpolator.position), CYCLE)
    planned.append(speed)
    followed.append(interpolator.velocity)
print(f"off by {np.degrees(np.abs(interpolator.position - target).max()):.4f} deg after another 0.5 s")

figure = new_figure(7, 4)
axes = figure.subplots()
lines = axes.plot(time, planned, "--", linewidth=0.8)
for line, values, name in zip(lines, np.transpose(followed), ("a1", "a2", "e1", "a3", "a4", "a5", "a6"), strict=True):
    axes.plot(time, values, color=line.get_color(), label=name)
axes.set_xlabel("time [s]")
axes.set_ylabel("joint velocity [rad/s], planned dashed")
axes.legend(ncols=4)
save(figure, __file__, options.out)
