#!/usr/bin/python3
"""Drive the arm against its limits: the guard slows the whole vector and names the reason."""

import coglab_controllers as cc
import numpy as np
from example_files import LIMITS, URDF, pyplot, save_plot

CYCLE = 0.005
chain = cc.Chain(URDF.read_text())
limits = cc.load_joint_limits(str(LIMITS))
guard = cc.Guard(chain, limits, cc.WorkspaceParameters(box_max=[1.2, 0.45, 1.6]), hand_speed=0.4)
interpolator = cc.Interpolator(limits)
interpolator.reset(np.array([0.0, 0.6, 0.0, -1.2, 0.0, 0.8, 0.0]))
request = np.array([0.5, 0.2, 0.0, 0.3, 0.4, 0.0, 1.4])

time, scales, reasons = CYCLE * np.arange(600), [], []
for _ in time:
    result = guard.limit(chain, interpolator.position, request)
    interpolator.step(result.velocity, CYCLE)
    scales.append(result.scale)
    reasons.append(result.reason)

pyplot.figure(figsize=(7, 3.5))
for reason in dict.fromkeys(reasons):
    chosen = np.array([r == reason for r in reasons])
    pyplot.plot(time[chosen], np.array(scales)[chosen], ".", markersize=3, label=reason)
pyplot.xlabel("time [s]")
pyplot.ylabel("share of the request that passes")
pyplot.legend()
save_plot(__file__)
