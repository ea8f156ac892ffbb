#!/usr/bin/python3
"""Drive the arm against its limits: the guard scales the whole vector down and reports the reason."""

import coglab_controllers as cc
import numpy as np
from example import LIMITS, URDF, new_figure, parser, save

options = parser(__doc__).parse_args()
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

figure = new_figure(7, 3.5)
axes = figure.subplots()
for reason in dict.fromkeys(reasons):
    chosen = np.array([r == reason for r in reasons])
    axes.plot(time[chosen], np.array(scales)[chosen], ".", markersize=3, label=reason)
axes.set_xlabel("time [s]")
axes.set_ylabel("passed share of the request")
axes.legend()
save(figure, __file__, options.out)
