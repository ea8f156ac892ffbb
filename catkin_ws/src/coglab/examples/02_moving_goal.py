#!/usr/bin/python3
"""A goal that steps aside, then drifts, then trembles, and the estimate of it."""

import coglab_controllers as cc
import numpy as np
from example import PRIMITIVES, new_figure, parser, save

options = parser(__doc__).parse_args()
CYCLE = 0.005
UPRIGHT = [0.0, 0.0, 0.0, 1.0]
library = cc.Library()
library.load(str(PRIMITIVES))
rng = np.random.default_rng(1)


def goal_at(time: float) -> np.ndarray:
    """100 mm aside at 0.4 s, then 50 mm/s until 1.5 s."""
    y = 0.0 if time < 0.4 else 0.1 + 0.05 * (min(time, 1.5) - 0.4)
    return np.array([0.5, y, 0.0])


times = np.arange(0.0, 3.0, CYCLE)
seen = [goal_at(np.floor(30.0 * t) / 30.0) for t in times]  # a camera at 30 Hz
for i in range(0, len(times), 7):
    noise = rng.normal(scale=0.003, size=3)
    for k in range(i, min(i + 7, len(times))):
        seen[k] = seen[k] + noise

figure = new_figure(7, 5)
(top, bottom) = figure.subplots(2, sharex=True)
top.plot(times, [g[1] for g in seen], color="0.7", label="goal as received")
for constant, label in ((0.0, "estimator off"), (0.06, "estimator 0.06 s")):
    motion = cc.CartesianMotion(constant)
    motion.start(library["reach_human"], [0, 0, 0], UPRIGHT, seen[0], UPRIGHT)
    positions, accelerations = [], []
    for time, goal in zip(times, seen, strict=True):
        motion.step(CYCLE, goal, UPRIGHT)
        positions.append(motion.position)
        accelerations.append(motion.acceleration)
        if motion.event:
            print(f"{label}: {motion.event} at {time:.2f} s")
    top.plot(times, np.array(positions)[:, 1], label=label)
    bottom.plot(times, np.array(accelerations)[:, 1], label=label, linewidth=0.8)
top.set_ylabel("y [m]")
bottom.set_ylabel("y'' [m/s²]")
bottom.set_xlabel("time [s]")
top.legend()
save(figure, __file__, options.out)
