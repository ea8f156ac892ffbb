#!/usr/bin/python3
"""Follow a Cartesian motion with the arm: translation first, orientation with the remaining freedom."""

import coglab_controllers as cc
import numpy as np
from example import LIMITS, PRIMITIVES, URDF, new_figure, parser, save

options = parser(__doc__).parse_args()
CYCLE = 0.005
chain = cc.Chain(URDF.read_text())
limits = cc.load_joint_limits(str(LIMITS))
library = cc.Library()
library.load(str(PRIMITIVES))
start = np.array([0.9, 0.9, -0.4, -1.5, 0.3, 0.9, 0.2])
position, orientation = chain.fk(start)
goal = position + [0.1, -0.45, 0.15]
target = chain.fk(start + [0.0, 0.0, 0.0, 0.0, 0.6, -0.5, 0.4])[1]

figure = new_figure(7, 6)
axes = figure.subplots(3, sharex=True)
for first, label in ((True, "rotation shrunk first"), (False, "whole vector scaled")):
    ik = cc.TwoTaskIk(rotation_first_scaling=first, velocity_limit=0.6 * limits.velocity)
    motion, q, velocity = cc.CartesianMotion(), start.copy(), np.zeros(7)
    motion.start(library["reach_human"], position, orientation, goal, target)
    errors, angles, shares = [], [], []
    for _ in range(360):
        reference = motion.step(CYCLE, goal, target)
        result = ik.solve(chain, q, reference, velocity=velocity, dt=CYCLE)
        velocity = result.velocity
        errors.append(1000.0 * np.linalg.norm(result.position_error))
        angles.append(np.degrees(np.linalg.norm(result.rotation_error)))
        shares.append(np.max(np.abs(velocity) / limits.velocity))
        q = q + CYCLE * velocity
    time = CYCLE * np.arange(len(errors))
    for axis, values in zip(axes, (errors, angles, shares), strict=True):
        axis.plot(time, values, label=label)
for axis, label in zip(axes, ("position error [mm]", "orientation error [deg]", "share of speed limit"), strict=True):
    axis.set_ylabel(label)
axes[0].legend()
axes[-1].set_xlabel("time [s]")
save(figure, __file__, options.out)
